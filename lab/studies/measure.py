"""One measurement: a method at a setting against the reference, its first call apart from its repeats."""

from __future__ import annotations

import time
from functools import partial
from typing import NamedTuple

import numpy as np

from grasp_ros import simulation
from grasp_ros.accuracy.contender import Contender, Solve
from grasp_ros.accuracy.measure import NOT_INSTALLED, Record, record_of, repeat
from grasp_ros.accuracy.truth import Truth, distance
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.files import decoding, replacing
from grasp_ros.scene.npz import Field, read_npz, signed
from lab import reference
from lab.reference.deadline import Deadline, deadline
from lab.studies.records import Journal, scene_key

DIGITS = 25
LATE = "stopped: longer"
TRUTH = {"grid": Field("<f8", ("n",)), "state": Field("<f8", ("n", 6)), "touches": Field("<i8", (2,))}


class Effort(NamedTuple):
    """How much time a study may spend."""

    patience: float  # s; a method that needs longer for one run climbs no further
    deadline: float  # s; a first run that needs longer is stopped, where Python can stop it
    budget: float  # s, of the repeats of one setting
    most: int  # repeats
    stride: int  # every how many settings of a ladder


FULL = Effort(patience=0.7, deadline=10.0, budget=0.25, most=30, stride=1)
QUICK = Effort(patience=0.2, deadline=60.0, budget=0.02, most=3, stride=4)


def check(scene: Scene) -> None:
    """Refuse what the outside peers do not know.

    Raises
    ------
    Refused
        If a pair starts in contact, or condition (10)'s second surface acts.
    """
    x_l, _, x_o, _, x_r, _ = scene.initial_state
    if not x_l < x_o < x_r:
        raise Refused(f"{scene.name}: starts in contact; allowed here: scenes that start with gaps on both sides")
    if any(event.kind == Transition.CLAMP for event in simulation.simulate(scene).events):
        raise Refused(f"{scene.name}: a pair separates faster than 1/p; allowed here: scenes where none does")


def truth(scene: Scene, journal: Journal) -> Truth:
    """The reference at the default output times; kept beside the journal.

    Raises
    ------
    Refused
        If what was kept is damaged, or cannot be written.
    """
    path = journal.directory / f"reference_{scene_key(scene)}.npz"
    if path.exists():
        with decoding(path, "a reference of a study"):
            data = read_npz(path, TRUTH)
            return Truth(data["grid"], data["state"], (int(data["touches"][0]), int(data["touches"][1])))
    grid = np.linspace(0.0, scene.duration, simulation.GRID_POINTS)
    exact = reference.integrate(scene.grasp, scene.initial_state.tolist(), grid.tolist(), digits=DIGITS)
    result = Truth(grid, exact.as_array(), (len(exact.touches[LEFT]), len(exact.touches[RIGHT])))
    with replacing(path) as file:
        np.savez_compressed(file, **signed({key: getattr(result, key) for key in TRUTH}))
    return result


def attempt(
    contender: Contender, scene: Scene, setting: float, target: Truth, effort: Effort, grid: Array | None = None
) -> tuple[Record, Solve | None]:
    """Build, run and repeat; the solver is None if there is no result.

    Parameters
    ----------
    grid : array (n,), s, optional
        The last output times of the target. Default: all of them.
    """
    grid = target.grid if grid is None else grid
    noted = partial(record_of, contender, scene, setting, target)
    begin = time.perf_counter()
    try:
        with deadline(effort.deadline):
            solve = contender.build(scene, setting)
            answer = solve(grid)
    except ImportError:
        return noted(NOT_INSTALLED, [time.perf_counter() - begin]), None
    except Deadline:
        return noted(f"{LATE} than {effort.deadline:g} s", [time.perf_counter() - begin]), None
    first = time.perf_counter() - begin
    if len(answer.state) != len(grid):
        return noted(answer.status, [first], answer), None
    times = [first, *repeat(solve, grid, effort.budget, effort.most)]
    return noted(answer.status, times, answer, distance(target, answer.state)), solve


def given_up(record: Record, effort: Effort) -> bool:
    """Whether tighter settings of this method are not worth a try."""
    late = record.status.startswith(LATE) or record.status == NOT_INSTALLED
    return late or (record.least or 0.0) > effort.patience

"""One measurement: a method at a setting against the reference, its first call apart from its repeats."""

from __future__ import annotations

import statistics
import time
from typing import NamedTuple

import numpy as np

from grasp_ros import simulation
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.files import decoding, replacing
from grasp_ros.scene.npz import Field, read_npz, signed
from lab import reference
from lab.reference.deadline import Deadline, deadline
from lab.studies.peers import Answer, Contender, Solve
from lab.studies.records import Journal, Record, scene_key

DIGITS = 25


class Truth(NamedTuple):
    """The solution in high precision."""

    grid: Array  # (n,), s
    state: Array  # (n, 6), m and m/s
    touches: tuple[int, int]


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
        np.savez_compressed(file, **signed(result._asdict()))
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
    begin = time.perf_counter()

    def record(answer: Answer | None, status: str, times: list[float], error: float | None) -> Record:
        return Record(
            scene.name, contender.family, contender.name, contender.knob, setting, error,
            statistics.median(times) if times else None, min(times, default=None), len(times), first,
            answer and answer.steps, answer and answer.right_hand_sides, answer and answer.touches, target.touches,
            status,
        )

    try:
        with deadline(effort.deadline):
            solve = contender.build(scene, setting)
            answer = solve(grid)
            first = time.perf_counter() - begin
    except (ImportError, Deadline) as reason:
        first = time.perf_counter() - begin
        late = f"stopped: longer than {effort.deadline:g} s"
        return record(None, "not installed" if isinstance(reason, ImportError) else late, [], None), None
    complete = len(answer.state) == len(grid)
    error = float(np.abs(answer.state - target.state[-len(grid) :]).max()) if complete else None
    times = repeat(solve, grid, effort) if complete else []
    return record(answer, answer.status, times, error), solve if complete else None


def repeat(solve: Solve, grid: Array, effort: Effort) -> list[float]:
    """Seconds of warm runs, within the budget."""
    times: list[float] = []
    while not times or (sum(times) < effort.budget and len(times) < effort.most):
        times.append(seconds(solve, grid))
    return times


def seconds(solve: Solve, grid: Array) -> float:
    """One run."""
    begin = time.perf_counter()
    solve(grid)
    return time.perf_counter() - begin


def given_up(record: Record, effort: Effort) -> bool:
    """Whether tighter settings of this method are not worth a try."""
    late = record.status.startswith("stopped: longer") or record.status == "not installed"
    return late or (record.least or 0.0) > effort.patience

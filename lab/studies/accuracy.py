"""What accuracy costs in time: every method at every setting on every scene, against the reference.

The study resumes where it stopped: what is in the journal and was measured on this machine, with these versions and
these sources, is not measured again.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.accuracy import measure
from grasp_ros.accuracy.measure import DONE, NOT_INSTALLED, Answer, Contender, Record, Solve, Truth, own_contenders
from grasp_ros.methods.equations import parameters
from grasp_ros.methods.library import slopes
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import GRID_POINTS
from lab.reference import integrate
from lab.reference.deadline import Deadline, deadline
from lab.studies import peer_heyoka, peer_sundials
from lab.studies.records import Journal, origin, scene_key

STANDARD = ("case_01", "case_02", "case_03", "case_04")
STIFF = ("case_01", 1e8)  # ten thousand times the paper's Hertz coefficient
TARGETS = (1e-3, 1e-6, 1e-9, 1e-11)
DIGITS = 25
LATE = "stopped: longer"
MAX_STEPS = 10_000_000  # of odeint
METRIC = (  # the label of every axis and column that shows `Record.error`
    f"largest absolute error over six states (m, m/s) and {GRID_POINTS} output times,"
    f" against a reference of {DIGITS} digits"
)


class Known(NamedTuple):
    """What the reference says, in a journal."""

    state: list[list[float]]  # at the output times
    touches: tuple[int, int]


class Effort(NamedTuple):
    """How much time a study may spend."""

    each: measure.Effort  # on a setting
    deadline: float  # s; runs that need longer are stopped, where Python can stop them
    stride: int  # every how many settings of a ladder


FULL = Effort(measure.Effort(patience=0.7, budget=0.25, most=30), deadline=20.0, stride=1)
QUICK = Effort(measure.Effort(patience=0.2, budget=0.02, most=3), deadline=60.0, stride=4)


def default_scenes() -> list[Scene]:
    """Cases 1 to 4 of the paper, and case 1 with a contact that is stiffer by 1e4."""
    name, hertzian = STIFF
    stiff = scenes.load(name, [f"{side}_contact.hertz_N_per_m1_5={hertzian}" for side in ("left", "right")])
    return [*map(scenes.load, STANDARD), replace(stiff, name=f"{name}_H{hertzian:.0e}".replace("+0", ""))]


def all_contenders(scene: Scene) -> list[Contender]:
    """The methods of `grasp simulate` that can treat a scene, and the outside peers."""
    own, _ = own_contenders(scene)
    odeint = Contender("scipy", "odeint", "tolerance", METHODS["lsoda"].ladder, _odeint)
    return [*own, odeint, *peer_sundials.contenders(), *peer_heyoka.contenders()]


def _odeint(scene: Scene, tolerance: float) -> Solve:
    """LSODA over everything, with its loop over the steps outside Python."""
    from scipy.integrate import odeint

    args = (parameters(scene.system), True, True)

    def solve(grid: Array) -> Answer:
        times = grid if grid[0] == 0.0 else np.concatenate([[0.0], grid])
        with warnings.catch_warnings():  # an integration that fails says so in its status
            warnings.simplefilter("ignore")
            states, report = odeint(
                slopes, scene.initial_state, times, args, rtol=tolerance, atol=tolerance, tfirst=True,
                mxstep=MAX_STEPS, full_output=True,
            )
        status = DONE if report["message"] == "Integration successful." else report["message"]
        return Answer(states[-len(grid) :], None, status, int(report["nst"][-1]), int(report["nfe"][-1]))

    return solve


def run(subjects: Sequence[Scene], directory: Path, effort: Effort, contenders: Sequence[Contender]) -> list[Record]:
    """Measure what is not in the journal yet, each method from loose to tight until a run takes too long."""
    journal = Journal(directory)
    records: list[Record] = []
    ladders = [contender.ladder[:: effort.stride] for contender in contenders]
    with tqdm(total=len(subjects) * sum(map(len, ladders)), unit="setting", file=sys.stderr) as bar:
        for scene in subjects:
            for contender, ladder in zip(contenders, ladders, strict=True):
                bar.set_description(f"{scene.name} {contender.name}")
                made_by = origin(contender.family)
                for setting in ladder:
                    key = f"{scene_key(scene)} {made_by} {contender.name} {setting!r} {effort.each.budget}"
                    record = journal.kept(key, Record, partial(_attempt, contender, scene, setting, journal, effort))
                    records.append(record._replace(scene=scene.name))
                    if given_up(record, effort):
                        break
                bar.update(len(ladder))
    return records


def _attempt(contender: Contender, scene: Scene, setting: float, journal: Journal, effort: Effort) -> Record:
    return attempt(contender, scene, setting, truth(scene, journal), effort)


def truth(scene: Scene, journal: Journal) -> Truth:
    """The reference at the default output times; kept in the journal."""
    grid = np.linspace(0.0, scene.duration, GRID_POINTS)
    known = journal.kept(f"reference {scene_key(scene)} {len(grid)}", Known, partial(_reference, scene, grid.tolist()))
    return Truth(grid, np.array(known.state), known.touches)


def _reference(scene: Scene, grid: list[float]) -> Known:
    exact = integrate(scene, grid, DIGITS)
    return Known(exact.as_array().tolist(), (len(exact.touches[LEFT]), len(exact.touches[RIGHT])))


def attempt(contender: Contender, scene: Scene, setting: float, target: Truth, effort: Effort) -> Record:
    """What `grasp accuracy` measures, stopped where it takes too long."""
    begin = time.perf_counter()
    try:
        with deadline(effort.deadline):
            return measure.attempt(contender, scene, setting, target, effort.each)
    except Deadline:
        status = f"{LATE} than {effort.deadline:g} s"
        return measure.record_of(contender, scene, setting, target, status, [time.perf_counter() - begin])


def given_up(record: Record, effort: Effort) -> bool:
    """Whether tighter settings of this method are not worth a try."""
    late = record.status.startswith(LATE) or record.status == NOT_INSTALLED
    return late or (record.least or 0.0) > effort.each.patience


def frontier(records: Iterable[Record]) -> list[Record]:
    """The records that no other beats in both time and error, from fast to accurate."""
    best: list[Record] = []
    for record in sorted((r for r in records if r.good), key=lambda r: (r.time, r.error or 0.0)):
        if not best or (record.error or 0.0) < (best[-1].error or 0.0):
            best.append(record)
    return best

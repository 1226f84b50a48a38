"""One measurement: a method at a setting against the reference, within a time."""

from __future__ import annotations

import time
from functools import partial
from typing import NamedTuple

import numpy as np

from grasp_ros import simulation
from grasp_ros.accuracy import measure
from grasp_ros.accuracy.measure import NOT_INSTALLED, Contender, Record, Truth
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.scene import Scene
from lab.reference import integrate
from lab.reference.deadline import Deadline, deadline
from lab.studies.records import Journal, scene_key

DIGITS = 25
LATE = "stopped: longer"


class Known(NamedTuple):
    """What the reference says, in a journal."""

    state: list[list[float]]  # at the output times
    touches: tuple[int, int]


class Effort(NamedTuple):
    """How much time a study may spend."""

    patience: float  # s; a method that needs longer for one run climbs no further
    deadline: float  # s; runs that need longer are stopped, where Python can stop them
    budget: float  # s, of the repeats of one setting
    most: int  # repeats
    stride: int  # every how many settings of a ladder


FULL = Effort(patience=0.7, deadline=20.0, budget=0.25, most=30, stride=1)
QUICK = Effort(patience=0.2, deadline=60.0, budget=0.02, most=3, stride=4)


def truth(scene: Scene, journal: Journal) -> Truth:
    """The reference at the default output times; kept in the journal."""
    grid = np.linspace(0.0, scene.duration, simulation.GRID_POINTS)
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
            return measure.attempt(
                contender, scene, setting, target, measure.Effort(effort.patience, effort.budget, effort.most))
    except Deadline:
        status = f"{LATE} than {effort.deadline:g} s"
        return measure.record_of(contender, scene, setting, target, status, [time.perf_counter() - begin])


def given_up(record: Record, effort: Effort) -> bool:
    """Whether tighter settings of this method are not worth a try."""
    late = record.status.startswith(LATE) or record.status == NOT_INSTALLED
    return late or (record.least or 0.0) > effort.patience

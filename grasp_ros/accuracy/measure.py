"""One measurement: a solver at a setting, its first call apart from its repeats."""

from __future__ import annotations

import statistics
import time
from typing import NamedTuple

from grasp_ros.accuracy.contender import DONE, Answer, Contender, Solve
from grasp_ros.accuracy.truth import Truth, distance
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene

NOT_INSTALLED = "not installed"


class Effort(NamedTuple):
    """How much time measurements may take."""

    patience: float  # s; a solver that needs longer for one run climbs no further
    budget: float  # s, of the repeats of one setting
    most: int  # repeats
    stride: int = 1  # every how many settings of a ladder


class Record(NamedTuple):
    """What was measured."""

    scene: str
    family: str
    method: str
    knob: str
    setting: float
    error: float | None  # largest, over all output times and states, m and m/s; None: no result
    seconds: float | None  # median of the warm runs
    least: float | None  # s
    repeats: int
    first: float  # s, of the first run, with what it compiles
    steps: int | None
    right_hand_sides: int | None
    found: tuple[int, int] | None  # touches
    there_are: tuple[int, int]
    status: str

    @property
    def missed(self) -> int | None:
        """Touches too few or too many; None: it does not look for them."""
        if self.found is None:
            return None
        return sum(abs(found - there) for found, there in zip(self.found, self.there_are, strict=True))

    @property
    def sound(self) -> bool:
        """Whether it has a result that may be used: to the end, and with the right number of touches."""
        return self.error is not None and self.seconds is not None and self.status == DONE and not self.missed

    @property
    def time(self) -> float:
        """Fastest warm run in s; infinite without one."""
        return float("inf") if self.least is None else self.least


def attempt(contender: Contender, scene: Scene, setting: float, truth: Truth, effort: Effort) -> Record:
    """Build a solver, run it, repeat it."""
    begin = time.perf_counter()

    def record(answer: Answer | None, status: str, times: list[float], error: float | None) -> Record:
        return Record(
            scene.name, contender.family, contender.name, contender.knob, setting, error,
            statistics.median(times) if times else None, min(times, default=None), len(times), first,
            answer and answer.steps, answer and answer.right_hand_sides, answer and answer.touches, truth.touches,
            status)

    try:
        solve = contender.build(scene, setting)
        answer = solve(truth.grid)
    except ImportError:
        first = time.perf_counter() - begin
        return record(None, NOT_INSTALLED, [], None)
    first = time.perf_counter() - begin
    if len(answer.state) < len(truth.grid):
        return record(answer, answer.status, [], None)
    error = max(distance(truth, answer.state), truth.uncertainty)  # nothing is known better than that
    return record(answer, answer.status, _repeat(solve, truth.grid, effort), error)


def _repeat(solve: Solve, grid: Array, effort: Effort) -> list[float]:
    """Seconds of warm runs, within the budget."""
    times: list[float] = []
    while not times or (sum(times) < effort.budget and len(times) < effort.most):
        begin = time.perf_counter()
        solve(grid)
        times.append(time.perf_counter() - begin)
    return times

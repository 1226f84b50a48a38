"""What a hard case is, and who solves it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from grasp_ros.exact.events import Event
from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Status
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import Trajectory, simulate
from lab.cases.families import Family


class Unfinished(Exception):  # noqa: N818
    """A solver that does not deliver what was asked for; the text is its status."""


class Solver(Protocol):
    """Whoever integrates the scenes of a case."""

    def states(self, scene: Scene, times: Iterable[float]) -> Array:
        """States (n, 6) with continuous feedback at ascending times in s; raises Unfinished."""

    def events(self, scene: Scene) -> list[Event]:
        """All events up to the scene's end; raises Unfinished, also if the solver does not look for them."""


@dataclass
class Product:
    """The simulation of this package."""

    max_events: int = MAX_EVENTS
    max_work: int = MAX_WORK
    accuracy: float = ACCURACY  # see `exact.Integrator`
    runs: list[Trajectory] = field(default_factory=list)  # all so far; a run that was stopped is there as far as it got

    def run(self, scene: Scene, times: Iterable[float] | None = None, sampled: bool = False) -> Trajectory:
        """Simulate a scene to its end; raises Unfinished if it ends with another status than DONE."""
        grid = None if times is None else np.array(list(times))
        result = simulate(scene, grid=grid, sampled=sampled, setting=self.accuracy, max_events=self.max_events,
                          max_work=self.max_work)
        self.runs.append(result)
        if result.status is not Status.DONE:
            raise Unfinished(result.status.value)
        return result

    def states(self, scene: Scene, times: Iterable[float]) -> Array:
        """States (n, 6) at ascending times."""
        return self.run(scene, times).state

    def events(self, scene: Scene) -> list[Event]:
        """All events."""
        return self.run(scene, [scene.duration]).events


def recorded(solver: Solver) -> list[Event] | None:
    """Events that the product recorded in its last run; None of another solver, which need not look for them."""
    if not isinstance(solver, Product):
        return None
    return [event._replace(state=()) for event in solver.runs[-1].events]  # states are compared by themselves


@dataclass(frozen=True)
class Case:
    """A hard case."""

    family: Family  # why it is hard, and what decides
    name: str
    error: Callable[..., float]  # runs it with a Solver, or the Product, and returns its error by the oracle, >= 0
    bound: float  # what the product promises for the error
    note: str = ""  # where the reason or the oracle differs from the family's
    limit: Status = Status.DONE  # a status with which the product may end instead; DONE: none
    product_only: bool = False  # the error needs more than states and events, which other solvers do not have
    max_events: int = MAX_EVENTS  # budget of contact events
    max_work: int = MAX_WORK

    @property
    def oracle(self) -> str:
        """What decides: the oracle of the family, and where it differs the note."""
        return f"{self.family.oracle}; {self.note}" if self.note else self.family.oracle


@dataclass(frozen=True)
class Verdict:
    """How a case ended."""

    error: float | None  # None: no result
    status: str

    def right(self, case: Case) -> bool:
        """Whether the error is within the bound, or the status is the announced one."""
        if self.error is not None:
            return self.error <= case.bound  # False for NaN
        return case.limit is not Status.DONE and self.status == case.limit.value


def evaluate(case: Case, solver: Solver) -> Verdict:
    """Run a case."""
    try:
        return Verdict(float(case.error(solver)), Status.DONE.value)
    except Unfinished as reason:
        return Verdict(None, str(reason))

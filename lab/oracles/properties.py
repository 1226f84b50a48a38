"""What must hold for every scene there is."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Of, Work
from grasp_ros.physics.model import penetration
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene, SceneError
from grasp_ros.simulation import Trajectory
from lab.cases.case import Product, Unfinished
from lab.oracles.metamorphic import mirror, scaling
from lab.oracles.motion import ledgers
from lab.oracles.replay import AFTER, BEFORE, findings
from lab.oracles.restart_check import digits, reversal, splitting
from lab.oracles.segments import Detail, Pieces, cut, detail, grid_of, pieces_of
from lab.reference.grasp import commands

MOST_EVENTS = 2000
MOST_WORK = 100_000  # of a run
CHEAP = 3_000  # work beyond which the relations that need more runs are left out
LIMIT = 100.0  # units of rounding
UNITS = 4.0, 2.0, 0.5  # of length, time and mass
SHALLOW = 1e-85  # m or m/s: below, what a touch moves, like u^3.5, may be denormal, and in other units other numbers
SPLIT = 4  # every how many scenes a run is started anew, and run backwards


class Check(NamedTuple):
    """What became of a property."""

    name: str
    error: float
    bound: float
    skipped: int = 0  # pieces that the quadrature does not resolve

    @property
    def holds(self) -> bool:
        """Whether the error is within its bound; False for NaN."""
        return self.error <= self.bound


class Examination(NamedTuple):
    """What became of a scene."""

    end: str  # the status of its run
    checks: list[Check]

    @property
    def broken(self) -> list[Check]:
        """Properties that do not hold."""
        return [check for check in self.checks if not check.holds]


def examine(scene: Scene, every: bool = True, max_work: int = MOST_WORK, compare: bool = False
            ) -> Examination:
    """Run a scene and check all properties that can be checked for it.

    With `every` also those that take more runs and are not worth it for each of many scenes; with `compare` also with
    the reference, if that takes no longer than some seconds. `max_work` is the budget of each run.
    """
    product = Product(MOST_EVENTS, max_work)
    with np.errstate(over="ignore", invalid="ignore", under="ignore", divide="ignore"):
        try:
            first = product.run(scene, None if scene.sampled else [0.0, scene.duration])
        except Unfinished:
            run = product.runs[-1]
            return Examination(run.status.value, [_end(run)])
        return Examination(first.status.value, list(_checks(first, product, every, compare)))


def _end(run: Trajectory) -> Check:
    """Whether a run may end like this: out of budget, or outside the domain if something drives it."""
    error = float(run.status in (Status.STALLED, Status.ENERGY_RISES, Status.ENERGY_FALLS, Status.PENETRATES))
    system = run.scene.system
    pushed = (system.closed_loop[:, Of.FORCE] != 0.0) & (system.closed_loop[:, Of.STIFFNESS] == 0.0)
    driven = run.sampled or bool(system.external) or pushed.any()  # any work: held commands, and steady forces
    if run.status is Status.NOT_FINITE or (run.status is Status.OUTSIDE and not driven):
        error = 1.0
    return Check(f"ends {run.status.name}", error, 0.0)


def _checks(first: Trajectory, product: Product, every: bool, compare: bool) -> Iterator[Check]:
    close = look(first, pieces_of(first), product)
    run = close.run
    same = np.array_equal(first.event_table, run.event_table)
    same &= np.array_equal(np.nan_to_num(first.state[-1]), np.nan_to_num(run.state[-1]))
    yield Check("grid independence", float(not same), 0.0)
    yield from states(run)
    if first.sampled:
        yield Check("held inputs", _held(first), 0.0)
    yield from _balances(close, product)
    for name, error in findings(close):
        yield Check(name, error, LIMIT)
    spent = int(run.work[Work.FLIGHTS] + run.work[Work.CONTACT_STEPS] + run.work[Work.ROOT_ITERATIONS])
    if spent <= CHEAP:
        yield from _related_runs(close, first, product, every, compare)


def _related_runs(close: Detail, first: Trajectory, product: Product, every: bool, compare: bool) -> Iterator[Check]:
    """What takes more runs; one that ends as no run may is a failure, too."""
    part = zlib.crc32(close.run.state[-1].tobytes()) / 2**32
    relations: list[tuple[str, int, Callable[[], float | None], float]] = [
        ("mirror", 1, partial(_mirror, first.scene, product), 0.0),
        ("scaling", 1, partial(_units, first.scene, product, _smallest(close.run)), 0.0),
        ("splitting", SPLIT, partial(splitting, close, part * SPLIT % 1.0, product), LIMIT),
        ("time reversal", SPLIT, partial(reversal, first, product), LIMIT),
    ]
    if compare:
        relations.append(("reference", 1, partial(digits, first, product), LIMIT))
    for name, rarely, relation, bound in relations:
        if not every and part * rarely >= 1.0:
            continue
        try:
            if (error := relation()) is not None:
                yield Check(name, error, bound)
        except Unfinished:
            yield _end(product.runs[-1])


def _mirror(scene: Scene, product: Product) -> float | None:
    """Noise and sines have no mirror image."""
    return None if any(section.endswith(("_sensor", "_sine")) for section in scene.values) else mirror(scene, product)


def _units(scene: Scene, product: Product, smallest: float) -> float | None:
    """Only where no number leaves its range, nor becomes denormal on the way."""
    with suppress(SceneError):
        return scaling(*UNITS, scene, product) if smallest >= SHALLOW else None
    return None


def _smallest(run: Trajectory) -> float:
    """The smallest number that is not 0 in states and differences, in m or m/s."""
    numbers = np.abs(np.nan_to_num(np.concatenate([run.state.ravel(), *penetration(run.state)])))
    return float(numbers[numbers > 0.0].min(initial=np.inf))


def look(run: Trajectory, pieces: Pieces, product: Product) -> Detail:
    """The same run with outputs at the nodes of its pieces."""
    grid = grid_of(pieces)
    again = product.run(run.scene, np.append(grid.ravel(), run.scene.duration))
    return detail(again, pieces, grid)


def _held(run: Trajectory) -> float:
    """Number of ticks at which other inputs acted than the laws answer to the states, late by the delay."""
    system, states = run.scene.system, np.nan_to_num(run.state)
    answers = [np.zeros(3)] * (system.delay + 1)
    for tick, state in enumerate(states[:-1]):
        answers.append(commands(system, tick, state, answers[-1]))
    wanted = [answers[tick + 1] + system.external_at(tick) for tick in range(len(states) - 1)]
    return float(np.count_nonzero((np.array(wanted) != run.inputs[:-1]).any(axis=1)))


def _balances(close: Detail, product: Product) -> Iterator[Check]:
    """Equations of motion and energy; where they fail, those of shorter pieces count."""
    books = list(ledgers(close))
    found = {ledger.name: ledger.error for ledger in books}
    skipped = {ledger.name: int(np.count_nonzero(~ledger.resolved)) for ledger in books}
    fails = np.logical_or.reduce([~(error <= LIMIT) for error in found.values()])
    if fails.any():
        shorter, first = cut(close.pieces, fails)
        for ledger in ledgers(look(close.run, shorter, product)):
            found[ledger.name] = np.where(fails, np.maximum.reduceat(ledger.error, first), found[ledger.name])
    for name, error in found.items():
        yield Check(name, float(error.max(initial=0.0)), LIMIT, skipped[name])


def states(run: Trajectory) -> list[Check]:
    """Finite, all there, events in order and alternating."""
    system = run.scene.system
    there = [COLUMN[body] + k for body in system.present for k in (0, 1)]
    broken = 0
    for side in (LEFT, RIGHT, OBJECT):
        kinds = [event.kind for event in run.events if event.side == side]
        broken += sum(not any(AFTER[one] is mode for mode in BEFORE[other]) for one, other in pairwise(kinds))
    times = run.event_table[:, 0]
    return [
        Check("finite", float(np.count_nonzero(~np.isfinite(run.state[:, there]))), 0.0),
        Check("order of events", float(np.count_nonzero(np.diff(times) < -EPS * times[1:]) + broken), 0.0),
    ]

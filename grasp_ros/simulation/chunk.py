"""A chunk of an ensemble: rows, which are variants of a scene, one after the other, and their outcomes.

Most keys are numbers of bodies, pairs or feedback, which go straight into arrays: a whole block of rows is checked and
built at once. Rows that such a check finds fault with, and rows of any other key, are made as a scene of their own, so
that the rules and the sentences are those of `scene.validation` alone.

A plain row is integrated with its chunk in one call (`observe.ensemble`), without the interpreter. Any other, and a
plain one that stops, is driven as `simulate` drives a scene. Both give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grasp_ros.exact.compilation.jit import COMPILED
from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Integrator, Status
from grasp_ros.observe.ensemble import Limits, Rows, integrate_rows
from grasp_ros.observe.observer import settle, watch
from grasp_ros.observe.record import SEEN, Seen, Wanted
from grasp_ros.physics import given
from grasp_ros.physics.accuracy import ACCURACY, check_accuracy
from grasp_ros.physics.control import Column
from grasp_ros.physics.domain import Systems, outside_rows
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Entry, Of, Transition
from grasp_ros.physics.layout import Outcome as Ended
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene, SceneError
from grasp_ros.scene.targets import TARGETS, check_scene, parameter_of, target_of
from grasp_ros.simulation.closed_loop import drive
from grasp_ros.simulation.outcomes import LAST, LYAPUNOV, Outcome, Runs, find, wanted_by

SETTLED = 0.02  # of the largest initial displacement
HORIZONS = 120  # for which a run goes on at most, until V_c decides whether it has settled
REFUSED = "REFUSED"
STATUSES = (Status.DONE.name, REFUSED, *(status.name for status in Status if status is not Status.DONE))
NEVER = np.zeros(1, dtype=np.int64)
Drive = Callable[[Scene, Integrator, bool, Array], Array]  # see `closed_loop.drive`
LEFT_OUT = -2  # in place of why a row ended


class Setup(NamedTuple):
    """Settings of the runs of an ensemble, besides the scene and its parameters.

    Attributes
    ----------
    outcomes : tuple of str
        Columns or groups, see `outcomes`.
    accuracy : float
        Of `exact`, see `exact.integrator.Integrator`.
    sampled : bool
        See `simulate`.
    settled : float
        Fraction of the largest initial displacement within which a run counts as settled.
    horizons : int
        A run whose settling time is requested continues until V_c proves it, for at most this many horizons.
    max_events, max_work : int
        Budgets of each row.
    """

    outcomes: tuple[str, ...] = ("settling_time", "touches")
    accuracy: float = ACCURACY
    sampled: bool = False
    settled: float = SETTLED
    horizons: int = HORIZONS
    max_events: int = MAX_EVENTS
    max_work: int = MAX_WORK


class Variants:
    """Rows of a scene: changes of its numbers by "section.key", arrays (n,) of one length."""

    def __init__(self, scene: Scene, changes: Mapping[str, ArrayLike]) -> None:
        self.scene = scene
        self.changes = {str(name): given.column(f"changes: {name}", values)
                        for name, values in given.mapping("changes", changes).items()}
        self._parameters = {name: parameter_of(scene, name) for name in self.changes}
        lengths = {name: len(values) for name, values in self.changes.items()}
        if len(set(lengths.values())) > 1:
            raise Refused(f"changes: lengths {lengths} are not allowed; allowed: arrays (n,) of one length")
        self.rows = next(iter(lengths.values()), 1)

    def part(self, first: int, last: int) -> Variants:
        """Rows from the first to before the last one."""
        return Variants(self.scene, {name: column[first:last] for name, column in self.changes.items()})

    def row(self, i: int) -> Scene:
        """One row as a scene."""
        return self.scene.changed({name: float(column[i]) for name, column in self.changes.items()})

    @cached_property
    def is_plain(self) -> bool:
        """Whether all rows follow from arrays: changed are numbers of bodies, pairs and feedback that have a target."""
        return all(target_of(self.scene, name) for name in self.changes)

    def faults(self) -> dict[int, str]:
        """Sentences for the rows that the scene's rules refuse."""
        uncertain = np.full(self.rows, not self.is_plain)
        if self.is_plain:  # outside a range, with a negative sum of an arm's own number and its feedback's, or outside
            block, bodies = self.block, self.closed_loop
            uncertain |= (bodies[:, : OBJECT, Of.STIFFNESS : Of.FORCE] < 0.0).any(axis=(1, 2))
            with np.errstate(all="ignore"):  # an uncertain row may hold any number
                for name, column in self.changes.items():
                    uncertain |= ~self._parameters[name].holds(column)
                uncertain |= outside_rows(Systems(bodies, block["pairs"], block["state"][..., 0], self.scene.duration))
        found = {}
        for i in np.flatnonzero(uncertain).tolist():
            try:
                self.row(i)
            except SceneError as error:
                found[i] = str(error)
        return found

    @cached_property
    def block(self) -> dict[str, Array]:
        """The rows as arrays, where `is_plain`, by their names in a `System`.

        Bodies (n, 3, 4), pairs (n, 2, 2), state (n, 6, 1), coulomb (n, 1, 1), laws (n, 2, k), see `control.Column`.
        """
        system = self.scene.system
        block = {name: np.repeat(array[None], self.rows, axis=0) for name, array in (
            ("bodies", system.bodies), ("pairs", system.pairs), ("state", system.state[:, None]),
            ("coulomb", np.full((1, 1), system.coulomb)), ("laws", system.law_rows))}
        for name, column in self.changes.items():
            array, row, entry = TARGETS[name]
            block[array][:, row, entry] = column
        return block

    @cached_property
    @np.errstate(all="ignore")  # a row that is refused may hold any number
    def closed_loop(self) -> Array:
        """The bodies with the continuous feedback in them, (n, 3, 4), as `System.closed_loop` has it."""
        bodies, laws = self.block["bodies"].copy(), self.block["laws"]
        arms, gain = bodies[:, :OBJECT], laws[..., Column.POSITION_GAIN]
        arms[..., Of.STIFFNESS] += gain
        arms[..., Of.DAMPING] += laws[..., Column.VELOCITY_GAIN]
        arms[..., Of.FORCE] += gain * laws[..., Column.SET_POINT] + laws[..., Column.FEED_FORWARD]
        return bodies


class Chunk(NamedTuple):
    """Outcomes of n rows."""

    columns: dict[str, Array]  # (n,)
    status: np.ndarray  # (n,) indices of `STATUSES`
    stops: dict[int, str]  # why and where a row was refused or stopped, by its index among these rows


def check(scene: Scene, setup: Setup | None, outcomes: Sequence[str] | None = None) -> tuple[Setup, list[Outcome]]:
    """A setup with numbers of Python's own, and the columns that it asks for; refused if a scene cannot have them.

    None: the setup without arguments. Other outcomes take the place of its.
    """
    check_scene(scene)
    setup = Setup() if setup is None else given.instance("setup", setup, Setup, "a Setup of grasp_ros.simulation")
    setup = Setup(
        given.names("outcomes", setup.outcomes if outcomes is None else outcomes), check_accuracy(setup.accuracy),
        given.truth("sampled", setup.sampled), given.number("settled", setup.settled),
        *(given.whole(name, getattr(setup, name), 1) for name in ("horizons", "max_events", "max_work")))
    columns = find(setup.outcomes)
    if not 0.0 < setup.settled < 1.0:
        raise Refused(f"settled: {setup.settled!r} is not allowed; allowed: a number > 0 and < 1")
    if has_inputs(scene, setup) and LYAPUNOV in setup.outcomes:
        raise Refused(f"{scene.name}: outcome lyapunov: allowed: continuous feedback, no external force")
    return setup, columns


def compute(variants: Variants, setup: Setup, stop: NDArray[np.int64] = NEVER, move: Drive = drive) -> Chunk:
    """Run some rows, one after the other; a `stop` that is not 0 ends it early, with rows left out."""
    columns, n = find(setup.outcomes), variants.rows
    wanted = wanted_by(columns)
    runs = Runs(np.full((n, SEEN), np.nan), np.full((n, 6), np.nan), np.zeros((n, 2)), np.full(n, np.nan))
    status, stops = np.zeros(n, dtype=np.int8), variants.faults()
    status[[*stops]] = STATUSES.index(REFUSED)
    left = np.flatnonzero(status == 0)
    plain = COMPILED and variants.is_plain and not has_inputs(variants.scene, setup)  # rows need no interpreter
    if plain and move is drive and LYAPUNOV not in setup.outcomes:
        left = _run_plain(variants, setup, wanted, runs, left, stop)
    for i in left.tolist():
        if stop[0]:
            break
        ended, stopped = _run(variants.row(i), setup, wanted, runs, i, move)
        if ended is not Status.DONE:
            status[i], stops[i] = STATUSES.index(ended.name), stopped
    system = variants.scene.system
    runs.state[:, system.absent_columns] = np.nan
    runs.seen[:, [*(first + body for first in (Seen.OUTSIDE, Seen.LAST_OUTSIDE) for body in system.absent),
                  *(first + i for first in (Seen.LOW, Seen.HIGH) for i in system.absent_columns)]] = np.nan
    found = {column.name: np.array(column.read(runs)) for column in columns}
    for name, values in found.items():
        values[status != 0 if name not in LAST else status == STATUSES.index(REFUSED)] = np.nan
    return Chunk(found, status, stops)


def has_inputs(scene: Scene, setup: Setup) -> bool:
    """Whether something acts that is no law of the state: commands that are held, or forces from outside."""
    return setup.sampled or scene.sampled or bool(scene.system.external)


def _run_plain(variants: Variants, setup: Setup, wanted: Wanted, runs: Runs, which: NDArray[np.int64],
               stop: NDArray[np.int64]) -> NDArray[np.int64]:
    """Integrate rows in one call; returns those that are left to `_run`, because they do not just reach the end."""
    block, outcome = variants.block, np.full(variants.rows, LEFT_OUT)
    runs.state[:] = block["state"][..., 0]
    rows = Rows(which, variants.closed_loop, block["bodies"],
                np.ascontiguousarray(block["laws"][..., : Column.SET_POINT]), block["pairs"], block["coulomb"].ravel(),
                runs.state, runs.seen, runs.touches, outcome)
    limits = Limits(setup.accuracy, setup.max_events, setup.max_work, stop, setup.settled, setup.horizons)
    integrate_rows(rows, variants.scene.duration, wanted, limits)
    return np.asarray(which[outcome[which] != Ended.DONE])


def _run(scene: Scene, setup: Setup, wanted: Wanted, runs: Runs, i: int, move: Drive) -> tuple[Status, str]:
    """One row, driven as `simulate` drives it, or by other commands; how it ended at its horizon, and why."""
    system, sampled = scene.system, setup.sampled or scene.sampled
    run = Integrator(
        system, continuous=not sampled, accuracy=setup.accuracy, max_events=setup.max_events, max_work=setup.max_work)
    run_observer = watch(run, wanted, setup.settled) if wanted else None
    move(scene, run, sampled, np.zeros(0))
    touched = run.event_table[run.event_table[:, Entry.KIND] == Transition.TOUCH, Entry.BODY]
    runs.state[i], runs.touches[i] = run.state, [(touched == side).sum() for side in (LEFT, RIGHT)]
    ended, done = (run.status, run.stop), run.status is Status.DONE
    if done and LYAPUNOV in setup.outcomes:
        from grasp_ros.sensitivity.spectrum import spectrum  # whose kernels no other run loads

        with suppress(Refused):  # a run in pieces of time may stop where this one did not
            runs.growth[i] = spectrum(scene, accuracy=setup.accuracy)[0]
    if run_observer is not None:
        run_observer.finish()
        if done and wanted & Wanted.SETTLING:
            settle(run, run_observer, scene.duration, setup.horizons)
        runs.seen[i] = run_observer.seen
    return ended

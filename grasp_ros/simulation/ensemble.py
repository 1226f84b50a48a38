"""Ensembles: many variants of one scene, each row a run of its own, and of each run its outcomes alone.

A row gives the bits of `simulate` for the scene with its numbers: it is the same integrator, driven the same way, with
an observer (`exact.watcher`) in place of an output grid. Rows know nothing of each other, so that they do not depend on
threads, order or chunks. A row that a scene's rules refuse, or whose run stops, says so in a sentence.

Rows are computed in chunks, which are all that memory holds beside the table: the kernels release the interpreter's
lock, so that threads share the work. `compute` does one chunk; the threads here, and the processes of `maps`, only say
which one is next.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from grasp_ros.exact.integrator import ACCURACY, MAX_EVENTS, MAX_WORK, Integrator, Status
from grasp_ros.exact.sight import SEEN, Seen
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import EVENT_BODY, EVENT_KIND, LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.simulation import lyapunov
from grasp_ros.simulation.closed_loop import SampledLoop, drive_external
from grasp_ros.simulation.outcomes import LAST, LYAPUNOV, Outcome, Runs, find, wanted_by
from grasp_ros.simulation.variants import Variants

REFUSED = "REFUSED"
STATUSES = (Status.DONE.name, REFUSED, *(status.name for status in Status if status is not Status.DONE))
SETTLED = 0.02  # part of the largest initial displacement
CHUNK_S, ROW_S, TICK_S = 0.1, 4e-4, 1e-6  # seconds that a chunk is meant to take, and that its parts take about
Span = tuple[int, int]
TOUCHES = len((LEFT, RIGHT))
NO_GRID = np.zeros(0)


class Setup(NamedTuple):
    """What the rows of an ensemble depend on, beside the scene and its numbers.

    Attributes
    ----------
    outcomes : tuple of str
        Columns or groups, see `outcomes`.
    accuracy : float
        Of `exact`, see `exact.integrator.Integrator`.
    sampled : bool
        See `simulate`.
    settled : float
        Part of the largest initial displacement within which a run counts as settled.
    max_events, max_work : int
        Budgets of each row.
    """

    outcomes: tuple[str, ...] = ("settling_time", "touches")
    accuracy: float = ACCURACY
    sampled: bool = False
    settled: float = SETTLED
    max_events: int = MAX_EVENTS
    max_work: int = MAX_WORK


@dataclass(frozen=True)
class Chunk:
    """Outcomes of some rows.

    Attributes
    ----------
    columns : dict of str to array (n,)
    status : array (n,)
        Places in `STATUSES`.
    stops : dict of int to str
        Why and where a row was refused or stopped, by its place among these rows.
    """

    columns: dict[str, Array]
    status: np.ndarray
    stops: dict[int, str]


class _Row(NamedTuple):
    seen: Array
    state: Array
    touches: Array
    growth: float
    status: Status
    stop: str


def check(scene: Scene, setup: Setup) -> list[Outcome]:
    """The columns that are asked for.

    Raises
    ------
    Refused
        If an outcome is unknown or not to be had, or a setting is outside its range.
    """
    columns = find(setup.outcomes)
    Integrator(scene.system, continuous=True, accuracy=setup.accuracy)
    if not 0.0 < setup.settled < 1.0:
        raise Refused(f"settled: {setup.settled!r} is not allowed; allowed: a number > 0 and < 1")
    if any(column.name == LYAPUNOV for column in columns):
        lyapunov.check(scene, setup.sampled or scene.sampled)
    return columns


def compute(variants: Variants, setup: Setup) -> Chunk:
    """Run some rows, one after the other."""
    columns, n = find(setup.outcomes), variants.rows
    runs = Runs(np.full((n, SEEN), np.nan), np.full((n, 6), np.nan), np.full((n, TOUCHES), np.nan),
                np.full(n, np.nan))
    status = np.zeros(n, dtype=np.int8)
    stops = variants.faults()
    for i in stops:
        status[i] = STATUSES.index(REFUSED)
    for i in range(n):
        if i not in stops:
            row = _run(variants.row(i), setup, columns)
            for array, value in zip(runs, row, strict=False):
                array[i] = value
            if row.status is not Status.DONE:
                status[i], stops[i] = STATUSES.index(row.status.name), row.stop
    found = {column.name: np.array(column.read(runs)) for column in columns}
    for name, values in found.items():
        values[status != 0 if name not in LAST else status == STATUSES.index(REFUSED)] = np.nan
    return Chunk(found, status, stops)


def _run(scene: Scene, setup: Setup, columns: Sequence[Outcome]) -> _Row:
    """One row, driven as `simulate` drives it."""
    system, sampled = scene.system, setup.sampled or scene.sampled
    integrator = Integrator(
        system, continuous=not sampled, accuracy=setup.accuracy, max_events=setup.max_events, max_work=setup.max_work)
    watcher, wanted = None, wanted_by(columns)
    if wanted:
        watcher = integrator.watch(wanted, setup.settled)
    if sampled:
        SampledLoop(scene, NO_GRID, {}, None).drive(integrator)
    elif system.external:
        drive_external(scene, NO_GRID, integrator)
    else:
        integrator.advance(scene.duration)
    seen = np.full(SEEN, np.nan)
    if watcher is not None:
        watcher.finish()
        seen = watcher.seen.copy()
    state, growth = integrator.state, np.nan
    for body in system.absent:
        for place in (COLUMN[body], COLUMN[body] + 1):
            state[place] = seen[Seen.LOW + place] = seen[Seen.HIGH + place] = np.nan
    if integrator.status is Status.DONE and any(column.name == LYAPUNOV for column in columns):
        growth = lyapunov.exponent(system, scene.duration, setup.accuracy)
    touched = integrator.event_table[integrator.event_table[:, EVENT_KIND] == Transition.TOUCH, EVENT_BODY]
    touches = np.array([(touched == side).sum() for side in (LEFT, RIGHT)], dtype=float)
    return _Row(seen, state, touches, growth, integrator.status, integrator.stop)


@dataclass(frozen=True)
class Table:
    """An ensemble: its numbers and its outcomes, a row for each run.

    Attributes
    ----------
    scene : Scene
    setup : Setup
    changes : dict of str to array (n,)
        Numbers by "section.key".
    columns : dict of str to array (n,)
        Outcomes by the names of `outcomes.OUTCOMES`; nan in rows that were refused or stopped.
    status : array (n,)
        Places in `STATUSES`.
    stops : dict of int to str
        Why and where a row was refused or stopped.
    """

    scene: Scene
    setup: Setup
    changes: dict[str, Array]
    columns: dict[str, Array]
    status: np.ndarray
    stops: dict[int, str]

    @property
    def done(self) -> np.ndarray:
        """Rows (n,) that reached the end of the horizon."""
        return self.status == 0


def ensemble(
    scene: Scene,
    changes: Mapping[str, ArrayLike],
    outcomes: Sequence[str] = Setup().outcomes,
    *,
    setup: Setup | None = None,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> Table:
    """Run variants of a scene, and keep their outcomes.

    Parameters
    ----------
    scene : Scene
    changes : mapping of str to array (n,)
        Numbers of the scene by "section.key", one for each row; without any there is one row, the scene itself.
    outcomes : sequence of str
        Columns or groups of `outcomes`.
    setup : Setup, optional
        All that the rows depend on beside; its outcomes give way to those above.
    threads : int, optional
        Default: one for each core. The result does not depend on it.
    progress : callable, optional
        Called with the number of rows of each chunk that is done.

    Raises
    ------
    Refused
        If a key or an outcome is not known, or a setting is outside its range.
    """
    setup = (setup or Setup())._replace(outcomes=tuple(outcomes))
    columns, variants = check(scene, setup), Variants(scene, changes)
    table = Table(
        scene, setup, variants.changes, {column.name: np.full(variants.rows, np.nan) for column in columns},
        np.zeros(variants.rows, dtype=np.int8), {},
    )
    spans = chunks(variants.rows, chunk_rows(scene, setup))
    for (first, last), chunk in in_threads(lambda span: compute(variants.part(*span), setup), spans, threads):
        for name, values in chunk.columns.items():
            table.columns[name][first:last] = values
        table.status[first:last] = chunk.status
        table.stops.update({first + i: stop for i, stop in chunk.stops.items()})
        if progress is not None:
            progress(last - first)
    return table


def chunk_rows(scene: Scene, setup: Setup) -> int:
    """Rows of one chunk, for about `CHUNK_S` of work."""
    ticks = scene.ticks if setup.sampled or scene.sampled or scene.system.external else 1
    return max(1, int(CHUNK_S / (ROW_S + ticks * TICK_S)))


def chunks(rows: int, size: int) -> list[tuple[int, int]]:
    """First row of each chunk, and the one behind its last."""
    return [(first, min(first + size, rows)) for first in range(0, rows, size)]


def in_threads(work: Callable[[Span], Chunk], spans: Iterable[Span], threads: int | None = None
               ) -> Iterator[tuple[Span, Chunk]]:
    """Do chunks in threads, and hand each over when it is done; no more are begun than threads can soon take up."""
    workers = threads or os.cpu_count() or 1
    waiting: dict[Future[Chunk], Span] = {}
    following = iter(spans)
    with ThreadPoolExecutor(workers) as pool:
        try:
            while True:
                for span in islice(following, 2 * workers - len(waiting)):
                    waiting[pool.submit(work, span)] = span
                if not waiting:
                    return
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    yield waiting.pop(future), future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

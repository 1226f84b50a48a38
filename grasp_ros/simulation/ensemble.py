"""Ensembles: many variants of one scene, each row a run of its own, and of each run its outcomes alone.

A row gives the bits of `simulate` for the scene with its numbers: it is the same integrator, driven the same way, with
an observer in place of an output grid. Rows know nothing of each other, so that they do not depend on
threads, order or chunks. A row that a scene's rules refuse, or whose run stops, says so in a sentence.

Rows are computed in chunks, which are all that memory holds besides the table: the kernels release the interpreter's
lock, so that threads share the work. `chunk.compute` computes one; the threads here and the processes of `maps` only
choose the next one.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from itertools import islice
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.given import names, whole
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.files import opened
from grasp_ros.scene.targets import parameter_of
from grasp_ros.sensitivity.directions import check_keys
from grasp_ros.simulation.chunk import STATUSES, Chunk, Setup, Variants, check, compute, has_inputs
from grasp_ros.simulation.outcomes import BY, CORNER, OUTCOMES, V_C_END, derivatives_by
from grasp_ros.simulation.progress import showing
from grasp_ros.simulation.tables import frame_of, write_rows

CHUNK_S, ROW_S, TICK_S = 0.1, 2e-4, 1e-6  # seconds that a chunk is meant to take, and that its parts take about
Span = tuple[int, int]  # first row of a chunk, and the one behind its last
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Table(Frozen):
    """An ensemble: its parameters and its outcomes, a row for each run.

    Attributes
    ----------
    scene : Scene
    setup : Setup
    changes : dict of str to array (n,)
        Values of parameters by "section.key".
    columns : dict of str to array (n,)
        Outcomes by the names of `outcomes.OUTCOMES`, and derivatives; nan in rows that were refused or stopped.
    status : array (n,)
        Indices of `STATUSES`.
    stops : dict of int to str
        Why and where a row was refused or stopped, or why it has no derivatives.
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
        return np.asarray(self.status == 0)

    @property
    def status_names(self) -> np.ndarray:
        """How each row ended, (n,): "DONE", "REFUSED", or the name of a `Status`."""
        return np.asarray(np.array(STATUSES)[self.status])

    @property
    def units(self) -> dict[str, str]:
        """Units of the numbers and of the outcomes, by column."""
        found = {name: parameter_of(self.scene, name).unit for name in self.changes}
        for column in self.columns:  # an outcome, or its derivative by a number
            name, _, key = column.partition(BY)
            unit = {V_C_END: "J", CORNER: "s"}.get(name) or OUTCOMES[name].unit
            found[column] = f"{unit} per {parameter_of(self.scene, key).unit}" if key else unit
        return found

    def dataframe(self) -> Any:
        """A `pandas.DataFrame`, a row for each run: numbers, outcomes and `status`; units in its `attrs["units"]`.

        Raises
        ------
        Refused
            If pandas is not installed.
        """
        frame = frame_of({**self.changes, **self.columns, "status": self.status_names})
        frame.attrs = {"scene": self.scene.name, "scene_yaml": self.scene.to_yaml(), "units": self.units}
        return frame

    def to_csv(self, path: str | os.PathLike[str] | BinaryIO) -> None:
        """The same as a text file, given by its path or open; column names have their unit in brackets.

        Raises
        ------
        Refused
            If the file cannot be written.
        """
        units = self.units
        heads = [*(f"{name} [{unit}]" for name, unit in units.items()), "status"]
        with opened(path) as file:
            write_rows(file, heads, [*self.changes.values(), *self.columns.values(), self.status_names])


def ensemble(
    scene: Scene,
    changes: Mapping[str, ArrayLike],
    outcomes: Sequence[str] = Setup().outcomes,
    *,
    setup: Setup | None = None,
    sensitivity: Sequence[str] | None = None,
    threads: int | None = None,
    progress: Callable[[int], object] | bool | None = None,
) -> Table:
    """Run variants of a scene, and keep their outcomes.

    Parameters
    ----------
    scene : Scene
    changes : mapping of str to array (n,)
        Values of parameters by "section.key", one for each row; if empty there is one row, the scene itself.
    outcomes : sequence of str
        Columns or groups of `outcomes`.
    setup : Setup, optional
        Settings of the runs; the outcomes above replace its own.
    sensitivity : sequence of str, optional
        Keys with respect to which the last states and V_c are differentiated through all impacts: columns such as
        "x_left_end by KEY". `V_c_end` is the last V_c, and `corner` the time in s from which on one-sided derivatives
        differ, see `differentiate.Sensitivity`; inf: they do not.
    threads : int, optional
        Default: one for each core. The result does not depend on it.
    progress : callable or True, optional
        True: a bar, in a terminal or in a notebook. A callable gets the number of rows that are done.

    Raises
    ------
    Refused
        If a key or an outcome is not known, a parameter has no derivative, or a setting is outside its range.
    """
    (setup, columns), variants = check(scene, setup, outcomes), Variants(scene, changes)
    keys = None if sensitivity is None else names("sensitivity", sensitivity)
    if keys is not None:
        check_keys(scene, keys, setup.sampled)
    wanted = [*(column.name for column in columns), *(derivatives_by(keys) if keys else ())]
    found: dict[str, Array] = {name: np.full(variants.rows, np.nan) for name in wanted}
    status, stops = np.zeros(variants.rows, dtype=np.int8), dict[int, str]()
    size = 1 if keys else chunk_rows(scene, setup)  # derivatives take longer than a run
    spans = [(first, min(first + size, variants.rows)) for first in range(0, variants.rows, size)]

    def work(span: Span, stop: NDArray[np.int64]) -> Chunk:
        part = variants.part(*span)
        chunk = compute(part, setup, stop)
        if keys is None:
            return chunk
        from grasp_ros.simulation.differentiate import with_derivatives  # whose kernels no other run loads

        return with_derivatives(chunk, part, setup, keys, stop)

    reached = 0
    with showing(progress, variants.rows, "run", scene.name) as report:
        for (first, last), chunk in in_threads(work, spans, threads):
            for name, values in chunk.columns.items():
                found[name][first:last] = values
            status[first:last] = chunk.status
            stops.update({first + i: stop for i, stop in chunk.stops.items()})
            reached += last - first
            if report is not None:
                report(reached)
    return Table(scene, setup, variants.changes, found, status, stops)


def chunk_rows(scene: Scene, setup: Setup, seconds: float = 0.0) -> int:
    """Rows of one chunk, for about `CHUNK_S` of work; some have taken so many seconds, if that is known."""
    ticks = scene.ticks if has_inputs(scene, setup) else 1
    return max(1, int(CHUNK_S / max(ROW_S + ticks * TICK_S, seconds)))


def in_threads(work: Callable[[Span, NDArray[np.int64]], T], spans: Iterable[Span], threads: int | None = None
               ) -> Generator[tuple[Span, T], None, None]:
    """Compute chunks in threads, and yield each when it is done; twice as many as threads are queued at most.

    The work also gets an array (1,) to poll: not 0 asks it to stop, for example after a Ctrl-C.
    """
    workers = whole("threads", threads, 1) if threads is not None else os.cpu_count() or 1
    stop = np.zeros(1, dtype=np.int64)
    with ThreadPoolExecutor(workers) as pool:
        try:
            for span, future in each_done(lambda span: pool.submit(work, span, stop), spans, 2 * workers):
                yield span, future.result()
        finally:
            stop[0] = 1
            pool.shutdown(wait=False, cancel_futures=True)


def each_done(submit: Callable[[Span], Future[T]], spans: Iterable[Span], most: int
              ) -> Generator[tuple[Span, Future[T]], None, None]:
    """Submit chunks, at most so many at a time, and yield each when it is done."""
    waiting: dict[Future[T], Span] = {}
    following = iter(spans)
    while True:
        waiting.update((submit(span), span) for span in islice(following, most - len(waiting)))
        if not waiting:
            return
        for future in wait(waiting, return_when=FIRST_COMPLETED).done:
            yield waiting.pop(future), future

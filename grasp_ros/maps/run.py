"""A map from its plan to its file."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grasp_ros.maps import cluster
from grasp_ros.maps.plan import Plan
from grasp_ros.maps.plan import check as check_plan
from grasp_ros.maps.store import Store
from grasp_ros.simulation.chunk import Chunk, check, compute
from grasp_ros.simulation.ensemble import Span, chunk_rows, in_threads


def run(
    plan: Plan, path: str | os.PathLike[str], *, workers: int = 0, scheduler: str = "",
    progress: Callable[[int], object] | None = None,
) -> Store:
    """Compute what a file does not have yet.

    Parameters
    ----------
    plan : Plan
    path : Path
        A new directory, or the map of the same plan, which is completed.
    workers : int
        Processes of a Dask cluster that is started for it; 0: threads of this process.
    scheduler : str
        Address of a Dask scheduler that exists.
    progress : callable, optional
        Called with the number of rows that are done.

    Raises
    ------
    Refused
        If the plan cannot be run, the file is something else or cannot be written, or workers die again and again.
        What is done is kept.
    """
    check(plan.scene, plan.setup)
    check_plan(plan)
    store = Store(Path(path), plan, chunk_rows(plan.scene, plan.setup))
    spans, begin = store.spans, time.monotonic()
    done, told = plan.rows - sum(last - first for first, last in spans), progress or (lambda _: None)
    told(done)
    if not spans:
        return store
    try:
        with _source(plan, spans, workers, scheduler) as found:
            for span, chunk in found:
                store.write(span, chunk)
                done += span[1] - span[0]
                told(done)
    finally:
        store.add_seconds(time.monotonic() - begin)
    return store


@contextmanager
def _source(plan: Plan, spans: Sequence[Span], workers: int, scheduler: str) -> Iterator[Iterator[tuple[Span, Chunk]]]:
    """Chunks as they are done, here or on a cluster."""
    def work(span: Span, stop: NDArray[np.int64]) -> Chunk:
        return compute(plan.variants(*span), plan.setup, stop)

    if workers or scheduler:
        with cluster.connect(workers, scheduler) as client:
            yield cluster.on_cluster(client, plan, spans)
    else:
        with closing(in_threads(work, spans)) as found:
            yield found

"""A map from its plan to its file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grasp_ros.maps import cluster
from grasp_ros.maps.plan import Plan
from grasp_ros.maps.plan import check as check_plan
from grasp_ros.maps.store import Store
from grasp_ros.simulation.chunk import Chunk, check, compute
from grasp_ros.simulation.ensemble import Span, chunk_rows, in_threads

Progress = Callable[[int, int], object]


def run(plan: Plan, path: Path, *, workers: int = 0, scheduler: str = "", progress: Progress = lambda _, __: None
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
    progress : callable
        Called with the number of rows that are done and that of all.

    Raises
    ------
    Refused
        If the plan cannot be run, the file is something else or cannot be written, or workers die again and again.
        What is done is kept.
    """
    check(plan.scene, plan.setup)
    check_plan(plan)
    store = Store(path, plan, chunk_rows(plan.scene, plan.setup))
    spans = store.spans
    done = plan.rows - sum(last - first for first, last in spans)
    progress(done, plan.rows)
    if not spans:
        return store
    if workers or scheduler:
        with cluster.connect(workers, scheduler) as client:
            for span, chunk in cluster.on_cluster(client, plan, spans):
                store.write(span, chunk)
                done += span[1] - span[0]
                progress(done, plan.rows)
        return store

    def work(span: Span, stop: NDArray[np.int64]) -> Chunk:
        return compute(plan.variants(*span), plan.setup, stop)

    for span, chunk in in_threads(work, spans):
        store.write(span, chunk)
        done += span[1] - span[0]
        progress(done, plan.rows)
    return store

"""A map from its plan to its file."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from grasp_ros.maps import cluster
from grasp_ros.maps.plan import Plan, check
from grasp_ros.maps.store import Store
from grasp_ros.simulation.chunk import Chunk, compute
from grasp_ros.simulation.ensemble import Span, chunk_rows, in_threads


def run(
    plan: Plan, path: str | os.PathLike[str], *, workers: int = 0, scheduler: str = "",
    progress: Callable[[int], object] | None = None,
) -> None:
    """Compute what a file does not have yet: a new directory, or the map of the same plan.

    `workers` are processes of a Dask cluster that is started for it, 0: threads of this process; `scheduler` is the
    address of one that exists. `progress` is told the number of rows that are done. Refused: a plan that cannot be run,
    a file that is something else or cannot be written, workers that die again and again; what is done is kept.
    """
    def work(span: Span, stop: NDArray[np.int64]) -> Chunk:
        return compute(plan.variants(*span), plan.setup, stop)

    check(plan)
    path, told = Path(path), progress or (lambda _: None)
    rows = 1 if path.exists() else chunk_rows(plan.scene, plan.setup, _seconds(plan))
    if path.exists() and not Store(path, plan, rows).spans:  # it is done, and needs no cluster
        told(plan.rows)
        return
    # First, so that a scheduler that does not answer leaves no file behind.
    with cluster.connect(workers, scheduler) if workers or scheduler else nullcontext() as client:
        store = Store(path, plan, rows)
        spans = store.spans
        done = plan.rows - sum(last - first for first, last in spans)
        told(done)
        with closing(in_threads(work, spans) if client is None else cluster.on_cluster(client, plan, spans)) as found:
            for span, chunk in found:
                store.write(span, chunk)
                done += span[1] - span[0]
                told(done)


def _seconds(plan: Plan) -> float:
    """Longest wall time of three rows: how far one goes on until it has settled, nobody knows before."""
    def spent(row: int) -> float:
        begin = time.monotonic()
        compute(plan.variants(row, row + 1), plan.setup)
        return time.monotonic() - begin

    spent(0)  # it compiles or loads what it takes
    return max(min(spent(row), spent(row)) for row in (0, plan.rows // 2, plan.rows - 1))  # the machine may be busy

"""A map from its plan to its file: rows in threads, or in other processes by Dask.

A cluster is one of this machine, or one that exists. The client hands out chunks and writes what comes back; a chunk
whose worker dies is computed again by another one, and is written once, because it is written here.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import time
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import CancelledError
from contextlib import closing, nullcontext
from functools import cache, partial
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grasp_ros.maps.plan import Plan
from grasp_ros.maps.store import Store
from grasp_ros.physics.errors import Refused, need
from grasp_ros.scene.versions import versions
from grasp_ros.simulation.chunk import NEVER, Chunk, compute
from grasp_ros.simulation.ensemble import Span, chunk_rows, each_done, in_threads

AHEAD = 3  # chunks for each worker that are handed out
TIMEOUT_S = 10


def run(
    plan: Plan, path: str | os.PathLike[str], *, workers: int = 0, scheduler: str = "",
    progress: Callable[[int], object] | None = None,
) -> None:
    """Compute what a file does not have yet: a new directory, or the map of the same plan.

    `workers` are processes of a Dask cluster that is started for it, 0: threads of this process; `scheduler` is the
    address of one that exists. `progress` gets the number of rows that are done. Refused: a file that is something else
    or cannot be written, workers that die again and again; what is done is kept.
    """
    path, report = Path(path), progress or (lambda _: None)
    store = Store(path, plan) if os.path.exists(path) else None
    rows = 1 if store else chunk_rows(plan.scene, plan.setup, _seconds(plan))
    on_others = (workers or scheduler) and (store is None or store.spans)  # a map that is done needs no cluster
    # First, so that a scheduler that does not answer leaves no file behind.
    with connect(workers, scheduler) if on_others else nullcontext() as client:
        store = store or Store(path, plan, rows)
        spans = store.spans
        done = plan.rows - sum(last - first for first, last in spans)
        report(done)
        with closing(in_threads(partial(_compute, plan), spans) if client is None
                     else on_cluster(client, plan, spans)) as chunks:
            for span, chunk in chunks:
                store.write(span, chunk)
                done += span[1] - span[0]
                report(done)


def _compute(plan: Plan, span: Span, stop: NDArray[np.int64] = NEVER) -> Chunk:
    return compute(plan.variants(*span), plan.setup, stop)


def _seconds(plan: Plan) -> float:
    """Longest wall time of three rows: how long one takes until it has settled is only known afterwards."""
    def spent(row: int) -> float:
        begin = time.monotonic()
        _compute(plan, (row, row + 1))
        return time.monotonic() - begin

    spent(0)  # the first run compiles kernels, or loads them
    return max(min(spent(row), spent(row)) for row in (0, plan.rows // 2, plan.rows - 1))  # the machine may be busy


@cache
def _known(document: str) -> tuple[dict[str, str], Plan]:
    return versions(), Plan.from_document(json.loads(document))


def work(document: str, span: Span) -> tuple[dict[str, str], Chunk]:
    """One chunk, and the versions that it was computed with; what a worker does."""
    found, plan = _known(document)
    return found, _compute(plan, span)


def connect(workers: int, scheduler: str) -> Any:
    """A client of a new cluster of so many processes on this machine, or of the scheduler at an address."""
    need("a cluster", "distributed")
    from distributed import Client

    if not scheduler:
        ensure_running()  # by itself it would start later, and let a Ctrl-C through to the workers
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # a Ctrl-C is for us: workers end with us
        try:
            return Client(
                n_workers=workers, threads_per_worker=1, silence_logs=logging.CRITICAL,  # workers that end are no error
                dashboard_address="127.0.0.1:0", scheduler_kwargs={"dashboard": False})  # 0: a free port, of HTTP alone
        except (OSError, RuntimeError) as error:
            raise Refused(f"workers {workers}: do not start: {error}; allowed: fewer, and in a script the call below"
                          ' `if __name__ == "__main__":`') from None
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    try:
        return Client(scheduler, timeout=TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise Refused(f"scheduler {scheduler}: nobody answers: {error or type(error).__name__}") from None


def on_cluster(client: Any, plan: Plan, spans: Iterable[Span]) -> Generator[tuple[Span, Chunk], None, None]:
    """Do chunks on a cluster, and hand each over when it is done."""
    from distributed import KilledWorker

    document, own, cluster = json.dumps(plan.to_document()), versions(), client.get_executor(pure=False)
    most = AHEAD * max(sum(client.nthreads().values()), 1)
    for span, future in each_done(lambda span: cluster.submit(work, document, span), spans, most):
        try:
            found, chunk = future.result()
        except (KilledWorker, CancelledError) as error:
            reason = " ".join(str(error).split())
            raise Refused(f"rows {span[0]} to {span[1] - 1}: their workers died: {reason}") from None
        if found != own:
            other = ", ".join(f"{name} {version}" for name, version in found.items() if own.get(name) != version)
            raise Refused(f"a worker has {other}; allowed: the versions of this process, because the bits may differ")
        yield span, chunk

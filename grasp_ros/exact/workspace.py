"""What the kernels write to before they read: a run borrows it, so that runs at the same time have their own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from grasp_ros.exact.records import Array, Tables
from grasp_ros.exact.series import new_tables, series_order

EVENT_ROWS = 1024
_FREE: dict[float, list[tuple[Tables, Array]]] = {}  # by accuracy; what nobody uses


@contextmanager
def workspace(accuracy: float) -> Iterator[tuple[Tables, Array]]:
    """Tables, and rows for events; no run leaves anything there.

    A second run at the same time may be in another thread, or in a controller of the first one.
    """
    free = _FREE.setdefault(accuracy, [])
    try:
        borrowed = free.pop()
    except IndexError:
        borrowed = new_tables(series_order(accuracy)), np.empty((EVENT_ROWS, 5))
    try:
        yield borrowed
    finally:
        free.append(borrowed)

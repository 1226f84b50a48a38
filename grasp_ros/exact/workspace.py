"""What the kernels write to before they read: a run borrows it, so that runs at the same time have their own.

A second run at the same time may be in another thread, or in a controller of the first one.
"""

from __future__ import annotations

import numpy as np

from grasp_ros.exact.records import Array, Tables
from grasp_ros.exact.series import new_tables, series_order

EVENT_ROWS = 1024
Workspace = tuple[Tables, Array]
_FREE: dict[float, list[Workspace]] = {}  # by accuracy; what nobody uses


def borrow(accuracy: float) -> Workspace:
    """Tables, and rows for events, until `give_back`; no run leaves anything there."""
    try:
        return _FREE[accuracy].pop()
    except (KeyError, IndexError):
        return new_tables(series_order(accuracy)), np.empty((EVENT_ROWS, 5))


def give_back(accuracy: float, workspace: Workspace) -> None:
    """Let the next run have it."""
    _FREE.setdefault(accuracy, []).append(workspace)

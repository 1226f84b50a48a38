"""What the kernels write to before they read: a run borrows it, so that runs at the same time have their own."""

from __future__ import annotations

import numpy as np

from grasp_ros.exact.orders import series_order
from grasp_ros.exact.records import Array, Tables
from grasp_ros.exact.series import new_tables

EVENT_ROWS = 1024
_FREE: dict[float, list[tuple[Tables, Array]]] = {}  # by accuracy; what nobody uses


class workspace:  # noqa: N801 - a context manager; as a generator it costs a sampled tick more
    """Tables, and rows for events; no run leaves anything there.

    A second run at the same time may be in another thread, or in a controller of the first one.
    """

    def __init__(self, accuracy: float) -> None:
        self._accuracy, self._free = accuracy, _FREE.setdefault(accuracy, [])

    def __enter__(self) -> tuple[Tables, Array]:
        """Borrow one."""
        try:
            self._borrowed = self._free.pop()
        except IndexError:
            self._borrowed = new_tables(series_order(self._accuracy)), np.empty((EVENT_ROWS, 5))
        return self._borrowed

    def __exit__(self, *_: object) -> None:
        """Give it back."""
        self._free.append(self._borrowed)

"""What the kernels write to before they read: a run borrows it, so that runs at the same time have their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.exact.contact.step_order import higher_order, series_order
from grasp_ros.exact.flight.closed_form import FLIGHT_ORDER
from grasp_ros.exact.records import Array, Tables, numbers_of_tables, tables_of

EVENT_ROWS = 1024
CACHE_LINE = 8  # numbers


class Workspace(NamedTuple):
    """Memory of one run; no run leaves anything there."""

    block: Array  # of `tables`
    order: int
    tables: Tables
    events: Array  # (EVENT_ROWS, 5)


_FREE: dict[float, list[Workspace]] = {}  # by accuracy; what nobody uses


def new_workspace(order: int) -> Workspace:
    """Memory for steps of this order and of `higher_order`; it begins at a cache line, which vector loads want."""
    highest = max(higher_order(order), int(FLIGHT_ORDER))
    room = np.zeros(numbers_of_tables(highest) + CACHE_LINE)
    first = -(room.ctypes.data // 8) % CACHE_LINE
    block = room[first : first + numbers_of_tables(highest)]
    return Workspace(block, highest, tables_of(block, highest), np.empty((EVENT_ROWS, 5)))


class workspace:  # noqa: N801 - a context manager; as a generator it costs a sampled tick more
    """Borrowed memory.

    A second run at the same time may be in another thread, or in a controller of the first one.
    """

    def __init__(self, accuracy: float) -> None:
        self._accuracy, self._free = accuracy, _FREE.setdefault(accuracy, [])

    def __enter__(self) -> Workspace:
        """Borrow it."""
        try:
            self._borrowed = self._free.pop()
        except IndexError:
            self._borrowed = new_workspace(series_order(self._accuracy))
        return self._borrowed

    def __exit__(self, *_: object) -> None:
        """Give it back."""
        self._free.append(self._borrowed)

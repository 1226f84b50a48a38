"""Memory of the kernels. Scratch: each run borrows its own, so that runs can be concurrent. Blocks: as records."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.compilation.jit import inlined
from grasp_ros.exact.contact.step_unit import higher_order, series_order
from grasp_ros.exact.flight.closed_form import FLIGHT_ORDER
from grasp_ros.exact.records import Array, Tables, numbers_of_tables, plant_of, state_of, tables_of

EVENT_ROWS = 1024
CACHE_LINE = 8  # numbers
plant_in, state_in, tables_in = inlined(plant_of), inlined(state_of), inlined(tables_of)


def zeros(*shape: int) -> Array:
    """Zeros that begin on a line of the processor's cache: vectors that lie on two lines take twice as long."""
    count = math.prod(shape)
    room = np.zeros(count + CACHE_LINE)
    first = -(room.ctypes.data // room.itemsize) % CACHE_LINE
    return room[first : first + count].reshape(shape)


class Workspace(NamedTuple):
    """Memory of one run; no run leaves anything there."""

    block: Array  # of `tables`
    order: int
    tables: Tables
    events: Array  # (EVENT_ROWS, 5)


_FREE: dict[float, list[Workspace]] = {}  # unused ones by accuracy


def new_workspace(order: int) -> Workspace:
    """Memory for steps of this order and of `higher_order`."""
    highest = max(higher_order(order), int(FLIGHT_ORDER))
    block = zeros(numbers_of_tables(highest))
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

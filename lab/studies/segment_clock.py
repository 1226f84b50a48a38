"""What every flight and every Taylor step of a run takes: an observer that reads the clock after each segment."""

from __future__ import annotations

import ctypes
import time
from typing import NamedTuple

import numpy as np
from numba import cfunc, typeof

from grasp_ros.exact.driver.callback import SIGNATURE, Observer, block_of, reader
from grasp_ros.exact.records import Integers, Tables
from grasp_ros.physics.model import Array
from grasp_ros.scene.effects.base import NANOSECONDS

COUNT, FIRST = 2, 3  # indices, behind the seconds and nanoseconds of the clock; from the last on kind and time in turn
MONOTONIC = time.CLOCK_MONOTONIC
clock_gettime = ctypes.CDLL(None).clock_gettime
clock_gettime.argtypes = ctypes.c_int, ctypes.c_size_t


class Clock(NamedTuple):
    """What it is called with."""

    numbers: Integers  # (FIRST + 2 n,)


clock_at = reader(typeof(Clock(np.zeros(0, dtype=np.int64))))


@cfunc(SIGNATURE)  # type: ignore[untyped-decorator]
def read_clock(context: int, kind: int, t: float, s: float, unit: float, degree: int) -> int:
    """Note the kind of a segment, and when it was over."""
    numbers = clock_at(context).numbers
    clock_gettime(MONOTONIC, numbers.ctypes.data)
    row = FIRST + 2 * numbers[COUNT]
    numbers[row], numbers[row + 1] = kind, numbers[0] * NANOSECONDS + numbers[1]
    numbers[COUNT] += 1
    return 0


class SegmentClock(Observer):
    """Times the segments of one run; `most` is how many it has at most."""

    def __init__(self, most: int) -> None:
        self._places: Integers = np.zeros(FIRST + 2 * most, dtype=np.int64)
        self._block = block_of(Clock(self._places))

    def attach(self, tables: Tables) -> Integers:
        """What a run calls after each segment."""
        return np.array([read_clock.address, self._block.ctypes.data])

    @property
    def segments(self) -> tuple[Integers, Array]:
        """Kind, and length in s of wall time, of every segment but the first, whose begin is not known."""
        noted = self._places[FIRST : FIRST + 2 * self._places[COUNT]].reshape(-1, 2)
        return noted[1:, 0], np.diff(noted[:, 1]) / NANOSECONDS

"""Messages that are serialized once: later ones differ from it in their time and their numbers alone."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from grasp_ros.scene.effects.base import NANOSECONDS

_STAMP, _NUMBER = struct.Struct("<iI"), struct.Struct("<d")
_STAMP_AT = 4  # behind the header of CDR, in a stamped message and in /clock
_MARK = 1.2345678901234567e-200  # of which nothing else in a message has a multiple


class Template:
    """A serialized message whose time and numbers are replaced, which costs a tenth of making it anew.

    Parameters
    ----------
    serialize : callable
        From a list of numbers to a serialized message that begins with a stamp.
    count : int
        How many numbers.
    """

    def __init__(self, serialize: Callable[[list[float]], bytes], count: int) -> None:
        marks = [_MARK * (number + 1) for number in range(count)]
        cdr = bytes(serialize(marks))
        self._cdr = bytearray(cdr)
        self._numbers, size = struct.Struct(f"<{count}d"), _NUMBER.size
        self._runs: list[tuple[slice, slice]] = []  # where numbers lie side by side, in the message and among all
        places, first = [cdr.index(_NUMBER.pack(mark)) for mark in marks], 0
        for last, place in enumerate(places, 1):
            if last == count or places[last] != place + size:
                self._runs.append((slice(places[first], place + size), slice(size * first, size * last)))
                first = last

    def fill(self, time_ns: int, numbers: Sequence[float]) -> bytes:
        """The serialized message of a time and some numbers."""
        _STAMP.pack_into(self._cdr, _STAMP_AT, *divmod(time_ns, NANOSECONDS))
        packed = self._numbers.pack(*numbers)
        for place, which in self._runs:
            self._cdr[place] = packed[which]
        return bytes(self._cdr)

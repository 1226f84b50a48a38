"""States of the plant, read from their serialized messages."""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Sequence
from itertools import chain
from typing import NamedTuple

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros.graph.ros import messages

_HEAD, _STAMP_END = 4, 12  # bytes: of CDR, and with the stamp behind it


class State(NamedTuple):
    """A state of the plant, with the names of the fields of its message."""

    time_ns: int
    name: Sequence[str]
    position: Sequence[float]  # m
    velocity: Sequence[float]  # m/s
    effort: Sequence[float]  # N


class StateReader:
    """Reads serialized states; one that differs from the last in its time and its numbers alone costs a tenth.

    Parameters
    ----------
    names : collection of str
        Bodies that every state has.
    """

    def __init__(self, names: Collection[str]) -> None:
        self._needed = names
        self._name: tuple[str, ...] = ()
        self._head = self._fixed = b""  # of the last message, before its stamp and from there to its numbers
        self._begin, self._length = 0, -1  # of the numbers, and of the message; -1: there is no pattern
        self._numbers = struct.Struct("")

    def read(self, cdr: bytes) -> State | None:
        """A state; None if a message is none: lists that differ in length, names that are missing or there twice, NaN.

        Raises
        ------
        RuntimeError, ValueError or struct.error, which is `messages.UNREADABLE`
            If it cannot be decoded.
        """
        if len(cdr) == self._length and cdr[_STAMP_END : self._begin] == self._fixed and cdr[:_HEAD] == self._head:
            n, numbers = len(self._name), self._numbers.unpack_from(cdr, self._begin)
            if numbers[n] == numbers[2 * n + 1] == n:
                lists = numbers[:n], numbers[n + 1 : 2 * n + 1], numbers[2 * n + 2 :]
                return State(messages.raw_stamp_ns(cdr), self._name, *lists) if _finite(*lists) else None
        message = deserialize_message(cdr, JointState)
        lists = tuple(message.position), tuple(message.velocity), tuple(message.effort)
        number = len(message.name)
        if not (
            all(len(values) == number for values in lists) and len(set(message.name)) == number
            and all(name in message.name for name in self._needed) and _finite(*lists)
        ):
            return None
        self._learn(cdr, tuple(message.name), lists)
        return State(messages.to_ns(message.header.stamp), self._name, *lists)

    def _learn(self, cdr: bytes, name: tuple[str, ...], lists: tuple[tuple[float, ...], ...]) -> None:
        """Take a message as a pattern, if its numbers lie where those of CDR in little-endian order do."""
        n = len(name)
        numbers = struct.Struct(f"<{n}dI4x{n}dI4x{n}d")
        begin = len(cdr) - numbers.size
        self._name, self._length = name, -1
        if begin > _STAMP_END and numbers.unpack_from(cdr, begin) == (*lists[0], n, *lists[1], n, *lists[2]):
            self._numbers, self._begin, self._length = numbers, begin, len(cdr)
            self._head, self._fixed = cdr[:_HEAD], cdr[_STAMP_END:begin]


def _finite(*lists: Sequence[float]) -> bool:
    """Whether all are; a finite sum says so at once, one that overflows says nothing."""
    return math.isfinite(sum(map(sum, lists))) or all(map(math.isfinite, chain(*lists)))

"""The layout of the messages with numbers, as CDR serializes them: written and read here without a library of ROS.

rclpy pads them with stray bytes, so that equal runs would not give equal bags; loading the types of `rosbags`, which
reads every other message, takes as long as rclpy.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from typing import Any

from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import CLOCK, FORCE, FRAME, LYAPUNOV, LYAPUNOV_NAMES, Topic

SHORTEST, MOST_BYTES = 16, 4096  # of a message that comes with every state
_HEAD = b"\0\1\0\0"  # CDR, little endian; what follows is aligned from its end on
_STAMP, _LENGTH, _NUMBER = struct.Struct("<iI"), struct.Struct("<I"), struct.Struct("<d")
Part = tuple[str, tuple[Any, ...]]  # of a message: its format and its values
_MARK = 1.2345678901234567e-200  # of which nothing else in a message has a multiple


def list_message(
    time_ns: int, names: Sequence[str], position: Sequence[float], velocity: Sequence[float] = (),
    effort: Sequence[float] = (), frame: str = "",
) -> bytes:
    """A JointState, serialized: a stamped list of numbers with names."""
    words = [("I", (len(names),)), *map(_text, names)]
    lists = [(f"I{len(numbers)}d" if len(numbers) else "I", (len(numbers), *numbers))
             for numbers in (position, velocity, effort)]
    return _packed(time_ns, frame, *words, *lists)


def force_message(time_ns: int, force: float) -> bytes:
    """A WrenchStamped, serialized: a stamped force along the line in N."""
    return _packed(time_ns, FRAME, ("6d", (force, 0.0, 0.0, 0.0, 0.0, 0.0)))


def _packed(time_ns: int, frame: str, *parts: Part) -> bytes:
    """A stamped message of parts; `struct` aligns them as C does, and so does CDR, from the end of its head on."""
    parts = (("iI", divmod(time_ns, NANOSECONDS)), _text(frame), *parts)
    return _HEAD + struct.pack("@" + "".join(form for form, _ in parts), *(each for _, own in parts for each in own))


def _text(word: str) -> Part:
    text = word.encode() + b"\0"
    return f"I{len(text)}s", (len(text), text)


class Template:
    """A message that is serialized once; with another time and other numbers it costs a tenth of making it anew.

    `serialize` makes it of a list of `count` numbers; it begins with a stamp. What it writes it also reads.
    """

    def __init__(self, serialize: Callable[[list[float]], bytes], count: int) -> None:
        self.count, size = count, _NUMBER.size
        marks = [_MARK * (number + 1) for number in range(count)]
        cdr = serialize(marks)
        begins = [cdr.index(_NUMBER.pack(mark)) for mark in marks]
        ends = [len(_HEAD) + _STAMP.size, *(begin + size for begin in begins)]
        gaps = [begin - end for end, begin in zip(ends, [*begins, len(cdr)], strict=True)]  # before, between and behind
        self._form = struct.Struct(f"<{len(_HEAD)}siI" + "d".join(f"{gap}s" for gap in gaps))
        self._parts = list(self._form.unpack(cdr))  # head, seconds, nanoseconds; then gaps and numbers in turn
        self._gaps = tuple(self._parts[3::2])

    def fill(self, time_ns: int, numbers: Sequence[float]) -> bytes:
        """The serialized message of a time and some numbers."""
        self._parts[1:3] = divmod(time_ns, NANOSECONDS)
        self._parts[4::2] = numbers
        return self._form.pack(*self._parts)

    def read(self, cdr: bytes) -> tuple[Any, ...] | None:
        """Seconds, nanoseconds and numbers of a message that differs in nothing else; None of any other."""
        if len(cdr) != self._form.size:
            return None
        parts = self._form.unpack(cdr)
        return parts[1:3] + parts[4::2] if parts[0] == self._parts[0] and parts[3::2] == self._gaps else None


def template_of(topic: Topic, names: Sequence[str] = ()) -> Template:
    """That of a topic; states of bodies with these names have all positions, all velocities, all input forces."""
    if topic == CLOCK:
        return Template(lambda _: _HEAD + _STAMP.pack(0, 0), 0)
    if topic.type == FORCE:
        return Template(lambda numbers: force_message(0, *numbers), 1)
    if topic == LYAPUNOV:
        return Template(lambda numbers: list_message(0, LYAPUNOV_NAMES, numbers), len(LYAPUNOV_NAMES))
    n = len(names)
    return Template(lambda all: list_message(0, names, all[:n], all[n : 2 * n], all[2 * n :]), 3 * n)


def raw_stamp_ns(cdr: bytes) -> int:
    """Integer time in ns of a serialized stamped message."""
    sec, nanosec = _STAMP.unpack_from(cdr, len(_HEAD))
    return int(sec * NANOSECONDS + nanosec)


def has_raw_stamp(cdr: bytes) -> bool:
    """Whether `raw_stamp_ns` can read a message, which another program may have written."""
    return len(cdr) >= len(_HEAD) + _STAMP.size and cdr.startswith(_HEAD)


def raw_force(cdr: bytes) -> float:
    """Force along the line in N of a serialized WrenchStamped."""
    (length,) = _LENGTH.unpack_from(cdr, len(_HEAD) + _STAMP.size)  # of the frame
    return float(struct.unpack_from(f"@iII{length}sd", cdr, len(_HEAD))[-1])


def raw_command(cdr: bytes) -> tuple[int, float] | None:
    """Time in ns and force in N of a serialized WrenchStamped; None if a plant cannot take it, or a bag not hold it."""
    if not SHORTEST <= len(cdr) <= MOST_BYTES:
        return None
    try:
        force = raw_force(cdr)
    except struct.error:
        return None
    return (raw_stamp_ns(cdr), force) if math.isfinite(force) else None

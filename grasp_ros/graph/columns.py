"""Serialized messages of a topic, decoded many at a time.

What a recorder writes of a topic differs in its numbers alone. So rosbags decodes one message of them; where its
numbers lie is then where those of all others lie that are as long and have the same texts and lengths of lists in the
same places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype

from grasp_ros.graph.rosbag2 import decode, fields_of
from grasp_ros.scene.topics import Topic

HEAD = 4  # bytes before the content, from where places are counted: two that say how it is written, two that do not
LENGTH = np.dtype(np.uint32)  # of a text or a list, before its content


class Alike(NamedTuple):
    """Messages that differ in their numbers alone."""

    places: np.ndarray  # (n,) of these among all
    first: Any  # decoded
    numbers: np.ndarray  # (n,) of records: numbers by their dotted names, lists as (n, k)


def alike(topic: Topic, cdrs: Sequence[bytes]) -> Iterator[Alike]:
    """All messages of a topic, those together that differ in their numbers alone."""
    sizes, rest = np.array([len(cdr) for cdr in cdrs]), np.arange(len(cdrs))
    while len(rest):
        cdr = cdrs[rest[0]]
        first, layout = decode(topic, cdr), _Layout(topic.type, cdr)
        places = rest[sizes[rest] == len(cdr)]
        content = b"".join([cdrs[place] for place in places.tolist()])
        octets = np.frombuffer(content, dtype=np.uint8).reshape(-1, len(cdr))
        same = (octets[:, layout.fixed] == octets[0, layout.fixed]).all(axis=1)
        yield Alike(places[same], first, np.frombuffer(content, dtype=layout.dtype)[same])
        rest = np.setdiff1d(rest, places[same], assume_unique=True)


class _Layout:
    """Where the parts of a message lie that rosbags has decoded."""

    def __init__(self, kind: str, cdr: bytes) -> None:
        self._order: Literal["<", ">"] = "<" if cdr[1] else ">"
        self._cdr, self._next = cdr, 0
        self._numbers: list[tuple[str, Any, int]] = []
        # Bytes that say where the others lie and which texts there are; not numbers, and not what only fills up.
        self.fixed = np.zeros(len(cdr), dtype=bool)
        self.fixed[:2] = True
        self._message(kind, "")
        names, formats, offsets = zip(*self._numbers, strict=True)
        # Of the whole message: its numbers by their dotted names.
        self.dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(cdr)})

    def _message(self, kind: str, name: str) -> None:
        for part, (node, description) in fields_of(kind):
            if node == Nodetype.NAME:
                self._message(description, f"{name}{part}.")
            elif node == Nodetype.SEQUENCE:
                self._list(description[0][1][0], name + part)
            elif description[0] == "string":
                self._text()
            else:
                self._number(np.dtype(description[0]), name + part, ())

    def _list(self, kind: str, name: str) -> None:
        count = self._length()
        if kind != "string":
            self._number(np.dtype(kind), name, (count,))
            return
        for _ in range(count):
            self._text()

    def _number(self, kind: np.dtype[Any], name: str, shape: tuple[int, ...]) -> None:
        if shape != (0,):  # nothing fills up before a list without numbers
            self._next += -self._next % kind.itemsize
        self._numbers.append((name, (kind.newbyteorder(self._order), shape), HEAD + self._next))
        self._next += kind.itemsize * int(np.prod(shape))

    def _text(self) -> None:
        length = self._length()
        self.fixed[HEAD + self._next : HEAD + self._next + length] = True
        self._next += length

    def _length(self) -> int:
        """Of a text or a list; what follows depends on it."""
        self._next += -self._next % LENGTH.itemsize
        begin = HEAD + self._next
        self._next += LENGTH.itemsize
        self.fixed[begin : HEAD + self._next] = True
        return int(np.frombuffer(self._cdr, LENGTH.newbyteorder(self._order), 1, begin)[0])

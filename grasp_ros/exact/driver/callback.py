"""Segment callback: a function that a run calls after each segment, where it has one, by its address.

An address in place of a function keeps the observer out of the machine code of the run: a run without an observer is
compiled without one and loses one comparison for each segment, and neither changes a bit of the motion. The observer is
called when the segment is over and before its transitions, so that modes and bodies are still those of the segment.
"""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar
from weakref import finalize

import numpy as np
from numba.core.types import float64, int64

from grasp_ros.exact.compilation.jit import COMPILED, address_of_code, code_of_call, inlined, instruction
from grasp_ros.exact.compilation.reference import Reference
from grasp_ros.exact.records import Integers, Segment, Tables

ADDRESS, CONTEXT = 0, 1  # columns of an observer
FINISH, REST = -1, -3  # in place of a kind of segment: after a run, and where nothing moves in an interval
SIGNATURE = int64(int64, int64, float64, float64, float64, int64)  # of an observer, see `notify`
_PLAIN: dict[int, Any] = {}  # where nothing is compiled: functions and records by their addresses


@instruction(lambda _, address, context, kind, t, s, unit, degree: (int64(int64, *SIGNATURE.args), code_of_call))
def call(address: int, context: int, kind: int | np.int64, t: float, s: float, unit: float, degree: int) -> int:
    """Call the observer at an address."""
    return int(_PLAIN[int(address)](int(context), kind, t, s, unit, degree))


@cache
def address_of(function: Any) -> int:
    """Address of an observer, which is compiled where it has not been; where nothing is, a number that `call` knows."""
    if not COMPILED:
        _PLAIN[id(function)] = function
        return id(function)
    function.compile(SIGNATURE)
    (result,) = function.overloads.values()
    return address_of_code(result)


def block_of(record: Any) -> Integers:
    """Memory image, as in kernels, of a record of arrays; valid as long as these live."""
    # A numba array: meminfo, parent (none), size, itemsize, data, shape, strides.
    block = np.array([word for part in record for word in (
        0, 0, part.size, part.itemsize, part.ctypes.data, *part.shape, *part.strides)])
    if not COMPILED:
        _PLAIN[block.ctypes.data] = record
        finalize(block, _PLAIN.pop, block.ctypes.data)
    return block


def reader(kind: Any) -> Any:
    """A function that kernels call for the record of this type behind an address."""
    def code(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(Reference(kind)))

    @instruction(lambda _, address: (Reference(kind)(int64), code))
    def read(address: int) -> Any:
        return _PLAIN[int(address)]

    return read


@inlined
def tell(observer: Integers, kind: int, number: float) -> None:
    """Call the observer with another kind than that of a segment; with REST: how long nothing moves, in s."""
    if observer[ADDRESS] != 0:
        call(observer[ADDRESS], observer[CONTEXT], kind, number, 0.0, 0.0, 0)


@inlined
def notify(observer: Integers, segment: Segment) -> None:
    """Call the observer after a segment: with its kind, its length, where its series end, their unit and degree."""
    if observer[ADDRESS] != 0:
        step = segment.step
        call(observer[ADDRESS], observer[CONTEXT], np.int64(segment.kind), segment.t, segment.s, step.unit,
             step.order.number)


class Observer:
    """An observer of a run: a function, and the record that is its memory.

    Attributes
    ----------
    memory : named tuple of arrays
        The fields TABLES are those of the workspace of the run.
    """

    TABLES: ClassVar[tuple[str, ...]] = ("c",)

    def __init__(self, function: Any, memory: Any) -> None:
        self._address, self._function = address_of(function), function
        self.memory, self._block = memory, block_of(memory)

    def attach(self, tables: Tables) -> Integers:
        """Addresses (2,) of the function and of its memory, for a run with this workspace."""
        if tables.c is not self.memory.c:  # a run in many pieces brings the same ones
            self.memory = self.memory._replace(**{name: getattr(tables, name) for name in self.TABLES})
            self._block = block_of(self.memory)
        return np.array([self._address, self._block.ctypes.data])

    def tell(self, kind: int, number: float = 0.0) -> None:
        """Call the function with another kind than that of a segment."""
        self._function(self._block.ctypes.data, kind, number, 0.0, 0.0, 0)

    def finish(self) -> None:
        """After a run."""
        self.tell(FINISH)

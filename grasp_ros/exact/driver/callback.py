"""Segment callback: a function that a run calls after each segment, where it has one, by its address.

An address in place of a function keeps the observer out of the machine code of the run: a run without an observer is
compiled without one and loses one comparison for each segment, and neither changes a bit of the motion. The observer is
called when the segment is over and before its transitions, so that modes and bodies are still those of the segment.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from weakref import finalize

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from grasp_ros.exact.compilation.jit import COMPILED, function_at, inlined
from grasp_ros.exact.records import Integers, Segment

ADDRESS, CONTEXT = 0, 1  # places of an observer


@intrinsic  # type: ignore[untyped-decorator]
def call(_: Any, address: Any, context: Any, kind: Any, t: Any, s: Any, degree: Any) -> Any:
    """Call the function int64(int64, int64, float64, float64, int64) at an address."""
    def code(__: Any, builder: Any, ___: Any, arguments: Any) -> Any:
        whole, real = ir.IntType(64), ir.DoubleType()
        function = ir.FunctionType(whole, (whole, whole, real, real, whole)).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), arguments[1:])

    whole, real = types.int64, types.float64
    return whole(whole, whole, whole, real, real, whole), code


def block_of(record: Any) -> Integers:
    """A record of arrays, and of records of them, as kernels have it in memory; it holds for as long as they live."""
    block = np.array([*_words(record)])
    if not COMPILED:
        _RECORDS[block.ctypes.data] = record
        finalize(block, _RECORDS.pop, block.ctypes.data)
    return block


def _words(record: Any) -> Iterator[int]:
    for part in record:
        if isinstance(part, tuple):
            yield from _words(part)
        else:  # owners, of which there are none, numbers, bytes of one, address, shape, bytes to the next
            yield from (0, 0, part.size, part.itemsize, part.ctypes.data, *part.shape, *part.strides)


def reader(kind: Any) -> Any:
    """A function that kernels call for the record of this type behind an address."""
    @intrinsic  # type: ignore[untyped-decorator]
    def read(_: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, __: Any, arguments: Any) -> Any:
            return builder.load(builder.inttoptr(arguments[0], context.get_value_type(kind).as_pointer()))

        return kind(types.int64), code

    return read if COMPILED else lambda address: _RECORDS[int(address)]


_RECORDS: dict[int, Any] = {}  # where nothing is compiled

if not COMPILED:

    def call(address: int, context: int, kind: int, t: float, s: float, degree: int) -> int:
        """Call the function at an address."""
        return int(function_at(int(address))(int(context), kind, t, s, degree))


@inlined
def notify(observer: Integers, segment: Segment) -> None:
    """Call the observer after a segment: with its kind, its length, where its series end, and their degree."""
    if observer[ADDRESS] != 0:
        call(observer[ADDRESS], observer[CONTEXT], np.int64(segment.kind), segment.t, segment.s,
             segment.step.order.number)

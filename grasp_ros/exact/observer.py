"""Who looks on: a function that a run calls after each segment, where it has one, by its address.

An address in place of a function keeps the observer out of the machine code of the run: a run without an observer is
compiled without one and loses one comparison for each segment, and neither changes a bit of the motion. The observer is
called when the segment is over and before its transitions, so that modes and bodies are still those of the segment.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from grasp_ros.exact.jit import COMPILED, function_at, inlined
from grasp_ros.exact.records import Output, Tables
from grasp_ros.physics.layout import CHECK, LANES, TIME, Filled, Segment


@intrinsic  # type: ignore[untyped-decorator]
def call(_: Any, address: Any, context: Any, kind: Any, t: Any) -> Any:
    """Call the function int64(int64, int64, float64) at an address."""
    def code(__: Any, builder: Any, ___: Any, arguments: Any) -> Any:
        whole, real = ir.IntType(64), ir.DoubleType()
        function = ir.FunctionType(whole, (whole, whole, real)).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], function), arguments[1:])

    return types.int64(types.int64, types.int64, types.int64, types.float64), code


@intrinsic  # type: ignore[untyped-decorator]
def floats_at(_: Any, address: Any) -> Any:
    """A pointer to the floats at an address."""
    def code(__: Any, builder: Any, ___: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.DoubleType().as_pointer())

    return types.CPointer(types.float64)(types.int64), code


@intrinsic  # type: ignore[untyped-decorator]
def integers_at(_: Any, address: Any) -> Any:
    """A pointer to the integers at an address."""
    def code(__: Any, builder: Any, ___: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())

    return types.CPointer(types.int64)(types.int64), code


if not COMPILED:

    def call(address: int, context: int, kind: int, t: float) -> int:
        """Call the function at an address."""
        return int(function_at(int(address))(int(context), kind, t))

    def floats_at(address: int) -> Any:
        """A pointer to the floats at an address."""
        return ctypes.cast(int(address), ctypes.POINTER(ctypes.c_double))

    def integers_at(address: int) -> Any:
        """A pointer to the integers at an address."""
        return ctypes.cast(int(address), ctypes.POINTER(ctypes.c_int64))


@inlined
def notify(out: Output, kind: Segment, t: float) -> None:
    """Call the observer after a segment of t s."""
    if out.filled[Filled.OBSERVER] != 0:
        call(out.filled[Filled.OBSERVER], out.filled[Filled.CONTEXT], np.int64(kind.value), t)


@inlined
def leave_step(tables: Tables, s: float, unit: float) -> None:
    """Leave the end of a step, in units of its variable, and that unit, where an observer finds them."""
    tables.size[TIME], tables.size[CHECK] = s, unit


@inlined
def leave_orders(tables: Tables, order: int, out: Output) -> None:
    """Clear what a series of a lower order leaves of another one: an observer reads all that there is room for."""
    if out.filled[Filled.OBSERVER] != 0:
        for i in range(LANES * (order + 1), LANES * len(tables.row)):
            tables.c[i] = 0.0

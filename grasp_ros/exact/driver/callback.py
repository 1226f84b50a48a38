"""Segment callback: a function that a run calls after each segment, where it has one, by its address.

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

    def call(address: int, context: int, kind: int, t: float, s: float, degree: int) -> int:
        """Call the function at an address."""
        return int(function_at(int(address))(int(context), kind, t, s, degree))

    def floats_at(address: int) -> Any:
        """A pointer to the floats at an address."""
        return ctypes.cast(int(address), ctypes.POINTER(ctypes.c_double))

    def integers_at(address: int) -> Any:
        """A pointer to the integers at an address."""
        return ctypes.cast(int(address), ctypes.POINTER(ctypes.c_int64))


@inlined
def notify(observer: Integers, segment: Segment) -> None:
    """Call the observer after a segment: with its kind, its length, where its series end, and their degree."""
    if observer[ADDRESS] != 0:
        call(observer[ADDRESS], observer[CONTEXT], np.int64(segment.kind), segment.t, segment.s,
             segment.step.order.number)

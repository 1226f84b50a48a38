"""Controllers from outside: the kernels call them as C functions, by their address."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

DOUBLE, WORD = ir.DoubleType(), ir.IntType(64)


@intrinsic  # type: ignore[untyped-decorator]
def call(_: Any, address: Any, tick: Any, time: Any, x: Any, v: Any) -> Any:
    """The command in N of the function at an address: double (int64 tick, double time, double x, double v)."""
    signature = types.float64(types.int64, types.int64, types.float64, types.float64, types.float64)

    def emit(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        function = ir.FunctionType(DOUBLE, [WORD, DOUBLE, DOUBLE, DOUBLE])
        return builder.call(builder.inttoptr(arguments[0], function.as_pointer()), arguments[1:])

    return signature, emit

"""a b + c with one rounding.

Compilers may not fuse a product and a sum by themselves: bits would depend on what is compiled with what. Said so in
the source it is the same everywhere, half as long on a processor that can do it, and no less exact.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numba
from numba import types
from numba.extending import intrinsic


@intrinsic  # type: ignore[untyped-decorator]
def _fused(_: Any, a: Any, b: Any, c: Any) -> Any:
    """The instruction."""
    def code(__: Any, builder: Any, ___: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), code


def _exact(a: float, b: float, c: float) -> float:
    """The same without a compiler."""
    if not math.isfinite(a * b + c):
        return a * b + c
    exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
    return float(exact) if exact else a * b + c


fma = _exact if numba.config.DISABLE_JIT else _fused

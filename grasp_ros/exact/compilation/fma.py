"""a b + c with one rounding.

Compilers may not fuse a product and a sum by themselves: bits would depend on what is compiled with what. Said so in
the source it is the same everywhere, half as long on a processor that can do it, and no less exact.
"""

from __future__ import annotations

import math
from fractions import Fraction

from numba import types

from grasp_ros.exact.compilation.jit import instruction

REAL = types.float64


@instruction(lambda _, a, b, c: (REAL(REAL, REAL, REAL), lambda _, builder, __, numbers: builder.fma(*numbers)))
def fma(a: float, b: float, c: float) -> float:
    """The sum of a product, a b, and c."""
    if not math.isfinite(a * b + c):
        return a * b + c
    exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
    return float(exact) if exact else a * b + c

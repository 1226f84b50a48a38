"""Exponents, logarithms and powers of two by the bits of a number, without a call of the C library."""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.compilation.jit import inlined, kernel

MANTISSA = 52  # bits
BIAS = 1023  # of the exponent
FRACTION = (1 << MANTISSA) - 1
ONE = BIAS << MANTISSA  # the bits of 1.0
WHOLE, UNIT = 2.0**52, 2.0**-52
BEND = 0.34  # of 2^x between whole numbers, for which the error is least


@kernel
def exponent(x: float) -> int:
    """e of the power of two 2^e <= x < 2^(e + 1), for x > 0; -1 for 0."""
    biased = int(np.float64(x).view(np.int64)) >> MANTISSA
    return biased - BIAS if biased > 0 else math.frexp(x)[1] - 1


@kernel
def power_of_two(e: int) -> float:
    """2^e."""
    return np.int64((e + BIAS) << MANTISSA).view(np.float64) if -BIAS < e <= BIAS else math.ldexp(1.0, e)


@inlined
def near_log2(x: float) -> float:
    """Binary logarithm of x > 0, on a broken line through the powers of two, at most 0.09 too small."""
    return (int(np.float64(x).view(np.int64)) - ONE) * UNIT


@inlined
def near_exp2(x: float) -> float:
    """2^x for x from -1022 to 1023, to within 0.3 %, and exact where x is whole."""
    bits = ONE + int(x * WHOLE)
    part = np.int64((bits & FRACTION) | ONE).view(np.float64) - 1.0
    return np.int64(bits & ~FRACTION).view(np.float64) * (1.0 + part * ((1.0 - BEND) + BEND * part))


@inlined
def near_inverse(x: float) -> float:
    """1 / x for 0 < x < 2^1023, at most an eighth too large, and exact for powers of two."""
    return np.int64(2 * ONE - int(np.float64(x).view(np.int64))).view(np.float64)


@kernel
def orders_to_one(x: float, most: int) -> int:
    """Binary orders by which a unit is to change for x >= 0 to come near 1: at most `most`, and these for 0 and inf."""
    if 0.0 < x < math.inf:
        return int(min(max(exponent(x) + 1, -most), most))
    return most if x > 0.0 else -most


@kernel
def power_of_two_root(x: float, degree: int) -> float:
    """The power of two above the root of x >= 0; comparing exponents is cheaper than taking the root."""
    return power_of_two(exponent(x) // degree + 1) if x > 0.0 else 0.0

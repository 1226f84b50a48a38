"""Powers of two by the bits of a number, and sums of a product with one rounding."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from grasp_ros.exact.compilation.jit import door
from grasp_ros.exact.compilation.vectors import fma
from grasp_ros.exact.numerics.powers_of_two import (
    exponent,
    near_exp2,
    near_inverse,
    near_log2,
    orders_to_one,
    power_of_two,
)

ALL = [1.0, 1.5, math.nextafter(2.0, 1.0), 2.0, 3e-5, 1e300, 5e-324, 2.3e-308, 1.7e308]


@door
def fused(a: float, b: float, c: float) -> Any:
    """The instruction, compiled."""
    return fma(a, b, c)


@pytest.mark.parametrize("x", ALL)
def test_the_exponent_is_that_of_the_library(x: float) -> None:
    assert exponent(x) == math.frexp(x)[1] - 1
    assert power_of_two(exponent(x)) <= x < 2.0 * power_of_two(exponent(x))


@pytest.mark.parametrize("e", [-1080, -1074, -1023, -1022, -1, 0, 1, 1023])
def test_a_power_of_two_is_that_of_the_library(e: int) -> None:
    assert power_of_two(e) == math.ldexp(1.0, e)


def test_what_is_near_is_as_near_as_it_says() -> None:
    rng = np.random.default_rng(1)
    for x in (2.0 ** rng.uniform(-900.0, 900.0, 2000)).tolist():
        assert -0.087 <= near_log2(x) - math.log2(x) <= 1e-12
        assert 1.0 - 1e-15 <= near_inverse(x) * x <= 1.125
    for x in rng.uniform(-1000.0, 1000.0, 2000).tolist():
        assert near_exp2(x) * 2.0**-x == pytest.approx(1.0, abs=3e-3)
    for e in (-1000, -3, 0, 4, 900):
        assert near_exp2(float(e)) == 2.0**e
        assert near_log2(2.0**e) == e
        assert near_inverse(2.0**e) == 2.0**-e


def test_orders_to_one_end_where_they_may() -> None:
    assert [orders_to_one(x, 16) for x in (0.0, math.inf, 1e-300, 1e300, 1.0, 0.3)] == [-16, 16, -16, 16, 1, -1]


def test_a_product_and_a_sum_are_rounded_once() -> None:
    rng = np.random.default_rng(2)
    for _ in range(2000):
        a, b = rng.normal(size=2).tolist()
        c = -a * b * (1.0 + rng.normal() * 2.0 ** rng.integers(-60, 4))  # much cancels
        assert fused(a, b, c) == float(Fraction(a) * Fraction(b) + Fraction(c))
    assert fused(1e300, 1e300, -math.inf) == -math.inf
    assert math.isnan(fused(math.inf, 0.0, 1.0))

"""The first rise of a polynomial through zero, against roots that are known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

from grasp_ros.exact.numerics.roots import first_rise, safe_step, shift
from grasp_ros.physics.layout import Work


def searched(coefficients: Any, h: float, noise: float = 0.0) -> tuple[float, int]:
    """The kernel's answer for coefficients in ascending order, and the iterations that it took."""
    work, f = np.zeros(len(Work), dtype=np.int64), np.array(coefficients, dtype=float)
    return first_rise(f, len(f) - 1, h, noise, work), int(work[Work.ROOT_ITERATIONS])


def rise(coefficients: Any, h: float) -> float:
    """The answer alone."""
    found, iterations = searched(coefficients, h)
    assert iterations < 5000
    return found


@pytest.mark.parametrize(("coefficients", "h", "expected"), [
    ([-1.0, 2.0], 1.0, 0.5),
    ([-1.0, 2.0], 0.4, math.inf),
    ([-1.0, 1.0], 1.0, 1.0),  # (0, h]
    ([-1.0, 0.0, 0.0, 0.0, 0.0, 32.0], 1.0, 0.5),
    ([0.0, -1.0, 1.0], 2.0, 1.0),  # zero at the start, falling
    ([0.0, -1.0, 1.0], 0.9, math.inf),
    ([0.0, 0.0, -1.0, 1.0], 2.0, 1.0),  # double zeros at the start are divided out
    ([0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 4.0], 2.0, 0.5),
    ([0.0, 0.0, 0.0, -1.0, 2.0], 2.0, 0.5),
    ([0.0, 0.0, -1.0], 2.0, math.inf),
    ([0.0, -1.0], 2.0, math.inf),
    ([0.0, 0.0, 0.0], 2.0, math.inf),
    ([-0.3, 1.1, -1.0], 1.0, 0.5),  # -(s - 0.5)(s - 0.6): rises at 0.5, falls at 0.6
    ([-0.24, 1.0, -1.0], 1.0, 0.4),
    ([-0.26, 1.0, -1.0], 1.0, math.inf),
    ([-0.25 - 1e-9, 1.0, -1.0], 1.0, math.inf),  # a double root, missed by 1e-9
    ([-1.0, 0.0, 0.0], 1e300, math.inf),
])
def test_first_rise_of_known_polynomials(coefficients: Any, h: float, expected: float) -> None:
    assert rise(coefficients, h) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("eps", [1e-4, 1e-8, 1e-12])
def test_first_rise_beside_a_double_root(eps: float) -> None:
    found = rise([-0.25 + eps, 1.0, -1.0], 1.0)
    assert found == pytest.approx(0.5 - math.sqrt(eps), rel=0, abs=1e-15 / math.sqrt(eps) + 1e-15)


@pytest.mark.parametrize("gap", [1e-100, 1e-200, 1e-290])
def test_a_root_next_to_zero_keeps_its_digits_and_costs_nothing(gap: float) -> None:
    found, iterations = searched([-gap, 2.0, -0.5], 1.0)
    assert found == pytest.approx(0.5 * gap, rel=1e-15, abs=0.0)
    assert iterations < 10


@pytest.mark.parametrize("zeros", range(1, 6))
@pytest.mark.parametrize("h", [1e-200, 1.0, 1e200])
def test_a_zero_at_the_start_that_rises_is_not_lost(zeros: int, h: float) -> None:
    assert 0.0 < rise([*[0.0] * zeros, 1.0, 1.0], h) < 1e-12 * h


@pytest.mark.parametrize("scale", [1e-140, 1.0, 1e140])
def test_a_rise_does_not_depend_on_the_unit_of_the_polynomial(scale: float) -> None:
    assert rise([-3.0 * scale, scale, 2.0 * scale], 2.0) == pytest.approx(1.0, rel=1e-13)


def test_noise_at_the_end_of_a_step_hides_no_root_at_its_begin() -> None:
    """At h = 1e6 the terms come to 1e38, and their rounding to 1e22; at 1.5 to 1e8 times less than the slope."""
    f = [-0.75, 1.25, -0.5]  # -(s - 1)(s - 1.5) / 2: rises at 1
    f += [0.0] * 3 + [-1e-12, 1e-13]
    with mp.workdps(40):
        expected = mp.findroot(lambda s: sum(mpf(a) * s**k for k, a in enumerate(f)), 1.0)
    assert rise(f, 1e6) == pytest.approx(float(expected), rel=1e-13)


def test_within_its_noise_a_polynomial_counts_as_zero() -> None:
    falls_short = [-1.0, 2.0, -1.0 - 1e-9]  # its top is 1e-9 below zero
    assert rise(falls_short, 2.0) == math.inf
    assert searched(falls_short, 2.0, 1e-8)[0] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("value", "rate", "found"), [(2e-8, 1.0, True), (0.5e-8, 1.0, False), (2e-8, -1.0, False), (2e-8, 0.0, False)]
)
def test_what_has_risen_above_its_noise_before_is_not_lost(value: float, rate: float, found: bool) -> None:
    """Steps that end earlier than it can be told from noise must not carry it on for ever."""
    s, _ = searched([value, rate, 0.0], 1e-10, 1e-8)
    assert (0.0 < s < 1e-40) if found else s == math.inf


@pytest.mark.parametrize("s", [-0.7, 1e-3, 2.0])
def test_a_shifted_polynomial_is_the_same_function(s: float) -> None:
    f = np.random.default_rng(7).normal(size=9)
    moved = f.copy()
    shift(moved, 8, s)
    for x in (-0.4, 0.0, 0.3, 1.1):
        expected = np.polynomial.polynomial.polyval(x + s, f)
        assert np.polynomial.polynomial.polyval(x, moved) == pytest.approx(expected, rel=1e-12, abs=1e-11)


@pytest.mark.parametrize("order", [12, 20, 28])
def test_terms_that_cancel_cost_few_steps(order: int) -> None:
    """1/2 - (1 - s)^n rises through zero, -1/1000 - (1 - s)^n does not; their terms are 2^n times as large."""
    f = np.array([-float(mp.binomial(order, k)) * (-1.0) ** k for k in range(order + 1)])
    one = np.eye(order + 1)[0]
    (found, steps), (none, more) = (searched(f + offset * one, 0.9) for offset in (0.5, -1e-3))
    assert found == pytest.approx(1.0 - 0.5 ** (1.0 / order), rel=1e-12)
    assert none == math.inf
    assert steps + more < 2000


@pytest.mark.parametrize("seed", range(30))
def test_first_rise_of_random_products(seed: int) -> None:
    rng = np.random.default_rng(seed)
    roots = np.sort(rng.uniform(0.05, 1.4, rng.integers(1, 7)))
    with mp.workdps(40):
        product = [mpf(1)]
        for a in roots:
            product = [
                (product[k - 1] if k else 0) - a * (product[k] if k < len(product) else 0)
                for k in range(len(product) + 1)
            ]
        sign = -1 if product[0] > 0 else 1
        coefficients = [float(sign * value) for value in product]
    # negative at 0, so it rises at the first root and falls at the second
    expected = roots[0] if roots[0] <= 1.0 else math.inf
    slope = abs(np.polynomial.polynomial.polyval(roots[0], np.polynomial.polynomial.polyder(coefficients)))
    noise = 1e-15 * sum(map(abs, coefficients))
    assert rise(coefficients, 1.0) == pytest.approx(expected, rel=0, abs=max(5 * noise / slope, 1e-14))


@pytest.mark.parametrize("curvature", [0.0, 1e-300, 1.0, 1e12])
@pytest.mark.parametrize("g", [-1e-300, -1e-9, -1.0])
@pytest.mark.parametrize("g_rate", [-3.0, 0.0, 1e-12, 5.0])
def test_safe_step_is_the_smallest_positive_root(g: float, g_rate: float, curvature: float) -> None:
    h = safe_step(g, g_rate, curvature)
    with mp.workdps(700):
        if curvature == 0.0:
            expected = -mpf(g) / mpf(g_rate) if g_rate > 0.0 else mp.inf
        else:
            root_ = mp.sqrt(mpf(g_rate) ** 2 - 2 * mpf(curvature) * mpf(g))
            expected = (root_ - mpf(g_rate)) / mpf(curvature)
        if expected > mpf("1e308"):
            assert h > 1e307
        elif expected > mpf("1e-300") and not (g == -1e-300 and curvature in (1e-300,)):
            assert abs(h / expected - 1) < mpf("1e-15")

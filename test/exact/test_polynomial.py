"""The first rise of a polynomial through zero, against roots that are known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

from grasp_ros.exact.polynomial import first_rise
from grasp_ros.physics.layout import Work


def rise(coefficients: Any, h: float) -> float:
    """The kernel's answer for coefficients in ascending order."""
    work = np.zeros(len(Work), dtype=np.int64)
    f = np.array(coefficients, dtype=float)
    result = first_rise(f, len(f) - 1, h, 0.0, work)
    assert work[Work.ROOT_ITERATIONS] < 5000
    return result


@pytest.mark.parametrize(
    ("coefficients", "h", "expected"),
    [
        ([-1.0, 2.0], 1.0, 0.5),
        ([-1.0, 2.0], 0.4, math.inf),
        ([-1.0, 1.0], 1.0, 1.0),  # (0, h]
        ([-1.0, 0.0, 0.0, 0.0, 0.0, 32.0], 1.0, 0.5),
        ([0.0, -1.0, 1.0], 2.0, 1.0),  # zero at the start, falling
        ([0.0, -1.0, 1.0], 0.9, math.inf),
        ([0.0, 0.0, -1.0, 1.0], 2.0, 1.0),
        ([0.0, 0.0, -1.0], 2.0, math.inf),
        ([0.0, -1.0], 2.0, math.inf),
        ([0.0, 0.0, 0.0], 2.0, math.inf),
        ([-0.3, 1.1, -1.0], 1.0, 0.5),  # -(s - 0.5)(s - 0.6): rises at 0.5, falls at 0.6
        ([-0.24, 1.0, -1.0], 1.0, 0.4),
        ([-0.26, 1.0, -1.0], 1.0, math.inf),
        ([-0.25 - 1e-9, 1.0, -1.0], 1.0, math.inf),  # a double root, missed by 1e-9
        ([-1.0, 0.0, 0.0], 1e300, math.inf),
    ],
)
def test_first_rise_of_known_polynomials(coefficients: Any, h: float, expected: float) -> None:
    assert rise(coefficients, h) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("eps", [1e-4, 1e-8, 1e-12])
def test_first_rise_beside_a_double_root(eps: float) -> None:
    found = rise([-0.25 + eps, 1.0, -1.0], 1.0)
    assert found == pytest.approx(0.5 - math.sqrt(eps), rel=0, abs=1e-15 / math.sqrt(eps) + 1e-15)


def test_a_zero_at_the_start_that_rises_is_not_lost() -> None:
    assert 0.0 < rise([0.0, 1.0, 1.0], 1.0) < 1e-12


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

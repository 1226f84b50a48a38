"""Polynomials of one Taylor step: values, the first root, and the inverse of the time."""

import math
from typing import Any

from grasp_ros.physics.flight import EPS, safe_step
from grasp_ros.physics.jit import kernel

MAX_ITERATIONS = 100_000


@kernel
def evaluate(a: Any, n: int, s: float) -> float:
    """Polynomial of degree n at s (Horner)."""
    total = a[n]
    for k in range(n - 1, -1, -1):
        total = total * s + a[k]
    return total


@kernel
def evaluate_rate(a: Any, n: int, s: float) -> float:
    """Derivative of a polynomial of degree n at s."""
    total = n * a[n]
    for k in range(n - 1, 0, -1):
        total = total * s + k * a[k]
    return total


@kernel
def curvature_bound(row: Any, n: int, r: float) -> float:
    """Bound on the second derivative of a polynomial in [0, r]."""
    total = 0.0
    for k in range(n, 1, -1):
        total = total * r + k * (k - 1) * abs(row[k])
    return total


@kernel
def first_rise(row: Any, scale: float, offset: float, n: int, h: float, work: Any) -> float:
    """First s in (0, h] at which f = offset + scale * row, with f(0) <= 0, rises through zero; inf if there is none.

    The positive terms bound the polynomial from above and the second derivative is bounded by sums of |f_k|, so the
    steps of `safe_step` cannot jump over a root. Within the rounding noise of its terms f counts as negative.
    """
    start = offset + scale * row[0]
    upper = 0.0
    size = 0.0
    for k in range(n, 0, -1):
        term = scale * row[k]
        upper = (upper + max(term, 0.0)) * h
        size = (size + abs(term)) * h
    if upper < -start:
        return math.inf
    curvature = abs(scale) * curvature_bound(row, n, h)
    noise = EPS * (abs(start) + size)
    s = 0.0
    value = start
    rate = scale * row[1]
    last = 0.0
    for _ in range(MAX_ITERATIONS):
        work[3] += 1
        step = safe_step(min(value, -noise), rate, curvature)
        reach = 4.0 * max(step, last)
        if reach < h - s:  # a bound for the neighbourhood alone allows a longer step
            nearby = abs(scale) * curvature_bound(row, n, s + reach)
            step = min(reach, safe_step(min(value, -noise), rate, nearby))
        last = max(step, EPS * h)
        s += last
        if not s <= h:
            return math.inf if s > h else math.nan
        value = offset + scale * evaluate(row, n, s)
        rate = scale * evaluate_rate(row, n, s)
        if value >= -noise and rate > 0.0:
            return s
    return math.nan


@kernel
def invert_time(time: Any, n: int, tau: float, high: float) -> float:
    """The s in [0, high] at which the polynomial `time`, increasing there, is tau (Newton with bisection).

    Newton's error is squared by each iteration, so a correction of 1e-9 is the last one needed.
    """
    low = 0.0
    s = 0.5 * high
    for _ in range(200):
        value = time[n]
        rate = 0.0
        for k in range(n - 1, -1, -1):
            rate = rate * s + value
            value = value * s + time[k]
        rest = value - tau
        if rest > 0.0:
            high = s
        else:
            low = s
        following = s - rest / rate if rate > 0.0 else low
        if not low <= following <= high:
            following = 0.5 * (low + high)
        elif abs(following - s) <= 1e-9 * high:
            return following
        if high - low <= 2.0 * EPS * high:
            return following
        s = following
    return s

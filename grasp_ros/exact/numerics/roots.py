"""The first root of a function that rises through zero: of a polynomial, or of what a bound on its curvature tells."""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.records import Array, Integers
from grasp_ros.exact.tolerances import AT_ONCE, BRACKET, DIED_OUT, LAST_OF_RISE
from grasp_ros.physics.layout import EPS, Work

MAX_STEPS, MAX_SHIFTS = 100, 1000
FOUND = -1.0  # instead of a noise


@kernel
def safe_step(g: float, g_rate: float, curvature: float) -> float:
    """Smallest h > 0 with g + g' h + M h^2 / 2 = 0 for g <= 0; inf if there is none.

    An exact zero at the start does not count: for g = 0 and g' < 0 the second root is returned.
    """
    if curvature <= 0.0:
        return -g / g_rate if g_rate > 0.0 else math.inf
    root = math.sqrt(g_rate * g_rate - 2.0 * curvature * g)
    if not DIED_OUT < root < 1.0 / DIED_OUT:  # squares have left the range of numbers
        root = math.hypot(g_rate, math.sqrt(2.0 * curvature) * math.sqrt(-g))
    return (root - g_rate) / curvature if g_rate <= 0.0 else -2.0 * g / (root + g_rate)


@kernel
def value_and_rate(f: Array, n: int, s: float) -> tuple[float, float, float]:
    """One polynomial of degree n, its derivative, and the sum of the sizes of its terms, at s."""
    value = f[n]
    rate = 0.0
    size = abs(value)
    for k in range(n - 1, -1, -1):
        rate = rate * s + value
        value = value * s + f[k]
        size = size * s + abs(f[k])
    return value, rate, size


@kernel
def curvature_bound(f: Array, n: int, r: float) -> float:
    """Bound on the second derivative of a polynomial in [0, r]."""
    total = 0.0
    for k in range(n, 1, -1):
        total = total * r + k * (k - 1) * abs(f[k])
    return total


@kernel
def root_of_rise(f: Array, n: int, low: float, high: float, noise: float, work: Integers) -> float:
    """The root of a polynomial that increases in [low, high] and is negative at low; inf if there is none.

    Newton with bisection, from the upper end. Its error is squared by each iteration, so LAST_OF_RISE tells the last
    correction.
    """
    value, rate, size = value_and_rate(f, n, high)
    if value <= 0.0:
        return high if value >= -max(noise, EPS * size) else math.inf
    s = high
    for _ in range(200):
        following = s - value / rate if rate > 0.0 else low
        if not low <= following <= high:
            following = 0.5 * (low + high)
        elif abs(following - s) <= LAST_OF_RISE * s:
            return following
        if high - low <= BRACKET * high:
            return following
        s = following
        work[Work.ROOT_ITERATIONS] += 1
        value, rate, _ = value_and_rate(f, n, s)
        if value > 0.0:
            high = s
        else:
            low = s
    return s


@kernel
def shift(f: Array, n: int, s: float) -> None:
    """Expand a polynomial of degree n about s instead of 0: synthetic division, again and again."""
    for first in range(n):
        for k in range(n - 1, first - 1, -1):
            f[k] += s * f[k + 1]


@kernel
def first_rise(f: Array, n: int, h: float, noise: float, work: Integers) -> float:
    """First s in (0, h] at which a polynomial f, with f(0) <= 0, rises through zero; inf if there is none.

    The second derivative is bounded by sums of |f_k|, so the steps of `safe_step` cannot jump over a root, until f
    is known to increase all the way to h. Within `noise`, or the rounding noise of its terms there, f counts as zero.
    An exact zero at 0 is no root. A double one is, if f rises from it; so is 0 if f rises from above the noise, where
    a step before ended within it. After MAX_STEPS, because large terms cancel, f is expanded anew about the point
    reached. f is overwritten.
    """
    degree = n
    while n > 1 and f[0] == 0.0 and f[1] == 0.0:  # divide it by s^2, which changes no later sign
        n -= 2
        for k in range(n + 1):
            f[k] = f[k + 2]
    if (n < degree and f[0] > 0.0) or (n > 0 and f[0] > noise and f[1] > 0.0):
        return AT_ONCE * h
    begin, last = 0.0, 0.0
    for _ in range(MAX_SHIFTS):
        s, noise, last = search(f, n, h, noise, last, work)
        if not (0.0 < s < h) or noise == FOUND:
            return begin + s
        shift(f, n, s)
        begin += s
        h -= s
    return math.nan


@kernel
def search(f: Array, n: int, h: float, noise: float, last: float, work: Integers) -> tuple[float, float, float]:
    """`first_rise` with a limited number of steps: the root and FOUND, or where it got to and the noise there.

    `last` is the length of the last step, here and in what is returned.
    """
    curvature = curvature_bound(f, n, h)
    s = 0.0
    value, rate, size = f[0], f[1] if n > 0 else 0.0, abs(f[0])
    near = max(noise, EPS * size)
    for _ in range(MAX_STEPS):
        work[Work.ROOT_ITERATIONS] += 1
        if value < -near and rate > curvature * (h - s):  # by half of the rate at least
            return root_of_rise(f, n, s, min(h, s - 2.0 * value / rate), noise, work), FOUND, last
        step = safe_step(min(value, -near), rate, curvature)
        reach = 4.0 * max(step, last)
        if reach < h - s:  # a bound for the neighbourhood alone allows a longer step
            nearby = curvature_bound(f, n, s + reach)
            step = min(reach, safe_step(min(value, -near), rate, nearby))
        last = max(step, EPS * s)
        if last == 0.0:
            last = AT_ONCE * h
        s += last
        if not s <= h:
            return math.inf if s > h else math.nan, FOUND, last
        value, rate, size = value_and_rate(f, n, s)
        near = max(noise, EPS * size)
        if value >= -near and rate > 0.0:
            return s, FOUND, last
    return s, near, last

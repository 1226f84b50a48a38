"""Tables of eight polynomials side by side: their values, first roots, and the inverse of the time.

Coefficient k of a lane stands at LANES k + lane, so that one pass evaluates all lanes in vector instructions. Orders
are even: the even and the odd powers are summed side by side, which halves the time until the result is there.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.records import Array, Integers, Lanes, Step, Tables
from grasp_ros.physics.layout import EPS, LANES, TIME, V_L, V_O, V_R, Z_L, Z_R, Work

MAX_ITERATIONS = 100_000
FIRST, SECOND = np.int64(0), np.int64(2)  # typed: numba would compile `lanes` and `sizes` once more for a literal
NOISE = 100.0 * EPS  # of a polynomial with some tens of terms


@kernel
def lanes(c: Array, k: int) -> Lanes:
    """The coefficients k."""
    i = np.uint64(LANES) * np.uint64(k)  # unsigned indices spare the test for negative ones
    return (
        c[i], c[i + np.uint64(1)], c[i + np.uint64(2)], c[i + np.uint64(3)],
        c[i + np.uint64(4)], c[i + np.uint64(5)], c[i + np.uint64(6)], c[i + np.uint64(7)],
    )


@kernel
def sizes(c: Array, k: int) -> Lanes:
    """The absolute coefficients k."""
    x = lanes(c, k)
    return (
        abs(x[0]), abs(x[1]), abs(x[2]), abs(x[3]),
        abs(x[4]), abs(x[5]), abs(x[6]), abs(x[7]),
    )


@kernel
def horner(total: Lanes, s: float, x: Lanes) -> Lanes:
    """One more coefficient of each lane."""
    return (
        total[0] * s + x[0], total[1] * s + x[1], total[2] * s + x[2], total[3] * s + x[3],
        total[4] * s + x[4], total[5] * s + x[5], total[6] * s + x[6], total[7] * s + x[7],
    )


@inlined
def values(c: Array, n: int, s: float, at: Array) -> None:
    """Write the lanes' values at s, of the even degree n, to `at`.

    The constant comes last and is rounded with one sum, so that many short steps lose nothing systematically.
    """
    square = s * s
    even, odd = lanes(c, n), lanes(c, n - 1)
    for k in range(n - 2, 0, -2):
        even, odd = horner(even, square, lanes(c, k)), horner(odd, square, lanes(c, k - 1))
    total = horner(horner(even, s, odd), s, lanes(c, FIRST))
    for lane in range(LANES):
        at[lane] = total[lane]


@inlined
def curvatures(c: Array, n: int, s: float, size: Array) -> None:
    """Write the lanes' sums of |c_k| s^k over k >= 2 to `size`."""
    square = s * s
    even, odd = sizes(c, n), sizes(c, n - 1)
    for k in range(n - 2, 2, -2):
        even, odd = horner(even, square, sizes(c, k)), horner(odd, square, sizes(c, k - 1))
    even = horner(even, square, sizes(c, SECOND))
    for lane in range(LANES):
        size[lane] = (even[lane] + s * odd[lane]) * square


@inlined
def lane_range(tables: Tables, lane: int, s: float) -> tuple[float, float]:
    """Bounds (low, high) of a lane in (0, s], in proportion to the distance from its value c_0 at 0.

    With at = f(s) and size = sum of |c_k| s^k over k >= 2, the terms of one sign beyond the linear one lie between 0
    and half of their signed and absolute sums: f stays between the lines from c_0 to `low` and to `high`.
    """
    begin, size = tables.c[lane], tables.size[lane]
    line = begin + s * tables.c[LANES + lane]
    middle, width = 0.5 * (line + tables.at[lane]), 0.5 * size + NOISE * (abs(begin) + abs(line) + size)
    return middle - width, middle + width


@kernel
def safe_step(g: float, g_rate: float, curvature: float) -> float:
    """Smallest h > 0 with g + g' h + M h^2 / 2 = 0 for g <= 0; inf if there is none.

    An exact zero at the start does not count: for g = 0 and g' < 0 the second root is returned.
    """
    if curvature <= 0.0:
        return -g / g_rate if g_rate > 0.0 else math.inf
    root = math.sqrt(g_rate * g_rate - 2.0 * curvature * g)
    return (root - g_rate) / curvature if g_rate <= 0.0 else -2.0 * g / (root + g_rate)


@kernel
def value_and_rate(f: Array, n: int, s: float) -> tuple[float, float]:
    """One polynomial of degree n, and its derivative, at s."""
    value = f[n]
    rate = 0.0
    for k in range(n - 1, -1, -1):
        rate = rate * s + value
        value = value * s + f[k]
    return value, rate


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

    Newton with bisection, from the upper end. Its error is squared by each iteration, so a correction of 1e-9 is
    the last one needed.
    """
    value, rate = value_and_rate(f, n, high)
    if value <= 0.0:
        return high if value >= -noise else math.inf
    s = high
    for _ in range(200):
        following = s - value / rate if rate > 0.0 else low
        if not low <= following <= high:
            following = 0.5 * (low + high)
        elif abs(following - s) <= 1e-9 * s:
            return following
        if high - low <= 2.0 * EPS * high:
            return following
        s = following
        work[Work.ROOT_ITERATIONS] += 1
        value, rate = value_and_rate(f, n, s)
        if value > 0.0:
            high = s
        else:
            low = s
    return s


@kernel
def first_rise(f: Array, n: int, h: float, noise: float, work: Integers) -> float:
    """First s in (0, h] at which a polynomial f, with f(0) <= 0, rises through zero; inf if there is none.

    The second derivative is bounded by sums of |f_k|, so the steps of `safe_step` cannot jump over a root, until f
    is known to increase all the way to h. Within `noise`, or the rounding noise of its terms, f counts as negative.
    """
    size = 0.0
    for k in range(n, -1, -1):
        size = size * h + abs(f[k])
    noise = max(noise, EPS * size)
    curvature = curvature_bound(f, n, h)
    s = 0.0
    value, rate = f[0], f[1]
    last = 0.0
    for _ in range(MAX_ITERATIONS):
        work[Work.ROOT_ITERATIONS] += 1
        if value < -noise and rate > curvature * (h - s):
            return root_of_rise(f, n, s, h, noise, work)
        step = safe_step(min(value, -noise), rate, curvature)
        reach = 4.0 * max(step, last)
        if reach < h - s:  # a bound for the neighbourhood alone allows a longer step
            nearby = curvature_bound(f, n, s + reach)
            step = min(reach, safe_step(min(value, -noise), rate, nearby))
        last = max(step, EPS * h)
        s += last
        if not s <= h:
            return math.inf if s > h else math.nan
        value, rate = value_and_rate(f, n, s)
        if value >= -noise and rate > 0.0:
            return s
    return math.nan


@inlined
def invert_time(tables: Tables, step: Step, tau: float, high: float, total: float) -> float:
    """The s / unit in [0, high] at which the time since the begin of a step is tau; `total` is the time at high.

    dt = 2 G ds with G = w_l w_r of the sides in contact. Halley's iteration with bisection: its error is cubed each
    time, so a correction of 1e-6 is the last one needed. It starts from the parabola through both ends.
    """
    c, at, n, unit = tables.c, tables.at, step.order, step.unit
    slope = c[LANES + TIME]
    bend = (total - slope * high) / (high * high)
    s = 2.0 * tau / (slope + math.sqrt(max(slope * slope + 4.0 * bend * tau, 0.0)))
    low, top = 0.0, high
    if not low < s < high:
        s = 0.5 * high
    for _ in range(200):
        values(c, n, s, at)
        w_l, d_l = (at[Z_L], at[V_L] - at[V_O]) if step.left else (1.0, 0.0)
        w_r, d_r = (at[Z_R], at[V_O] - at[V_R]) if step.right else (1.0, 0.0)
        rest = at[TIME] - tau
        if rest > 0.0:
            high = s
        else:
            low = s
        twice = 2.0 * w_l * w_r
        newton = rest / (unit * twice)
        following = s - newton / (1.0 - newton * unit * (w_r * w_r * d_l + w_l * w_l * d_r) / twice)
        if not low <= following <= high:
            following = 0.5 * (low + high)
        elif abs(following - s) <= 1e-6 * top:
            return following
        if high - low <= 2.0 * EPS * top:
            return following
        s = following
    return s

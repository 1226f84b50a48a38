"""Tables of eight polynomials side by side: their values, their ranges, and the inverse of the time; products of one.

Coefficient k of a lane stands at LANES k + lane, so that one pass evaluates the vector of all lanes. Orders
are even: the even and the odd powers are summed side by side, which halves the time until the result is there.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.compilation.vectors import add_product, load, sizes, store
from grasp_ros.exact.records import Array, Step
from grasp_ros.exact.tolerances import BRACKET, LAST_CORRECTION, NOISE
from grasp_ros.physics.layout import LANES, Lane, V, Z

INVERSE = np.array([0.0, *(1.0 / n for n in range(1, 100))])  # a quotient would keep the next one waiting


@inlined
def values(c: Array, n: int, s: float, at: Array) -> None:
    """Write the lanes' values at s, of the even degree n, to `at` (2 LANES,), and behind them their changes.

    The constant comes last and is rounded with one sum, so that many short steps lose nothing systematically.
    """
    square = s * s
    even, odd = load(c, LANES * n), load(c, LANES * (n - 1))
    for k in range(n - 2, 0, -2):
        even = add_product(load(c, LANES * k), even, square)
        odd = add_product(load(c, LANES * (k - 1)), odd, square)
    way = add_product(odd, even, s) * s
    store(at, 0, way + load(c, 0))
    store(at, LANES, way)


@inlined
def curvatures(c: Array, n: int, s: float, size: Array) -> None:
    """Write the lanes' sums of |c_k| s^k over k >= 2 to `size`."""
    square = s * s
    even, odd = sizes(load(c, LANES * n)), sizes(load(c, LANES * (n - 1)))
    for k in range(n - 2, 2, -2):
        even = add_product(sizes(load(c, LANES * k)), even, square)
        odd = add_product(sizes(load(c, LANES * (k - 1))), odd, square)
    even = add_product(sizes(load(c, 2 * LANES)), even, square)
    store(size, 0, (even + s * odd) * square)


@inlined
def lane_range(c: Array, size: Array, lane: int, s: float, end: float) -> tuple[float, float]:
    """Ends (low, high) at s of two lines from c_0 at 0, between which a lane stays in (0, s].

    With `end` = f(s) and size = sum of |c_k| s^k over k >= 2, the terms of one sign beyond the linear one lie between 0
    and half of their signed and absolute sums: f stays between the lines from c_0 to `low` and to `high`.
    """
    begin, curved = c[lane], size[lane]
    line = begin + s * c[LANES + lane]
    middle, width = 0.5 * (line + end), 0.5 * curved + NOISE * (abs(begin) + abs(line) + curved)
    return middle - width, middle + width


@inlined
def lane_bounds(c: Array, size: Array, lane: int, s: float, end: float) -> tuple[float, float]:
    """The least and the largest value that a lane may have in [0, s], by its range."""
    low, high = lane_range(c, size, lane, s, end)
    return min(c[lane], low), max(c[lane], high)


@inlined
def invert_time(c: Array, at: Array, step: Step, tau: float, high: float, total: float) -> float:
    """The s / unit in [0, high] at which the time since the begin of a step is tau; `total` is the time at high.

    dt = 2 G ds with G = w_l w_r of the sides in contact. Halley's iteration with bisection: its error is cubed each
    time, or squared where u' is little more than rounding, so LAST_CORRECTION tells the last one. It starts from the
    parabola through both ends. `at` (2 LANES,) is scratch.
    """
    n, unit = step.order.number, step.unit
    slope = c[LANES + Lane.TIME]
    bend = (total - slope * high) / (high * high)
    s = 2.0 * tau / (slope + math.sqrt(max(slope * slope + 4.0 * bend * tau, 0.0)))
    low = 0.0
    if not low < s < high:
        s = 0.5 * high
    for _ in range(200):
        values(c, n, s, at)
        w_l, d_l = (at[Z.L], at[V.L] - at[V.O]) if step.left else (1.0, 0.0)
        w_r, d_r = (at[Z.R], at[V.O] - at[V.R]) if step.right else (1.0, 0.0)
        rest = at[Lane.TIME] - tau
        if rest > 0.0:
            high = s
        else:
            low = s
        g, turn = w_l * w_r, w_r * w_r * d_l + w_l * w_l * d_r
        twice = 2.0 * g
        newton = rest / (unit * twice)
        bend = newton * unit * turn / twice  # large where w has a root near
        following = s - newton / (1.0 - bend)
        if not low <= following <= high:
            following = 0.5 * (low + high)
        elif abs(following - s) <= LAST_CORRECTION * s and abs(bend) <= LAST_CORRECTION:
            return following
        if high - low <= BRACKET * high:
            return following
        s = following
    return s


@kernel
def product(first: Array, second: Array, out: Array, n: int) -> None:
    """Cauchy product of two series up to the order n; `out` is neither of them.

    The terms of a coefficient are added in their order, but those of the others in between: no sum waits for the last.
    """
    for k in range(n + 1):
        out[k] = 0.0
    for j in range(n + 1):
        factor = first[j]
        for k in range(n + 1 - j):
            out[j + k] += factor * second[k]

"""Quantities of a step: a range that is cheap, and the extremes where they matter.

They are polynomials, and `roots.first_rise` finds every root of their rates. No extreme lies between points of a grid,
because there is none.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.flight_extremes import in_flight, state_of, weights
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, rate_lanes
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.records import Array, Integers
from grasp_ros.exact.roots import first_rise, shift
from grasp_ros.exact.sight import Quantity, Sight
from grasp_ros.physics.layout import (
    DISSIPATION,
    HERTZIAN,
    LANES,
    LEFT,
    RIGHT,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Z_L,
    Body,
    Pair,
    Segment,
)

MOST = 64  # turns of a polynomial in one step
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
NARROWINGS = 40
PARTS = 16
ROW, RATE, WORK, SQUARE = (np.int64(row) for row in range(4))  # rows of scratch; typed, or each is compiled anew
FIRST = np.int64(0)  # coefficient


@inlined
def lane_bounds(sight: Sight, lane: int, at: float) -> tuple[float, float]:
    """Bounds of a lane in a Taylor step that ends at the value `at`, see `polynomial.lane_range`."""
    begin, size = sight.c[lane], sight.size[lane]
    line = begin + sight.s * sight.c[LANES + lane]
    middle, width = 0.5 * (line + at), 0.5 * size
    return min(begin, middle - width), max(begin, middle + width)


@inlined
def penetration_bounds(sight: Sight, side: Body) -> tuple[float, float]:
    """Bounds of u."""
    u = sight.y[U_L + side]
    if sight.mode[side] != Pair.CONTACT:
        return lane_bounds(sight, Z_L + side, u)
    low, high = lane_bounds(sight, Z_L + side, math.sqrt(max(u, 0.0)))
    return max(low, 0.0) * max(low, 0.0), high * high


@inlined
def step_ranges(sight: Sight, low: Array, high: Array) -> None:
    """Bounds on all quantities but the inputs in a Taylor step."""
    for lane in (V_L, X_O, V_O, V_R):
        low[lane], high[lane] = lane_bounds(sight, lane, sight.y[lane])
    low[U_L], high[U_L] = penetration_bounds(sight, LEFT)
    low[U_R], high[U_R] = penetration_bounds(sight, RIGHT)
    low[X_L], high[X_L] = low[X_O] + low[U_L], high[X_O] + high[U_L]
    low[X_R], high[X_R] = low[X_O] - high[U_R], high[X_O] - low[U_R]
    for side in (LEFT, RIGHT):
        q, force = Quantity.IMPACT_L + side, 0.0
        if sight.mode[side] == Pair.CONTACT:
            front, back = rate_lanes(side)
            factor = damping_factor(sight.pairs[side, DISSIPATION], high[front] - low[back])
            force = elastic_force(sight.pairs[side, HERTZIAN], high[U_L + side]) * max(factor, 0.0)
        low[q], high[q] = 0.0, force


@kernel
def multiply(rows: Array, a: int, b: int, out: int, n: int) -> None:
    """Cauchy product of two rows up to the order n."""
    for k in range(n + 1):
        total = 0.0
        for j in range(k + 1):
            total += rows[a, j] * rows[b, k - j]
        rows[out, k] = total


@kernel
def copy_lane(sight: Sight, lane: int, row: int) -> None:
    """A lane as one polynomial."""
    for k in range(sight.degree + 1):
        sight.rows[row, k] = sight.c[LANES * k + lane]


@kernel
def expand_penetration(sight: Sight, side: Body, row: int) -> None:
    """Series of u, the square of w in a Taylor step."""
    copy_lane(sight, np.int64(Z_L + side), row)
    if sight.kind == Segment.CONTACT and sight.mode[side] == Pair.CONTACT:
        copy_lane(sight, np.int64(Z_L + side), WORK)
        multiply(sight.rows, WORK, WORK, row, sight.degree)


@kernel
def expand_force(sight: Sight, side: Body) -> None:
    """Series of the impact force H w^3 (1 + p u') in a Taylor step, in the first row of scratch."""
    rows, n, pair = sight.rows, sight.degree, sight.pairs[side]
    front, back = rate_lanes(side)
    expand_penetration(sight, side, RATE)
    multiply(rows, RATE, WORK, SQUARE, n)
    for k in range(n + 1):
        rows[WORK, k] = pair[DISSIPATION] * (sight.c[LANES * k + front] - sight.c[LANES * k + back])
    rows[WORK, FIRST] += 1.0
    multiply(rows, SQUARE, WORK, ROW, n)
    for k in range(n + 1):
        rows[ROW, k] *= pair[HERTZIAN]


@kernel
def expand_quantity(sight: Sight, q: int) -> None:
    """Write the series of a quantity to the first row of scratch."""
    rows, n = sight.rows, sight.degree
    if q in (U_L, U_R):
        expand_penetration(sight, LEFT if q == U_L else RIGHT, ROW)
    elif q == Quantity.IMPACT_L or q == Quantity.IMPACT_R:
        expand_force(sight, LEFT if q == Quantity.IMPACT_L else RIGHT)
    elif q in (V_L, X_O, V_O, V_R):
        copy_lane(sight, q, ROW)
    else:
        a, b, c = weights(sight, q)
        place, lane = state_of(q)
        sign = 1.0 if place == X_L else -1.0
        expand_penetration(sight, LEFT if place == X_L else RIGHT, ROW)
        for k in range(n + 1):
            x = sight.c[LANES * k + X_O] + sign * rows[ROW, k]
            rows[ROW, k] = a * x + b * sight.c[LANES * k + lane]
        rows[ROW, FIRST] += c


@kernel
def value_of(row: Array, n: int, s: float) -> float:
    """One polynomial at s."""
    value = row[n]
    for k in range(n - 1, -1, -1):
        value = value * s + row[k]
    return value


@kernel
def polynomial_extremes(rows: Array, n: int, s: float, counts: Integers) -> tuple[float, float]:
    """Least and largest value in [0, s] of the polynomial of the first row; the others are scratch."""
    row, rate, work = rows[ROW], rows[RATE], rows[WORK]
    low = high = row[0]
    turn, known = -1.0, False
    for k in range(n):
        rate[k] = (k + 1) * row[k + 1]
        if not known and rate[k] != 0.0:
            known, turn = True, -1.0 if rate[k] > 0.0 else 1.0
    begin = 0.0
    for _ in range(MOST):
        for k in range(n):
            work[k] = turn * rate[k]
        if begin > 0.0:
            shift(work, n - 1, begin)
        following = begin + first_rise(work, n - 1, s - begin, 0.0, counts)
        if not following < s:
            break
        begin, turn = following, -turn
        value = value_of(row, n, begin)
        low, high = min(low, value), max(high, value)
    value = value_of(row, n, s)
    return min(low, value), max(high, value)


@kernel
def force_at(sight: Sight, side: Body, s: float, at: Array) -> float:
    """Impact force at a place of a `START` or `CREEP`, whose lanes hold u."""
    values(sight.c, sight.degree, s, at)
    pair, u = sight.pairs[side], max(at[U_L + side], 0.0)
    return elastic_force(pair[HERTZIAN], u) * max(damping_factor(pair[DISSIPATION], approach(at, side)), 0.0)


@kernel
def peak_force(sight: Sight, side: Body) -> float:
    """Largest impact force of a `START` or `CREEP`, which has one peak: the best part of the segment, narrowed down."""
    at, best, peak = sight.rows[WORK], 0, 0.0
    for i in range(PARTS + 1):
        force = force_at(sight, side, sight.s * i / PARTS, at)
        if force > peak:
            best, peak = i, force
    low, high = sight.s * max(best - 1, 0) / PARTS, sight.s * min(best + 1, PARTS) / PARTS
    for _ in range(NARROWINGS):
        a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        at_a, at_b = force_at(sight, side, a, at), force_at(sight, side, b, at)
        peak = max(peak, at_a, at_b)
        low, high = (low, b) if at_a > at_b else (a, high)
    return peak


@inlined
def in_step(sight: Sight, q: int) -> tuple[float, float]:
    """Least and largest value of a quantity in a step."""
    if sight.kind != Segment.CONTACT and (q == Quantity.IMPACT_L or q == Quantity.IMPACT_R):
        side = LEFT if q == Quantity.IMPACT_L else RIGHT
        return 0.0, peak_force(sight, side) if sight.mode[side] == Pair.CONTACT else 0.0
    expand_quantity(sight, q)
    return polynomial_extremes(sight.rows, sight.degree, sight.s, sight.counts)


@kernel
def extremes_of(sight: Sight, q: int) -> tuple[float, float]:
    """Least and largest value of a quantity in a segment."""
    return in_flight(sight, q) if sight.kind == Segment.FLIGHT else in_step(sight, q)

"""Quantities of a step: a range that is cheap, and the extremes where they matter.

They are polynomials, and `roots.first_rise` finds every root of their rates. No extreme lies between points of a grid,
because there is none.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel, whole
from grasp_ros.exact.contact.series import expand_force
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.kinematics import rate_lanes
from grasp_ros.exact.numerics.polynomial import lane_range, product
from grasp_ros.exact.numerics.roots import first_rise, shift, value_and_rate
from grasp_ros.exact.records import Array, Integers
from grasp_ros.observe.flight_extremes import in_flight, owner, weights
from grasp_ros.observe.record import Quantity, SegmentRecord
from grasp_ros.physics.layout import LANES, LEFT, RIGHT, Body, Kind, Law, Pair, U, V, X, Z

MOST = 64  # turns of a polynomial in one step
ROW, RATE, WORK = (whole(row) for row in range(3))  # rows of scratch; typed, or each is compiled anew
FIRST = whole(0)  # coefficient


@inlined
def lane_bounds(segment: SegmentRecord, lane: int, at: float) -> tuple[float, float]:
    """Bounds of a lane in a Taylor step that ends at the value `at`."""
    low, high = lane_range(segment.m.c, segment.m.size, lane, segment.s, at)
    return min(segment.m.c[lane], low), max(segment.m.c[lane], high)


@inlined
def penetration_bounds(segment: SegmentRecord, side: Body) -> tuple[float, float]:
    """Bounds of u."""
    u = segment.m.y[U.L + side]
    if segment.m.mode[side] != Pair.CONTACT:
        return lane_bounds(segment, Z.L + side, u)
    low, high = lane_bounds(segment, Z.L + side, math.sqrt(max(u, 0.0)))
    return max(low, 0.0) * max(low, 0.0), high * high


@inlined
def step_ranges(segment: SegmentRecord, low: Array, high: Array) -> None:
    """Bounds on all quantities but the inputs in a Taylor step."""
    low[X.O], high[X.O] = lane_bounds(segment, X.O, segment.m.y[X.O])
    for lane in (V.L, V.O, V.R):
        low[lane], high[lane] = lane_bounds(segment, lane, segment.m.y[lane])
    low[U.L], high[U.L] = penetration_bounds(segment, LEFT)
    low[U.R], high[U.R] = penetration_bounds(segment, RIGHT)
    low[X.L], high[X.L] = low[X.O] + low[U.L], high[X.O] + high[U.L]
    low[X.R], high[X.R] = low[X.O] - high[U.R], high[X.O] - low[U.R]
    for side in (LEFT, RIGHT):
        q, force = Quantity.IMPACT_L + side, 0.0
        if segment.m.mode[side] == Pair.CONTACT:
            front, back = rate_lanes(side)
            factor = damping_factor(segment.m.pairs[side, Law.DISSIPATION], high[front] - low[back])
            force = elastic_force(segment.m.pairs[side, Law.HERTZIAN], high[U.L + side]) * max(factor, 0.0)
        low[q], high[q] = 0.0, force


@kernel
def copy_lane(segment: SegmentRecord, lane: int, row: int) -> None:
    """A lane as one polynomial."""
    for k in range(segment.degree + 1):
        segment.m.rows[row, k] = segment.m.c[LANES * k + lane]


@kernel
def expand_penetration(segment: SegmentRecord, side: Body, row: int) -> None:
    """Series of u, the square of w in a Taylor step."""
    copy_lane(segment, int(Z.L + side), row)
    if segment.m.mode[side] == Pair.CONTACT:
        copy_lane(segment, int(Z.L + side), WORK)
        product(segment.m.rows[WORK], segment.m.rows[WORK], segment.m.rows[row], segment.degree)


@kernel
def expand_quantity(segment: SegmentRecord, q: int) -> None:
    """Write the series of a quantity to the first row of scratch."""
    rows, n = segment.m.rows, segment.degree
    if q in (U.L, U.R):
        expand_penetration(segment, LEFT if q == U.L else RIGHT, ROW)
    elif q == Quantity.IMPACT_L or q == Quantity.IMPACT_R:
        expand_force(segment.m.c, segment.m.pairs, q - Quantity.IMPACT_L, n, rows.reshape(-1))
    elif q == X.O or q == V.L or q == V.O or q == V.R:
        copy_lane(segment, q, ROW)
    else:
        (a, b, c), side = weights(segment, q), owner(q)
        sign, lane = 1.0 if side == LEFT else -1.0, velocity_lane(side)
        expand_penetration(segment, side, ROW)
        for k in range(n + 1):
            x = segment.m.c[LANES * k + X.O] + sign * rows[ROW, k]
            rows[ROW, k] = a * x + b * segment.m.c[LANES * k + lane]
        rows[ROW, FIRST] += c


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
        value = value_and_rate(row, n, begin)[0]
        low, high = min(low, value), max(high, value)
    value = value_and_rate(row, n, s)[0]
    return min(low, value), max(high, value)


@kernel
def extremes_of(segment: SegmentRecord, q: int) -> tuple[float, float]:
    """Least and largest value of a quantity in a segment."""
    if segment.kind == Kind.FLIGHT:
        return in_flight(segment, q)
    expand_quantity(segment, q)
    return polynomial_extremes(segment.m.rows, segment.degree, segment.s, segment.m.counts)

"""What can be said of each quantity within a segment: a range that is cheap, and its extremes where they matter.

Within a flight a quantity a x + b v + c solves the equation of its body: the roots of its rate have a closed form.
Within a step it is a polynomial, and `roots.first_rise` finds every root of its rate. No extreme lies between points
of a grid, because there is none.
"""

from __future__ import annotations

import math

import numpy as np


from grasp_ros.exact.flight import fly, launch
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, bound, next_derivative, own_acceleration, rate_lanes, velocity_lane
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.records import Array, Flight, Integers, Regime
from grasp_ros.exact.roots import first_rise, shift
from grasp_ros.exact.sight import Quantity, Sight
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LANES,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
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


# Quantities of a flight.


@inlined
def weights(sight: Sight, q: int) -> tuple[float, float, float]:
    """a, b, c of the quantity a x + b v + c."""
    if q == Quantity.INPUT_L or q == Quantity.INPUT_R:
        side = LEFT if q == Quantity.INPUT_L else RIGHT
        return -sight.gains[side, 0], -sight.gains[side, 1], sight.given[side, FORCE] - sight.own[side, FORCE]
    return (1.0, 0.0, 0.0) if q in (X_L, X_O, X_R) else (0.0, 1.0, 0.0)


@inlined
def state_of(q: int) -> tuple[int, int]:
    """Places of position and velocity of the body whose quantity it is: the state has them in pairs."""
    if q == Quantity.INPUT_L:
        return X_L, V_L
    return (X_R, V_R) if q == Quantity.INPUT_R else (q - q % 2, q - q % 2 + 1)


@inlined
def row_of(x: int) -> int:
    """Row of the body whose position stands there."""
    return OBJECT.value if x == X_O else (LEFT.value if x == X_L else RIGHT.value)


@kernel
def first_zero(flight: Flight, r: float, r_rate: float) -> float:
    """First t > 0 at which a solution of the homogeneous equation, from (r, r'), is zero; inf if there is none."""
    sigma, rate = flight.sigma, flight.rate
    b = r_rate + sigma * r
    if flight.regime == Regime.UNDER:
        phase = math.atan2(r * rate, -b)
        return (phase if phase > 0.0 else phase + math.pi) / rate
    if flight.regime == Regime.DRIFT or rate == 0.0:
        t = -r / b if b != 0.0 else math.inf
        return t if t > 0.0 else math.inf
    part = -r * rate / b if b != 0.0 else math.inf
    return math.atanh(part) / rate if 0.0 < part < 1.0 else math.inf


@inlined
def in_flight(sight: Sight, q: int) -> tuple[float, float]:
    """Least and largest value of a quantity in a flight."""
    a, b, c = weights(sight, q)
    place, lane = state_of(q)
    row = sight.bodies[row_of(place)]
    x, v = sight.before[place], sight.before[lane]
    flight = launch(row, x, v)
    push = own_acceleration(row, x, v)
    jerk = next_derivative(row, v, push)
    at_begin, at_end = a * x + b * v + c, a * sight.y[place] + b * sight.y[lane] + c
    low, high = min(at_begin, at_end), max(at_begin, at_end)
    first = first_zero(flight, a * v + b * push, a * push + b * jerk)
    if not first < sight.t:
        return low, high
    apart = math.pi / flight.rate if flight.regime == Regime.UNDER else math.inf
    if flight.sigma < 0.0 and apart < math.inf:  # what a feedback drives is largest at the end
        first += max(math.floor((sight.t - first) / apart) - 1.0, 0.0) * apart
    for _ in range(2):
        if first < sight.t:
            x, v, _ = fly(flight, first)
            low, high = min(low, a * x + b * v + c), max(high, a * x + b * v + c)
        first += apart
    return low, high


@inlined
def flight_ranges(sight: Sight, low: Array, high: Array) -> None:
    """Bounds on positions and velocities in a flight, by the energy of the swing."""
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = sight.bodies[body], velocity_lane(body)
        x, v, at, rate = sight.before[lane - 1], sight.before[lane], sight.y[lane - 1], sight.y[lane]
        if row[STIFFNESS] > 0.0 and row[MASS] < math.inf:
            push = own_acceleration(row, x, v)
            x_e = x + (row[MASS] * push + row[DAMPING] * v) / row[STIFFNESS]
            swing, speed = bound(row, x - x_e, v, sight.t), bound(row, v, push, sight.t)
            low[lane - 1], high[lane - 1], low[lane], high[lane] = x_e - swing, x_e + swing, -speed, speed
        else:
            way = sight.t * max(abs(v), abs(rate)) if (v > 0.0) != (rate > 0.0) else 0.0
            low[lane - 1], high[lane - 1] = min(x, at) - way, max(x, at) + way
            low[lane], high[lane] = min(v, rate), max(v, rate)
    for lane in (U_L, U_R):
        low[lane], high[lane] = min(sight.before[lane], sight.y[lane]), max(sight.before[lane], sight.y[lane])
    low[Quantity.IMPACT_L] = high[Quantity.IMPACT_L] = low[Quantity.IMPACT_R] = high[Quantity.IMPACT_R] = 0.0


# Quantities of a step.


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
    rows[WORK, 0] += 1.0
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
        rows[ROW, 0] += c


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

"""Quantities of a segment: a range that is cheap, and the extremes where they matter.

In a flight a quantity a x + b v + c solves the equation of its body, so that the roots of its rate have a closed form.
In a step quantities are polynomials, and `roots.first_rise` finds every root of their rates. No grid is used, between
whose points an extreme could lie.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel, whole
from grasp_ros.exact.contact.series import expand_force
from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.kinematics import bound_by, next_derivative, own_acceleration, rate_lanes, rates_of
from grasp_ros.exact.numerics.polynomial import lane_bounds, product
from grasp_ros.exact.numerics.roots import first_rise, shift, value_and_rate
from grasp_ros.exact.records import Array, Flight, Integers, Regime
from grasp_ros.observe.record import LOWER, POSITION, QUANTITIES, UPPER, VELOCITY, Quantity, Seen, SegmentRecord, Wanted
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Law, Of, Pair, U, V, X, Z

MOST = 64  # turns of a polynomial in one step
ROW, RATE, WORK = (whole(row) for row in range(3))  # rows of scratch; typed, or each is compiled anew
FIRST = whole(0)  # coefficient


@inlined
def weights(segment: SegmentRecord, q: int) -> tuple[float, float, float]:
    """a, b, c of the quantity a x + b v + c."""
    if q == Quantity.INPUT_L or q == Quantity.INPUT_R:
        side = LEFT if q == Quantity.INPUT_L else RIGHT
        gains, constant = segment.m.gains[side], segment.m.given[side, Of.FORCE] - segment.m.own[side, Of.FORCE]
        return -gains[POSITION], -gains[VELOCITY], constant
    return (1.0, 0.0, 0.0) if q in (X.L, X.O, X.R) else (0.0, 1.0, 0.0)


@inlined
def owner(q: int) -> Body:
    """The body whose quantity it is."""
    if q == X.L or q == V.L or q == Quantity.INPUT_L:
        return LEFT
    return RIGHT if q == X.R or q == V.R or q == Quantity.INPUT_R else OBJECT


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
def in_flight(segment: SegmentRecord, q: int) -> tuple[float, float]:
    """Least and largest value of a quantity in a flight."""
    (a, b, c), body = weights(segment, q), owner(q)
    row, lane = segment.m.bodies[body], velocity_lane(body)
    x, v = segment.m.before[lane - 1], segment.m.before[lane]
    flight = launch(row, x, v)
    push = own_acceleration(row, x, v)
    jerk = next_derivative(row, v, push)
    at_begin, at_end = a * x + b * v + c, a * segment.m.y[lane - 1] + b * segment.m.y[lane] + c
    low, high = min(at_begin, at_end), max(at_begin, at_end)
    first = first_zero(flight, a * v + b * push, a * push + b * jerk)
    if not first < segment.t:
        return low, high
    apart = math.pi / flight.rate if flight.regime == Regime.UNDER else math.inf
    if flight.sigma < 0.0 and apart < math.inf:  # what a feedback drives is largest at the end
        first += max(math.floor((segment.t - first) / apart) - 1.0, 0.0) * apart
    for _ in range(2):
        if first < segment.t:
            x, v, _, _ = fly(flight, first)
            low, high = min(low, a * x + b * v + c), max(high, a * x + b * v + c)
        first += apart
    return low, high


@inlined
def bounds_in_step(segment: SegmentRecord, lane: int, at: float) -> tuple[float, float]:
    """Bounds of a lane in a Taylor step that ends at the value `at`."""
    return lane_bounds(segment.m.c, segment.m.size, lane, segment.s, at)


@inlined
def flight_ranges(segment: SegmentRecord, low: Array, high: Array) -> None:
    """Bounds on positions and velocities in a flight, by the energy of the swing."""
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = segment.m.bodies[body], velocity_lane(body)
        x, v, at, rate = segment.m.before[lane - 1], segment.m.before[lane], segment.m.y[lane - 1], segment.m.y[lane]
        if row[Of.STIFFNESS] > 0.0 and row[Of.MASS] < math.inf:
            push, rates = own_acceleration(row, x, v), rates_of(row)
            x_e = x + (row[Of.MASS] * push + row[Of.DAMPING] * v) / row[Of.STIFFNESS]
            swing, speed = bound_by(rates, x - x_e, v, segment.t), bound_by(rates, v, push, segment.t)
            low[lane - 1], high[lane - 1], low[lane], high[lane] = x_e - swing, x_e + swing, -speed, speed
        else:
            way = segment.t * max(abs(v), abs(rate)) if (v > 0.0) != (rate > 0.0) else 0.0
            low[lane - 1], high[lane - 1] = min(x, at) - way, max(x, at) + way
            low[lane], high[lane] = min(v, rate), max(v, rate)


@inlined
def step_ranges(segment: SegmentRecord, low: Array, high: Array) -> None:
    """Bounds on all quantities but the inputs in a Taylor step; those of an impact only while there is one."""
    low[X.O], high[X.O] = bounds_in_step(segment, X.O, segment.m.y[X.O])
    for lane in (V.L, V.O, V.R):
        low[lane], high[lane] = bounds_in_step(segment, lane, segment.m.y[lane])
    for side in (LEFT, RIGHT):
        u, touches = segment.m.y[U.L + side], segment.m.mode[side] == Pair.CONTACT
        least, most = bounds_in_step(segment, Z.L + side, math.sqrt(max(u, 0.0)) if touches else u)
        low[U.L + side], high[U.L + side] = least, most
        if touches:  # w = sqrt(u)
            low[U.L + side], high[U.L + side] = max(least, 0.0) * max(least, 0.0), most * most
            (front, back), q = rate_lanes(side), Quantity.IMPACT_L + side
            factor = damping_factor(segment.m.pairs[side, Law.DISSIPATION], high[front] - low[back])
            force = elastic_force(segment.m.pairs[side, Law.HERTZIAN], high[U.L + side])
            low[q], high[q] = 0.0, force * max(factor, 0.0)
    low[X.L], high[X.L] = low[X.O] + low[U.L], high[X.O] + high[U.L]
    low[X.R], high[X.R] = low[X.O] - high[U.R], high[X.O] - low[U.R]


@inlined
def write_ranges(segment: SegmentRecord) -> None:
    """Write bounds of the quantities to scratch."""
    low, high = segment.m.rows[LOWER], segment.m.rows[UPPER]
    if segment.kind == Kind.FLIGHT:
        flight_ranges(segment, low, high)
    else:
        step_ranges(segment, low, high)
    for q in range(Quantity.INPUT_L, QUANTITIES):
        a, b, c = weights(segment, q)
        v = velocity_lane(owner(q))
        x = v - 1
        low[q] = c + min(a * low[x], a * high[x]) + min(b * low[v], b * high[v])
        high[q] = c + max(a * low[x], a * high[x]) + max(b * low[v], b * high[v])


@inlined
def may_exceed(segment: SegmentRecord, q: int, low: float, high: float) -> bool:
    """Whether a quantity may leave [low, high] in a segment; the ranges stand in scratch."""
    return bool(segment.m.rows[LOWER, q] < low or segment.m.rows[UPPER, q] > high)


@kernel
def copy_lane(segment: SegmentRecord, lane: int, row: int) -> None:
    """A lane as one polynomial."""
    for k in range(segment.degree + 1):
        segment.m.rows[row, k] = segment.m.c[LANES * k + lane]


@kernel
def expand_penetration(segment: SegmentRecord, side: Body) -> None:
    """Series of u, the square of w in a Taylor step."""
    touches = segment.m.mode[side] == Pair.CONTACT
    copy_lane(segment, int(Z.L + side), WORK if touches else ROW)
    if touches:
        product(segment.m.rows[WORK], segment.m.rows[WORK], segment.m.rows[ROW], segment.degree)


@kernel
def expand_quantity(segment: SegmentRecord, q: int) -> None:
    """Write the series of a quantity to the first row of scratch."""
    rows, n = segment.m.rows, segment.degree
    if q in (U.L, U.R):
        expand_penetration(segment, LEFT if q == U.L else RIGHT)
    elif q == Quantity.IMPACT_L or q == Quantity.IMPACT_R:
        expand_force(segment.m.c, segment.m.pairs, q - Quantity.IMPACT_L, n, rows.reshape(-1))
    elif q == X.O or q == V.L or q == V.O or q == V.R:
        copy_lane(segment, q, ROW)
    else:
        (a, b, c), side = weights(segment, q), owner(q)
        sign, lane = 1.0 if side == LEFT else -1.0, velocity_lane(side)
        expand_penetration(segment, side)
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


@inlined
def is_wanted(segment: SegmentRecord, q: int, wanted: int) -> bool:
    """Whether the extremes of a quantity are kept; those of an impact only while there is one."""
    if q < U.L:
        return wanted & Wanted.MOTION.value != 0
    if q >= Quantity.INPUT_L:
        return wanted & Wanted.INPUTS.value != 0
    return wanted & Wanted.IMPACTS.value != 0 and segment.m.mode[q % 2] == Pair.CONTACT


@inlined
def keep(seen: Array, q: int, low: float, high: float) -> None:
    """Keep the least and the largest value of a quantity."""
    seen[Seen.LOW + q] = min(seen[Seen.LOW + q], low)
    seen[Seen.HIGH + q] = max(seen[Seen.HIGH + q], high)


@inlined
def watch_extremes(segment: SegmentRecord, seen: Array, wanted: int) -> None:
    """Keep the extremes of what is wanted, where its range may hold new ones; the ranges stand in scratch."""
    for q in range(QUANTITIES):
        if is_wanted(segment, q, wanted) and may_exceed(segment, q, seen[Seen.LOW + q], seen[Seen.HIGH + q]):
            keep(seen, q, *extremes_of(segment, q))


@kernel
def watch_rest(segment: SegmentRecord, seen: Array, wanted: int) -> None:
    """Keep the extremes where nothing moves: a run may begin so, and under other inputs than before."""
    y, pairs = segment.m.y, segment.m.pairs
    for q in range(QUANTITIES):
        if is_wanted(segment, q, wanted):
            if q < Quantity.IMPACT_L:
                value = y[q]
            elif q < Quantity.INPUT_L:
                value = elastic_force(pairs[q % 2, Law.HERTZIAN], y[U.L + q % 2])
            else:
                (a, b, c), lane = weights(segment, q), velocity_lane(owner(q))
                value = a * y[lane - 1] + b * y[lane] + c
            keep(seen, q, value, value)

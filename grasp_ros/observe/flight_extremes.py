"""Quantities of a flight: a range that is cheap, and the extremes where they matter.

A quantity a x + b v + c solves the equation of its body, so that the roots of its rate have a closed form.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.kinematics import bound, next_derivative, own_acceleration
from grasp_ros.exact.records import Array, Flight, Regime
from grasp_ros.observe.record import POSITION, VELOCITY, Quantity, SegmentRecord
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Of, U, V, X


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
def flight_ranges(segment: SegmentRecord, low: Array, high: Array) -> None:
    """Bounds on positions and velocities in a flight, by the energy of the swing."""
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = segment.m.bodies[body], velocity_lane(body)
        x, v, at, rate = segment.m.before[lane - 1], segment.m.before[lane], segment.m.y[lane - 1], segment.m.y[lane]
        if row[Of.STIFFNESS] > 0.0 and row[Of.MASS] < math.inf:
            push = own_acceleration(row, x, v)
            x_e = x + (row[Of.MASS] * push + row[Of.DAMPING] * v) / row[Of.STIFFNESS]
            swing, speed = bound(row, x - x_e, v, segment.t), bound(row, v, push, segment.t)
            low[lane - 1], high[lane - 1], low[lane], high[lane] = x_e - swing, x_e + swing, -speed, speed
        else:
            way = segment.t * max(abs(v), abs(rate)) if (v > 0.0) != (rate > 0.0) else 0.0
            low[lane - 1], high[lane - 1] = min(x, at) - way, max(x, at) + way
            low[lane], high[lane] = min(v, rate), max(v, rate)
    for lane in (U.L, U.R):
        u, u_end = segment.m.before[lane], segment.m.y[lane]
        low[lane], high[lane] = min(u, u_end), max(u, u_end)
    low[Quantity.IMPACT_L] = high[Quantity.IMPACT_L] = low[Quantity.IMPACT_R] = high[Quantity.IMPACT_R] = 0.0

"""The last time at which each body was outside a bound, and when all have settled, which V_c proves."""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.driver.rest import SINCE
from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.kinematics import own_acceleration
from grasp_ros.exact.numerics.roots import first_rise, shift, value_and_rate
from grasp_ros.exact.records import Array, Regime
from grasp_ros.observe.extremes import FIRST, ROW, WORK, expand_quantity, extremes_of, first_zero, may_exceed
from grasp_ros.observe.record import UNDECIDED, Memory, Seen, SegmentRecord
from grasp_ros.physics import lyapunov
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, Law, Of, Slide

BISECTIONS = 60
reach = kernel(lyapunov.reach)


@kernel
def settled_from(m: Memory, V_c: float) -> float:
    """The time in s from which on no body leaves the bound for good; inf: it never comes; see `Seen.SETTLED`.

    V_c never rises: once its level holds every body inside, nothing that follows leaves the bound. What loses no energy
    comes back to near its start (Poincare) and never settles.
    """
    left, middle, right, _, _ = reach(m.loop, m.pairs, V_c)
    most, bound = max(left, middle, right), m.seen[Seen.BOUND]
    if not (most < math.inf and bound > 0.0):
        return math.nan
    if most <= bound or m.rest[SINCE] < math.inf:
        return max(m.seen[Seen.OUTSIDE + LEFT], m.seen[Seen.OUTSIDE + OBJECT], m.seen[Seen.OUTSIDE + RIGHT])
    loss = m.loop[LEFT, Of.DAMPING] + m.loop[OBJECT, Of.DAMPING] + m.loop[RIGHT, Of.DAMPING]
    loss += m.pairs[LEFT, Law.DISSIPATION] + m.pairs[RIGHT, Law.DISSIPATION]
    return UNDECIDED if loss > 0.0 or m.mode[OBJECT] != Slide.FREE else math.inf


@inlined
def watch_bound(segment: SegmentRecord, seen: Array, now: float) -> None:
    """Remember when each body was outside last."""
    bound = seen[Seen.BOUND]
    for body in (LEFT, OBJECT, RIGHT):
        x = int(velocity_lane(body) - 1)
        if abs(segment.m.y[x]) > bound:
            seen[Seen.OUTSIDE + body] = math.inf
            continue
        low, high = extremes_of(segment, x) if may_exceed(segment, x, -bound, bound) else (0.0, 0.0)
        if max(abs(segment.m.before[x]), -low, high) > bound:
            last = (last_in_flight(segment, body, bound) if segment.kind == Kind.FLIGHT
                    else last_in_step(segment, x, bound))
            seen[Seen.OUTSIDE + body] = (now - segment.t) + last


@kernel
def last_in_flight(segment: SegmentRecord, body: Body, bound: float) -> float:
    """Time since the begin of a flight, which ends inside, at which a body comes inside, s; 0: it never is outside."""
    row, lane = segment.m.bodies[body], velocity_lane(body)
    x, v = segment.m.before[lane - 1], segment.m.before[lane]
    flight = launch(row, x, v)
    low, high = 0.0, segment.t
    turn = first_zero(flight, v, own_acceleration(row, x, v))
    if turn < high:
        apart = math.pi / flight.rate if flight.regime == Regime.UNDER else math.inf
        turns = math.floor((high - turn) / apart) if apart < math.inf else 0.0
        while turns >= 0.0:  # the last turn outside begins the way inside
            low = turn + (turns * apart if turns > 0.0 else 0.0)
            if abs(fly(flight, low)[0]) > bound:
                break
            high, turns = low, turns - 1.0
            low = 0.0
    if low == 0.0 and abs(x) <= bound:
        return 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if abs(fly(flight, middle)[0]) > bound:
            low = middle
        else:
            high = middle
    return high


@kernel
def last_in_step(segment: SegmentRecord, q: int, bound: float) -> float:
    """The same for a position in a step: the first time outside, on the way back from the end."""
    rows, n = segment.m.rows, segment.degree
    expand_quantity(segment, q)
    shift(rows[ROW], n, segment.s)
    first = math.inf
    for sign in (1.0, -1.0):
        for k in range(n + 1):
            rows[WORK, k] = sign * rows[ROW, k] * (1.0 if k % 2 == 0 else -1.0)
        rows[WORK, FIRST] -= bound
        first = min(first, first_rise(rows[WORK], n, segment.s, 0.0, segment.m.counts))
    if not first < math.inf:
        return 0.0
    return value_and_rate(segment.m.c[Lane.TIME :: LANES], n, segment.s - first)[0]

"""The last time at which a body was outside a bound.

Only the last segment that leaves the bound matters, so it is kept as it is, and searched when the run is over.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import allocating, inlined, kernel
from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.kinematics import own_acceleration
from grasp_ros.exact.numerics.roots import first_rise, shift, value_and_rate
from grasp_ros.exact.records import Array, Regime
from grasp_ros.observe.flight_extremes import first_zero
from grasp_ros.observe.sight import COUNTS, LOWER, MODES, NONE, STATES, UPPER, Seen, Sight
from grasp_ros.observe.step_extremes import FIRST, ROW, SQUARE, WORK, expand_quantity, extremes_of
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, U, X

BISECTIONS = 60


@inlined
def is_outside(y: Array, bound: float) -> bool:
    """Whether a body of a state is outside."""
    return abs(y[X.L]) > bound or abs(y[X.O]) > bound or abs(y[X.R]) > bound


@kernel
def leaves(sight: Sight, bound: float) -> bool:
    """Whether a body leaves the bound within a segment; the ranges stand in scratch."""
    for q in range(X.L, U.L, 2):
        if sight.rows[LOWER, q] < -bound or sight.rows[UPPER, q] > bound:
            low, high = extremes_of(sight, q)
            if low < -bound or high > bound:
                return True
    return False


@kernel
def watch_bound(sight: Sight, seen: Array, kept: Array, now: float) -> None:
    """Remember when a body was outside, or the segment in which it was."""
    bound = seen[Seen.BOUND]
    seen[Seen.INSIDE] = 1.0
    if is_outside(sight.y, bound):
        seen[Seen.OUTSIDE], seen[Seen.KEPT], seen[Seen.INSIDE] = now, NONE, 0.0
    elif is_outside(sight.before, bound) or leaves(sight, bound):
        seen[Seen.KEPT], seen[Seen.KEPT_TIME] = float(sight.kind), sight.t
        seen[Seen.KEPT_BEGIN], seen[Seen.KEPT_STEP], seen[Seen.KEPT_DEGREE] = now - sight.t, sight.s, sight.degree
        keep(sight, kept)


@kernel
def keep(sight: Sight, kept: Array) -> None:
    """Copy all that the search needs."""
    for place in range(STATES):
        kept[place] = sight.before[place]
    for body in range(3):
        for column in range(4):
            kept[STATES + 4 * body + column] = sight.bodies[body, column]
        sight.counts[COUNTS + body] = sight.mode[body]
    if sight.kind != Kind.FLIGHT:
        for i in range(LANES * (sight.degree + 1)):
            kept[STATES + 12 + i] = sight.c[i]


@allocating
def kept_sight(sight: Sight, kept: Array) -> Sight:
    """The segment that was kept, in place of the last one."""
    return Sight(
        sight.kind, sight.t, sight.s, sight.degree, kept[STATES + 12 :], sight.size, kept[:STATES], sight.y,
        sight.counts[COUNTS : COUNTS + MODES], kept[STATES : STATES + 12].reshape((3, 4)), sight.pairs, sight.given,
        sight.own, sight.gains, sight.rows, sight.counts,
    )


@kernel
def last_outside(sight: Sight, bound: float) -> float:
    """Time since the begin of a segment, which ends inside, at which the last body comes inside, s."""
    last = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        if sight.kind == Kind.FLIGHT:
            last = max(last, last_in_flight(sight, body, bound))
        else:
            last = max(last, last_in_step(sight, int(velocity_lane(body) - 1), bound))
    return last


@kernel
def last_in_flight(sight: Sight, body: Body, bound: float) -> float:
    """The same for one body in flight; 0 if it never is outside."""
    row, lane = sight.bodies[body], velocity_lane(body)
    x, v = sight.before[lane - 1], sight.before[lane]
    flight = launch(row, x, v)
    low, high = 0.0, sight.t
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
def last_in_step(sight: Sight, q: int, bound: float) -> float:
    """The same for a position in a step: the first time outside, on the way back from the end."""
    rows, n = sight.rows, sight.degree
    expand_quantity(sight, q)
    shift(rows[ROW], n, sight.s)
    first = math.inf
    for sign in (1.0, -1.0):
        for k in range(n + 1):
            rows[WORK, k] = sign * rows[ROW, k] * (1.0 if k % 2 == 0 else -1.0)
        rows[WORK, FIRST] -= bound
        first = min(first, first_rise(rows[WORK], n, sight.s, 0.0, sight.counts))
    if not first < math.inf:
        return 0.0
    s = sight.s - first
    for k in range(n + 1):
        rows[SQUARE, k] = sight.c[LANES * k + Lane.TIME]
    return value_and_rate(rows[SQUARE], n, s)[0]

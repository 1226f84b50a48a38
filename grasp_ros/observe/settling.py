"""The last time at which each body was outside a bound.

Only the last segment in which a body leaves the bound matters, so it is kept as it is, and searched when the run is
over.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.kinematics import own_acceleration
from grasp_ros.exact.numerics.roots import first_rise, shift, value_and_rate
from grasp_ros.exact.records import Array, Regime
from grasp_ros.observe.flight_extremes import first_zero
from grasp_ros.observe.record import COUNTS, LOWER, MODES, NONE, STATES, UNDECIDED, UPPER, Kept, Seen, SegmentRecord
from grasp_ros.observe.step_extremes import FIRST, ROW, WORK, expand_quantity, extremes_of
from grasp_ros.physics import reach as bounds
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, Law, Of

BISECTIONS = 60
reach = kernel(bounds.reach)


@kernel
def settled_from(loop: Array, pairs: Array, V_c: float, at_rest: bool, seen: Array) -> float:
    """The time in s from which on no body leaves the bound for good; inf: one rests outside; see `Seen.SETTLED`.

    V_c never rises: once its level holds every body inside, nothing that follows leaves the bound.
    """
    left, middle, right, _, _ = reach(loop, pairs, V_c)
    most, bound = max(left, middle, right), seen[Seen.BOUND]
    if not (most < math.inf and bound > 0.0):
        return math.nan
    if most <= bound or at_rest:
        return max(seen[Seen.OUTSIDE + LEFT], seen[Seen.OUTSIDE + OBJECT], seen[Seen.OUTSIDE + RIGHT])
    return UNDECIDED


@kernel
def takes_energy(loop: Array, pairs: Array, coulomb: float) -> bool:
    """Whether anything takes energy; what loses none comes back to near its start (Poincare) and never settles."""
    total = coulomb
    for body in (LEFT, OBJECT, RIGHT):
        total += loop[body, Of.DAMPING]
    for side in (LEFT, RIGHT):
        total += pairs[side, Law.DISSIPATION]
    return total > 0.0


@kernel
def leaves(segment: SegmentRecord, x: int, bound: float) -> bool:
    """Whether a position leaves the bound within a segment; the ranges stand in scratch."""
    if segment.rows[LOWER, x] >= -bound and segment.rows[UPPER, x] <= bound:
        return False
    low, high = extremes_of(segment, x)
    return bool(low < -bound or high > bound)


@kernel
def watch_bound(segment: SegmentRecord, seen: Array, kept: Array, now: float) -> None:
    """Remember when each body was outside, or the segment in which it was."""
    bound = seen[Seen.BOUND]
    for body in (LEFT, OBJECT, RIGHT):
        x = int(velocity_lane(body) - 1)
        if abs(segment.y[x]) > bound:
            seen[Seen.OUTSIDE + body], kept[body, Kept.KIND] = math.inf, NONE
        elif abs(segment.before[x]) > bound or leaves(segment, x, bound):
            seen[Seen.OUTSIDE + body] = 0.0
            keep(segment, kept[body], now)


@kernel
def keep(segment: SegmentRecord, kept: Array, now: float) -> None:
    """Copy all that the search needs of a segment that has just ended."""
    kept[Kept.KIND], kept[Kept.TIME], kept[Kept.BEGIN] = float(segment.kind), segment.t, now - segment.t
    kept[Kept.STEP], kept[Kept.DEGREE] = segment.s, segment.degree
    for place in range(STATES):
        kept[Kept.STATE + place] = segment.before[place]
    for body in range(3):
        kept[Kept.MODES + body] = segment.mode[body]
        for column in range(4):
            kept[Kept.BODIES + 4 * body + column] = segment.bodies[body, column]
    if segment.kind != Kind.FLIGHT:
        for i in range(LANES * (segment.degree + 1)):
            kept[Kept.TABLE + i] = segment.c[i]


@inlined
def kept_record(segment: SegmentRecord, kept: Array) -> SegmentRecord:
    """The segment that was kept, in place of the last one."""
    for body in range(3):
        segment.counts[COUNTS + body] = int(kept[Kept.MODES + body])
    return SegmentRecord(
        int(kept[Kept.KIND]), kept[Kept.TIME], kept[Kept.STEP], int(kept[Kept.DEGREE]), kept[Kept.TABLE :],
        segment.size, kept[Kept.STATE : Kept.BODIES], segment.y, segment.counts[COUNTS : COUNTS + MODES],
        kept[Kept.BODIES : Kept.TABLE].reshape((3, 4)), segment.pairs, segment.given, segment.own, segment.gains,
        segment.rows, segment.counts,
    )


@kernel
def last_outside(segment: SegmentRecord, body: Body, bound: float) -> float:
    """Time since the begin of a segment, which ends inside, at which a body comes inside, s."""
    if segment.kind == Kind.FLIGHT:
        return last_in_flight(segment, body, bound)
    return last_in_step(segment, int(velocity_lane(body) - 1), bound)


@kernel
def last_in_flight(segment: SegmentRecord, body: Body, bound: float) -> float:
    """The same for one body in flight; 0 if it never is outside."""
    row, lane = segment.bodies[body], velocity_lane(body)
    x, v = segment.before[lane - 1], segment.before[lane]
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
    rows, n = segment.rows, segment.degree
    expand_quantity(segment, q)
    shift(rows[ROW], n, segment.s)
    first = math.inf
    for sign in (1.0, -1.0):
        for k in range(n + 1):
            rows[WORK, k] = sign * rows[ROW, k] * (1.0 if k % 2 == 0 else -1.0)
        rows[WORK, FIRST] -= bound
        first = min(first, first_rise(rows[WORK], n, segment.s, 0.0, segment.counts))
    if not first < math.inf:
        return 0.0
    return value_and_rate(segment.c[Lane.TIME :: LANES], n, segment.s - first)[0]

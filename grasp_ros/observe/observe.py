"""The observer of a run: what it remembers after each segment, and what follows at the end."""

from __future__ import annotations

import math

from numba import carray

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import allocating, inlined, kernel
from grasp_ros.exact.driver.callback import call, floats_at, integers_at
from grasp_ros.exact.driver.rest import SINCE
from grasp_ros.exact.impact import stored_energy
from grasp_ros.exact.records import Array, Integers
from grasp_ros.observe.flight_extremes import flight_ranges, state_of, weights
from grasp_ros.observe.losses import add_losses
from grasp_ros.observe.settling import kept_sight, last_outside, settled_from, watch_bound
from grasp_ros.observe.sight import (
    LOWER,
    NONE,
    QUANTITIES,
    SEEN,
    STATES,
    UPPER,
    Context,
    Kept,
    Quantity,
    Seen,
    Sight,
    Wanted,
    bodies_at,
    kept_at,
    seen_at,
    sight_of,
)
from grasp_ros.observe.step_extremes import extremes_of, step_ranges
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Kind, Law, Of, Pair, U, X

PLACES, CLOCK, RESTS = len(Context), 3, 3
BEGIN, FINISH = -2, -1  # in place of a kind of segment


@kernel
def level(loop: Array, pairs: Array, y: Array) -> float:
    """V_c of a state, J."""
    total = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = loop[body], velocity_lane(body)
        x, v = y[lane - 1], y[lane]
        total += row[Of.MASS] * v * v
        if row[Of.STIFFNESS] > 0.0:
            away = x - row[Of.FORCE] / row[Of.STIFFNESS]
            total += row[Of.STIFFNESS] * away * away
        else:
            total -= 2.0 * row[Of.FORCE] * x
    for side in (LEFT, RIGHT):
        if pairs[side, Law.HERTZIAN] > 0.0:
            total += 2.0 * stored_energy(pairs[side, Law.HERTZIAN], max(y[U.L + side], 0.0))
    return total


@kernel
def write_ranges(sight: Sight) -> None:
    """Write bounds of all quantities to scratch."""
    low, high = sight.rows[LOWER], sight.rows[UPPER]
    if sight.kind == Kind.FLIGHT:
        flight_ranges(sight, low, high)
    else:
        step_ranges(sight, low, high)
    for q in range(Quantity.INPUT_L, QUANTITIES):
        a, b, c = weights(sight, q)
        x, v = state_of(q)
        low[q] = c + min(a * low[x], a * high[x]) + min(b * low[v], b * high[v])
        high[q] = c + max(a * low[x], a * high[x]) + max(b * low[v], b * high[v])


@inlined
def is_wanted(sight: Sight, q: int, wanted: int) -> bool:
    """Whether the extremes of a quantity are kept; those of an impact only while there is one."""
    if q < U.L:
        return wanted & Wanted.MOTION.value != 0
    if q >= Quantity.INPUT_L:
        return wanted & Wanted.INPUTS.value != 0
    return wanted & Wanted.IMPACTS.value != 0 and sight.mode[q % 2] == Pair.CONTACT


@kernel
def watch_quantities(sight: Sight, seen: Array, wanted: int) -> None:
    """Keep the extremes of what is wanted, where its range may hold new ones."""
    for q in range(QUANTITIES):
        if not is_wanted(sight, q, wanted):
            continue
        if sight.rows[LOWER, q] < seen[Seen.LOW + q] or sight.rows[UPPER, q] > seen[Seen.HIGH + q]:
            low, high = extremes_of(sight, q)
            seen[Seen.LOW + q] = min(seen[Seen.LOW + q], low)
            seen[Seen.HIGH + q] = max(seen[Seen.HIGH + q], high)


@allocating
def watch_level(context: Integers, sight: Sight, seen: Array) -> None:
    """Keep the largest rise of V_c, as it is at the ends of segments."""
    seen[Seen.LEVEL] = level(bodies_at(context, Context.LOOP), sight.pairs, sight.y)
    seen[Seen.RISE] = max(seen[Seen.RISE], seen[Seen.LEVEL] - seen[Seen.LEAST])
    seen[Seen.LEAST] = min(seen[Seen.LEAST], seen[Seen.LEVEL])


@allocating
def begin(context: Integers, bound: float) -> None:
    """Forget the last run, and remember the state at which this one begins."""
    seen = seen_at(context)
    for place in range(SEEN):
        seen[place] = 0.0
    for q in range(QUANTITIES):
        seen[Seen.LOW + q], seen[Seen.HIGH + q] = math.inf, -math.inf
    y = carray(floats_at(context[Context.Y]), (STATES,))
    for place in range(STATES):
        seen[Seen.STATE + place] = y[place]
    pairs = carray(floats_at(context[Context.PAIRS]), (2, 2))
    seen[Seen.LEVEL] = seen[Seen.LEAST] = level(bodies_at(context, Context.LOOP), pairs, y)
    seen[Seen.BOUND], seen[Seen.SETTLED] = bound * max(abs(y[X.L]), abs(y[X.O]), abs(y[X.R])), math.nan
    kept = kept_at(context)
    for body in (LEFT, OBJECT, RIGHT):
        kept[body, Kept.KIND] = NONE
        if abs(y[velocity_lane(body) - 1]) > seen[Seen.BOUND]:
            seen[Seen.OUTSIDE + body] = math.inf


@allocating
def finish(context: Integers) -> None:
    """What follows at the end of a run: the last times outside the bound, and whether they are the last for good."""
    seen, kept = seen_at(context), kept_at(context)
    for body in (LEFT, OBJECT, RIGHT):
        if kept[body, Kept.KIND] != NONE:
            sight = kept_sight(sight_of(context, 0, 0.0, 0.0, 0), kept[body])
            seen[Seen.OUTSIDE + body] = kept[body, Kept.BEGIN] + last_outside(sight, body, seen[Seen.BOUND])
            kept[body, Kept.KIND] = NONE
    seen[Seen.LAST_OUTSIDE] = max(seen[Seen.OUTSIDE + LEFT], seen[Seen.OUTSIDE + OBJECT], seen[Seen.OUTSIDE + RIGHT])
    pairs, y = carray(floats_at(context[Context.PAIRS]), (2, 2)), carray(floats_at(context[Context.Y]), (STATES,))
    loop = bodies_at(context, Context.LOOP)
    if context[Context.CERTAIN] != 0:
        rest = carray(floats_at(context[Context.REST]), (RESTS,))
        seen[Seen.SETTLED] = settled_from(loop, pairs, level(loop, pairs, y), rest[SINCE] < math.inf, seen)


@allocating
def observe(address: int, kind: int, t: float, s: float, degree: int) -> int:
    """Remember what is wanted of a segment of t s, which has just ended; called by `callback.notify`.

    Before a run it is called with BEGIN and the part of the largest displacement that counts as settled; after it with
    FINISH.
    """
    context = carray(integers_at(address), (PLACES,))
    if kind == BEGIN:
        begin(context, t)
        return 0
    if kind == FINISH:
        finish(context)
        return 0
    sight, seen, wanted = sight_of(context, kind, t, s, degree), seen_at(context), context[Context.WANTED]
    clock = carray(floats_at(context[Context.CLOCK]), (CLOCK,))
    now = clock[2] + (clock[0] + clock[1])
    if not math.isfinite(sight.y.sum() + t):
        return 0
    seen[Seen.SEGMENTS] += 1.0
    bound = wanted & (Wanted.SETTLING.value | Wanted.BOUND.value)
    if bound or wanted & (Wanted.MOTION.value | Wanted.IMPACTS.value | Wanted.INPUTS.value):
        write_ranges(sight)
        watch_quantities(sight, seen, wanted)
    if bound:
        watch_bound(sight, seen, kept_at(context), now)
    if context[Context.LOSSES] != 0:
        call(context[Context.LOSSES], address, kind, t, s, degree)
    if wanted & Wanted.RISE.value:
        watch_level(context, sight, seen)
    for place in range(STATES):
        sight.before[place] = sight.y[place]
    return 0


@allocating
def observe_losses(address: int, kind: int, t: float, s: float, degree: int) -> int:
    """Add the losses of a segment; a function of its own, so that only who asks for them waits for its compilation."""
    context = carray(integers_at(address), (PLACES,))
    add_losses(sight_of(context, kind, t, s, degree), bodies_at(context, Context.BASE), seen_at(context))
    return 0

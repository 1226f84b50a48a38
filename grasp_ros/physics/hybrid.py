"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the switches of (10).

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings fire together.
"""

import math
from typing import Any

from grasp_ros.physics.flight import EPS, REENTRY_ROOT, RELEASE_ROOT, TOUCH_ROOT, flight_root, fly, launch
from grasp_ros.physics.jit import kernel
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZ,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Event,
    Outcome,
    Pair,
)
from grasp_ros.physics.series import (
    D_L,
    E_L,
    EVENT,
    TIME,
    W_L,
    W_R,
    G,
    evaluate,
    expand_both,
    expand_one,
    first_rise,
    impact_scales,
    invert_time,
    state_at,
    step_size,
)

OPEN, CONTACT, CLAMPED, LEAVING, HELD = (int(p) for p in Pair)
TOUCH, RELEASE, CLAMP, REENTRY = (int(e) for e in Event)
GRID, EVENTS = 0, 1  # entries of `filled`
DONE, EVENTS_FULL, NOT_FINITE, STALLED = (int(o) for o in Outcome)
TOGETHER = 1.0 + 4.0 * EPS  # events closer than this fire together
SLIVER = 1e-7  # part of an impact's depth whose impulse, of relative size SLIVER^2.5, is below rounding
MAX_IDLE = 1000  # segments without progress in time


@kernel
def relative_motion(bodies: Any, y: Any, side: int) -> Any:
    """u' and the u'' that both bodies would have without impact forces."""
    x, v = (y[X_L], y[V_L]) if side == LEFT else (y[X_R], y[V_R])
    sign = 1.0 if side == LEFT else -1.0
    arm, body = bodies[side], bodies[OBJECT]
    a = (arm[FORCE] - arm[STIFFNESS] * x - arm[DAMPING] * v) / arm[MASS]
    a_o = (body[FORCE] - body[STIFFNESS] * y[X_O] - body[DAMPING] * y[V_O]) / body[MASS]
    return sign * (v - y[V_O]), sign * (a - a_o)


@kernel
def judge(bodies: Any, pairs: Any, y: Any, side: int, other_in_contact: bool) -> int:
    """Mode of a pair from its state alone: condition (10), and at u = 0 the direction of the motion."""
    u = y[U_L + side]
    d, a = relative_motion(bodies, y, side)
    if u < 0.0:
        return OPEN
    if u > 0.0:
        return CONTACT if 1.0 + pairs[side, DISSIPATION] * d >= 0.0 else CLAMPED
    if d == 0.0:
        return HELD if a > 0.0 or (a == 0.0 and other_in_contact) else OPEN
    return CONTACT if d > 0.0 else OPEN


@kernel
def classify(bodies: Any, pairs: Any, y: Any, mode: Any) -> None:
    """Modes of both pairs for a run that starts at y."""
    mode[LEFT] = judge(bodies, pairs, y, LEFT, False)
    mode[RIGHT] = judge(bodies, pairs, y, RIGHT, mode[LEFT] == CONTACT)
    if mode[LEFT] == OPEN and mode[RIGHT] == CONTACT:
        mode[LEFT] = judge(bodies, pairs, y, LEFT, True)


@kernel
def scales(bodies: Any, pairs: Any, y: Any, side: int) -> Any:
    """Scales of w and of u' of one pair's impact with its present energy."""
    d, _ = relative_motion(bodies, y, side)
    return impact_scales(pairs[side], bodies[side, MASS], bodies[OBJECT, MASS], y[U_L + side], d)


@kernel
def hold_time(bodies: Any, pairs: Any, y: Any, side: int) -> float:
    """How long a pair that starts at u = 0 may stay without force: a sliver of its impact.

    The impulse lost relative to the impact's is of order (time)^2.5 if the pair approaches, and (time)^4 if it
    starts at rest and is pushed together by the acceleration a; its time scale is then (mu / (H sqrt(a)))^(1/3).
    """
    d, a = relative_motion(bodies, y, side)
    if d > 0.0:
        w, v = scales(bodies, pairs, y, side)
        return SLIVER * w * w / v
    w, v = scales(bodies, pairs, y, 1 - side)
    if w > 0.0:
        a = max(abs(a), v * v / (w * w))
    mu = bodies[side, MASS] * bodies[OBJECT, MASS] / (bodies[side, MASS] + bodies[OBJECT, MASS])
    return 1e3 * SLIVER * (mu / (pairs[side, HERTZ] * math.sqrt(abs(a)))) ** (1.0 / 3.0)


@kernel
def settle(bodies: Any, pairs: Any, y: Any, mode: Any) -> None:
    """Take both pairs off the corner w_l = w_r = 0, where the product w_l w_r stops the regularised time.

    At a simultaneous touch both are held for a sliver; at a simultaneous release both leave a sliver early.
    """
    if mode[LEFT] != CONTACT or mode[RIGHT] != CONTACT:
        return
    if y[U_L] == 0.0 and y[U_L + 1] == 0.0:
        mode[LEFT] = HELD
        mode[RIGHT] = HELD
        return
    for side in (LEFT, RIGHT):
        d, a = relative_motion(bodies, y, side)
        w, _ = scales(bodies, pairs, y, side)
        u = y[U_L + side]
        if d >= 0.0 or u > SLIVER * w * w or 20.0 * u * abs(a) > d * d:
            return
    mode[LEFT] = LEAVING
    mode[RIGHT] = LEAVING


@kernel
def tick(clock: Any, step: float) -> None:
    """Add to the compensated clock (two-sum), so that long runs do not drift."""
    total = clock[0] + step
    back = total - clock[0]
    clock[1] += (clock[0] - (total - back)) + (step - back)
    clock[0] = total


@kernel
def fire(y: Any, mode: Any, side: int, kind: int, now: float, events: Any, filled: Any) -> None:
    """Switch one pair and record the event.

    A touch that rounding invents at the turning point of a grazing approach has u' <= 0 and is no event.
    """
    d = y[V_L] - y[V_O] if side == LEFT else y[V_O] - y[V_R]
    if kind in (TOUCH, RELEASE):
        y[U_L + side] = 0.0
    if kind == TOUCH and d <= 0.0:
        mode[side] = OPEN
        return
    n = filled[EVENTS]
    filled[EVENTS] = n + 1
    mode[side] = OPEN if kind == RELEASE else (CLAMPED if kind == CLAMP else CONTACT)
    events[n, 0] = now
    events[n, 1] = side
    events[n, 2] = kind
    events[n, 3] = y[U_L + side]
    events[n, 4] = d


@kernel
def flight_switch(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, arm: Any, body: Any, span: float,
                  work: Any) -> Any:
    """Time and kind of one pair's first event in a flight of at most `span`."""
    sign = 1.0 if side == LEFT else -1.0
    d, _ = relative_motion(bodies, y, side)
    start = (y[U_L + side], d)
    if mode[side] == HELD:
        return math.inf, TOUCH
    if mode[side] == OPEN:
        return flight_root(TOUCH_ROOT, bodies[side], bodies[OBJECT], arm, body, start, sign, 0.0, span, work), TOUCH
    released = flight_root(RELEASE_ROOT, bodies[side], bodies[OBJECT], arm, body, start, sign, 0.0, span, work)
    if mode[side] == CLAMPED:
        back = flight_root(REENTRY_ROOT, bodies[side], bodies[OBJECT], arm, body, start, sign,
                           1.0 / pairs[side, DISSIPATION], min(span, released), work)
        if not back >= released:
            return back, REENTRY
    return released, RELEASE


@kernel
def fly_all(flights: Any, t: float, y: Any) -> None:
    """Write positions, velocities and penetrations after the time t of flight."""
    y[X_L], y[V_L] = fly(flights[LEFT], t)
    y[X_R], y[V_R] = fly(flights[RIGHT], t)
    y[X_O], y[V_O] = fly(flights[OBJECT], t)
    y[U_L] = y[X_L] - y[X_O]
    y[U_L + 1] = y[X_O] - y[X_R]


@kernel
def flight_segment(bodies: Any, pairs: Any, y: Any, mode: Any, clock: Any, span: float, grid: Any, out: Any,
                   events: Any, filled: Any, work: Any) -> float:
    """Fly to the first event or to the end of the span; returns the flight time."""
    work[0] += 1
    flights = (
        launch(bodies[LEFT], y[X_L], y[V_L]),
        launch(bodies[RIGHT], y[X_R], y[V_R]),
        launch(bodies[OBJECT], y[X_O], y[V_O]),
    )
    t_l, kind_l = flight_switch(bodies, pairs, y, mode, LEFT, flights[LEFT], flights[OBJECT], span, work)
    t_r, kind_r = flight_switch(bodies, pairs, y, mode, RIGHT, flights[RIGHT], flights[OBJECT],
                                min(span, t_l * TOGETHER), work)
    t = min(span, t_l, t_r) if t_l == t_l and t_r == t_r else math.nan
    first_l, first_r = relative_motion(bodies, y, LEFT), relative_motion(bodies, y, RIGHT)
    now = clock[0] + t
    row = filled[GRID]
    while row < grid.shape[0] and grid[row] <= now:
        fly_all(flights, max((grid[row] - clock[0]) - clock[1], 0.0), y)
        out[row, :] = y[:6]
        row += 1
    filled[GRID] = row
    fly_all(flights, t, y)
    if mode[LEFT] == HELD:
        y[U_L] = t * (first_l[0] + 0.5 * t * first_l[1])
    if mode[RIGHT] == HELD:
        y[U_L + 1] = t * (first_r[0] + 0.5 * t * first_r[1])
    tick(clock, t)
    if t_l <= t * TOGETHER:
        fire(y, mode, LEFT, kind_l, clock[0], events, filled)
    if t_r <= t * TOGETHER:
        fire(y, mode, RIGHT, kind_r, clock[0], events, filled)
    return t


@kernel
def contact_switch(c: Any, pairs: Any, mode: Any, side: int, n: int, h: float, work: Any) -> Any:
    """s and kind of one pair's first event within a Taylor step of length h."""
    loss = pairs[side, DISSIPATION]
    f = c[EVENT]
    if mode[side] == OPEN:
        return first_rise(c[U_L + side], n, h, work), TOUCH
    if mode[side] == HELD:
        return math.inf, TOUCH
    f[:] = -c[W_L + side] if mode[side] == CONTACT else -c[U_L + side]
    released = first_rise(f, n, h, work)
    if loss > 0.0 and mode[side] == CONTACT:
        f[:] = -c[E_L + side]
        clamped = first_rise(f, n - 1, min(h, released), work)
        if not clamped >= released:
            return clamped, CLAMP
    if mode[side] == CLAMPED:
        f[:] = loss * c[D_L + side]
        f[0] += 1.0
        back = first_rise(f, n - 1, min(h, released), work)
        if not back >= released:
            return back, REENTRY
    return released, RELEASE


@kernel
def contact_step(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, span: float, tolerance: float, n: int,
                 work: Any) -> float:
    """Expand the series at y and return an accepted step in s.

    u is expanded beside w although u = w^2: the mismatch at the end of the step consists of neglected terms only
    and decides whether the step is accepted. Shortening it costs no new expansion.
    """
    c = tables.c
    left, right = mode[LEFT] == CONTACT, mode[RIGHT] == CONTACT
    c[X_O : U_L + 2, 0] = y[X_O : U_L + 2]
    c[V_L, 0] = y[V_L]
    c[TIME, 0] = 0.0
    c[W_L, 0] = math.sqrt(y[U_L]) if left else 0.0
    c[W_R, 0] = math.sqrt(y[U_L + 1]) if right else 0.0
    if left and right:
        expand_both(c, tables.f, bodies, pairs, n)
    else:
        expand_one(c, tables.f, bodies, pairs, LEFT if left else RIGHT, n)
    scale_l = scales(bodies, pairs, y, LEFT) if left else (0.0, 0.0)
    scale_r = scales(bodies, pairs, y, RIGHT) if right else (0.0, 0.0)
    h = step_size(c, left, right, scale_l, scale_r, n, tolerance)
    weight = (c[W_L, 0] if left else 1.0) * (c[W_R, 0] if right else 1.0)
    if h == math.inf:
        return span / weight
    allowed = 100.0 * tolerance + 100.0 * EPS
    for _ in range(60):
        bad_l = left and abs(evaluate(c[U_L], n, h) - evaluate(c[W_L], n, h) ** 2) > allowed * scale_l[0] ** 2
        bad_r = right and abs(evaluate(c[U_L + 1], n, h) - evaluate(c[W_R], n, h) ** 2) > allowed * scale_r[0] ** 2
        if not (bad_l or bad_r):
            return h
        work[2] += 1
        h *= 0.7
    return math.nan


@kernel
def contact_segment(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, clock: Any, span: float, tolerance: float,
                    n: int, grid: Any, out: Any, events: Any, filled: Any, work: Any) -> float:
    """One Taylor step, cut at its first event or at the end of the span; returns its time."""
    work[1] += 1
    left, right = mode[LEFT] == CONTACT, mode[RIGHT] == CONTACT
    c = tables.c
    h = contact_step(tables, bodies, pairs, y, mode, span, tolerance, n, work)
    s_l, kind_l = contact_switch(c, pairs, mode, LEFT, n, h, work)
    s_r, kind_r = contact_switch(c, pairs, mode, RIGHT, n, min(h, s_l * TOGETHER), work)
    s = min(h, s_l, s_r) if s_l == s_l and s_r == s_r else math.nan
    t = evaluate(c[TIME], n, s)
    g = c[G] if left and right else (c[W_L] if left else c[W_R])
    if t > span:
        s = invert_time(c, g, n, span, 0.0, s)
        t = span
    now = clock[0] + t
    low = 0.0
    row = filled[GRID]
    while row < grid.shape[0] and grid[row] <= now:
        low = invert_time(c, g, n, max((grid[row] - clock[0]) - clock[1], 0.0), low, s)
        state_at(c, n, low, left, right, y)
        out[row, :] = y[:6]
        row += 1
    filled[GRID] = row
    state_at(c, n, s, left, right, y)
    tick(clock, t)
    if s_l <= s * TOGETHER:
        fire(y, mode, LEFT, kind_l, clock[0], events, filled)
    if s_r <= s * TOGETHER:
        fire(y, mode, RIGHT, kind_r, clock[0], events, filled)
    return t


@kernel
def advance(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, clock: Any, span: float, tolerance: float,
            grid: Any, out: Any, events: Any, filled: Any, work: Any) -> int:
    """Integrate y in place from the clock to `span` with constant forces on the arms; returns a `layout.Outcome`.

    Parameters
    ----------
    tables : series.Tables
        Workspace; its size sets the order.
    bodies, pairs : arrays (3, 4) and (2, 2)
        See `layout`.
    y : array (8,), mode : int array (2,), clock : array (2,)
        State, pair modes and compensated time, updated in place.
    span : float, s
        End of the integration on the clock.
    grid, out : arrays (n,) and (n, 6)
        Ascending output times on the clock, and the states at them.
    events : array (m, 5)
        Filled with time, side, kind, u, u'.
    filled : int array (2,)
        Rows of `out` and of `events` in use, updated in place.
    work : int array (4,)
        Counters, see `layout.Work`.
    """
    n = tables.c.shape[1] - 1
    idle = 0
    while True:
        limit = (span - clock[0]) - clock[1]
        if not limit > 0.0:
            break
        if filled[EVENTS] + 2 > events.shape[0]:
            return EVENTS_FULL
        settle(bodies, pairs, y, mode)
        held_l, held_r = mode[LEFT] == HELD, mode[RIGHT] == HELD
        if held_l:
            limit = min(limit, hold_time(bodies, pairs, y, LEFT))
        if held_r:
            limit = min(limit, hold_time(bodies, pairs, y, RIGHT))
        if mode[LEFT] == CONTACT or mode[RIGHT] == CONTACT:
            t = contact_segment(tables, bodies, pairs, y, mode, clock, limit, tolerance, n, grid, out, events,
                                filled, work)
        else:
            t = flight_segment(bodies, pairs, y, mode, clock, limit, grid, out, events, filled, work)
        if held_l:
            mode[LEFT] = judge(bodies, pairs, y, LEFT, mode[RIGHT] == CONTACT)
        if held_r:
            mode[RIGHT] = judge(bodies, pairs, y, RIGHT, mode[LEFT] == CONTACT)
        idle = 0 if t > 0.0 else idle + 1
        if not math.isfinite(y.sum()) or t != t:
            return NOT_FINITE
        if idle > MAX_IDLE:
            return STALLED
    while filled[GRID] < grid.shape[0] and grid[filled[GRID]] <= span:
        out[filled[GRID], :] = y[:6]
        filled[GRID] += 1
    return DONE

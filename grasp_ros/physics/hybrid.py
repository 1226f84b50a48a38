"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the switches of (10).

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings fire together.
"""

import math
from typing import Any

from grasp_ros.physics.flight import EPS, REENTRY_ROOT, RELEASE_ROOT, TOUCH_ROOT, flight_root, fly, launch
from grasp_ros.physics.jit import kernel
from grasp_ros.physics.layout import (
    DISSIPATION,
    LEFT,
    OBJECT,
    RIGHT,
    U_L,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Outcome,
)
from grasp_ros.physics.polynomial import evaluate, first_rise, invert_time
from grasp_ros.physics.series import D_L, E_L, TIME, W_L, W_R, expand_both, expand_one, state_at, step_size
from grasp_ros.physics.switching import (
    ABSENT,
    CLAMP,
    CLAMPED,
    CONTACT,
    EVENTS,
    GRID,
    HELD,
    OPEN,
    REENTRY,
    RELEASE,
    TOUCH,
    fastest_rate,
    fire,
    hold_time,
    relative_motion,
    resume,
    scales,
    settle,
)

DONE, EVENTS_FULL, NOT_FINITE, STALLED = (int(o) for o in Outcome)
TOGETHER = 1.0 + 4.0 * EPS  # events closer than this fire together
MAX_IDLE = 1000  # segments without progress in time


@kernel
def tick(clock: Any, step: float) -> None:
    """Add to the compensated clock (two-sum), so that long runs do not drift."""
    total = clock[0] + step
    back = total - clock[0]
    clock[1] += (clock[0] - (total - back)) + (step - back)
    clock[0] = total


@kernel
def flight_switch(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, arm: Any, body: Any, span: float,
                  work: Any) -> Any:
    """Time and kind of one pair's first event in a flight of at most `span`."""
    sign = 1.0 if side == LEFT else -1.0
    d, _ = relative_motion(bodies, y, side)
    start = (y[U_L + side], d)
    if mode[side] == HELD or mode[side] == ABSENT:
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
def deliver(y: Any, out: Any, row: int) -> None:
    """Copy positions and velocities to a row of the output."""
    for column in range(6):
        out[row, column] = y[column]


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
    """Fly to the first event or to the end of the span; returns the flight time, or nan if a search does not end."""
    work[0] += 1
    flights = (
        launch(bodies[LEFT], y[X_L], y[V_L]),
        launch(bodies[RIGHT], y[X_R], y[V_R]),
        launch(bodies[OBJECT], y[X_O], y[V_O]),
    )
    t_l, kind_l = flight_switch(bodies, pairs, y, mode, LEFT, flights[LEFT], flights[OBJECT], span, work)
    t_r, kind_r = flight_switch(bodies, pairs, y, mode, RIGHT, flights[RIGHT], flights[OBJECT], span, work)
    if math.isnan(t_l) or math.isnan(t_r):
        return math.nan
    t = min(span, t_l, t_r)
    first_l, first_r = relative_motion(bodies, y, LEFT), relative_motion(bodies, y, RIGHT)
    depth_l, depth_r = y[U_L], y[U_L + 1]
    row = filled[GRID]
    while row < grid.shape[0] and (grid[row] - clock[0]) - clock[1] < t:
        fly_all(flights, (grid[row] - clock[0]) - clock[1], y)
        deliver(y, out, row)
        row += 1
    filled[GRID] = row
    fly_all(flights, t, y)
    if mode[LEFT] == HELD:
        y[U_L] = depth_l + t * (first_l[0] + 0.5 * t * first_l[1])
    if mode[RIGHT] == HELD:
        y[U_L + 1] = depth_r + t * (first_r[0] + 0.5 * t * first_r[1])
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
    if mode[side] == OPEN:
        return first_rise(c[U_L + side], 1.0, 0.0, n, h, work), TOUCH
    if mode[side] == HELD or mode[side] == ABSENT:
        return math.inf, TOUCH
    depth = c[W_L + side] if mode[side] == CONTACT else c[U_L + side]
    released = first_rise(depth, -1.0, 0.0, n, h, work)
    if loss > 0.0 and mode[side] == CONTACT:
        clamped = first_rise(c[E_L + side], -1.0, 0.0, n - 1, min(h, released), work)
        if not clamped >= released:
            return clamped, CLAMP
    if mode[side] == CLAMPED:
        back = first_rise(c[D_L + side], loss, 1.0, n - 1, min(h, released), work)
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
    w_l, v_l = scales(bodies, pairs, y, mode, LEFT) if left else (1.0, 0.0)
    w_r, v_r = scales(bodies, pairs, y, mode, RIGHT) if right else (1.0, 0.0)
    # The unit of s makes the radius of convergence about 1: coefficients must not leave the range of numbers.
    unit = 1.0 / max(v_l * w_r / w_l, v_r * w_l / w_r, 2.0 * w_l * w_r * fastest_rate(bodies))
    if left and right:
        expand_both(c, tables.f, bodies, pairs, unit, n)
    else:
        expand_one(c, tables.f, bodies, pairs, LEFT if left else RIGHT, unit, n)
    h = step_size(c, left, right, w_l, w_r, max(v_l, v_r), n, tolerance)
    if h == math.inf:
        weight = (c[W_L, 0] if left else 1.0) * (c[W_R, 0] if right else 1.0)
        return span / (weight * unit)
    allowed = 100.0 * tolerance + 100.0 * EPS
    for _ in range(60):
        bad_l = left and abs(evaluate(c[U_L], n, h) - evaluate(c[W_L], n, h) ** 2) > allowed * w_l * w_l
        bad_r = right and abs(evaluate(c[U_L + 1], n, h) - evaluate(c[W_R], n, h) ** 2) > allowed * w_r * w_r
        if not (bad_l or bad_r):
            return h
        work[2] += 1
        h *= 0.7
    return math.nan


@kernel
def contact_segment(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, clock: Any, span: float, tolerance: float,
                    n: int, grid: Any, out: Any, events: Any, filled: Any, work: Any) -> float:
    """One Taylor step, cut at its first event or at the end of the span.

    Returns its time, or nan if a search does not end.
    """
    work[1] += 1
    left, right = mode[LEFT] == CONTACT, mode[RIGHT] == CONTACT
    c = tables.c
    h = contact_step(tables, bodies, pairs, y, mode, span, tolerance, n, work)
    s_l, kind_l = contact_switch(c, pairs, mode, LEFT, n, h, work)
    s_r, kind_r = contact_switch(c, pairs, mode, RIGHT, n, h, work)
    if math.isnan(h) or math.isnan(s_l) or math.isnan(s_r):
        return math.nan
    s = min(h, s_l, s_r)
    t = evaluate(c[TIME], n, s)
    if t > span:
        s = invert_time(c[TIME], n, span, s)
        t = span
    row = filled[GRID]
    while row < grid.shape[0] and (grid[row] - clock[0]) - clock[1] < t:
        state_at(c, n, invert_time(c[TIME], n, (grid[row] - clock[0]) - clock[1], s), left, right, y)
        deliver(y, out, row)
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
        row = filled[GRID]
        while row < grid.shape[0] and (grid[row] - clock[0]) - clock[1] <= 0.0:
            deliver(y, out, row)
            row += 1
        filled[GRID] = row
        if not limit > 0.0:
            return DONE
        if filled[EVENTS] + 2 > events.shape[0]:
            return EVENTS_FULL
        settle(bodies, pairs, y, mode, tolerance)
        held_l, held_r = mode[LEFT] == HELD, mode[RIGHT] == HELD
        if held_l:
            limit = min(limit, hold_time(bodies, pairs, y, mode, LEFT, tolerance))
        if held_r:
            limit = min(limit, hold_time(bodies, pairs, y, mode, RIGHT, tolerance))
        if mode[LEFT] == CONTACT or mode[RIGHT] == CONTACT:
            t = contact_segment(tables, bodies, pairs, y, mode, clock, limit, tolerance, n, grid, out, events,
                                filled, work)
        else:
            t = flight_segment(bodies, pairs, y, mode, clock, limit, grid, out, events, filled, work)
        if held_l:
            resume(bodies, pairs, y, mode, LEFT, tolerance)
        if held_r:
            resume(bodies, pairs, y, mode, RIGHT, tolerance)
        idle = 0 if t > 0.0 else idle + 1
        if not math.isfinite(y.sum()):
            return NOT_FINITE
        if math.isnan(t) or idle > MAX_IDLE:
            return STALLED

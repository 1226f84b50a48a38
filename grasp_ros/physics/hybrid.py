"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the switches of (10).

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings fire together.
"""

import math
from typing import Any

from grasp_ros.physics.flight import (
    EPS,
    FLIGHT_ORDER,
    REENTRY_ROOT,
    RELEASE_ROOT,
    TOUCH_ROOT,
    expand_flight,
    flight_root,
    fly,
    launch,
)
from grasp_ros.physics.jit import kernel
from grasp_ros.physics.layout import (
    CHECK,
    DISSIPATION,
    LANES,
    LEFT,
    OBJECT,
    RIGHT,
    TIME,
    U_L,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Z_L,
    Z_R,
    Outcome,
)
from grasp_ros.physics.polynomial import NOISE, curvatures, first_rise, invert_time, lane_range, values
from grasp_ros.physics.series import expand_both, expand_one, step_size
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
def fly_all(flights: Any, t: float, y: Any) -> None:
    """Write positions, velocities and penetrations after the time t of flight."""
    y[X_L], y[V_L] = fly(flights[LEFT], t)
    y[X_R], y[V_R] = fly(flights[RIGHT], t)
    y[X_O], y[V_O] = fly(flights[OBJECT], t)
    y[U_L] = y[X_L] - y[X_O]
    y[U_L + 1] = y[X_O] - y[X_R]


@kernel
def deliver_flight(tables: Any, bodies: Any, flights: Any, pace: float, t: float, clock: Any, grid: Any, out: Any,
                   filled: Any) -> None:
    """Write the states at the output times before the end t of a flight.

    The tables belong to fixed pieces of the flight, so that no state depends on the other output times.
    """
    row = filled[GRID]
    piece = -1.0
    begin = 0.0
    while row < grid.shape[0]:
        tau = (grid[row] - clock[0]) - clock[1]
        if not tau < t:
            break
        own = math.floor(tau * 2.0 * pace)
        if own != piece:
            piece = own
            begin = piece / (2.0 * pace) if piece > 0.0 else 0.0
            expand_flight(bodies, flights, begin, tables.c)
        values(tables.c, FLIGHT_ORDER, tau - begin, tables.at)
        for column in range(6):
            out[row, column] = tables.at[column]
        row += 1
    filled[GRID] = row


@kernel
def flight_segment(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, pace: float, clock: Any, span: float,
                   grid: Any, out: Any, events: Any, filled: Any, work: Any) -> float:
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
    deliver_flight(tables, bodies, flights, pace, t, clock, grid, out, filled)
    first_l, first_r = relative_motion(bodies, y, LEFT), relative_motion(bodies, y, RIGHT)
    depth_l, depth_r = y[U_L], y[U_L + 1]
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
def rise_of_lanes(tables: Any, n: int, h: float, factor: float, front: int, back: int, offset: float,
                  work: Any) -> float:
    """First s in (0, h] at which offset + factor (c_front - c_back) rises through zero; back < 0: without it."""
    c, row = tables.c, tables.row
    for k in range(n + 1):
        i = LANES * k
        row[k] = factor * (c[i + front] - c[i + back] if back >= 0 else c[i + front])
    row[0] += offset
    noise = abs(c[front]) + abs(c[back]) if back >= 0 else abs(c[front])
    return first_rise(row, n, h, EPS * (abs(offset) + abs(factor) * noise), work)


@kernel
def contact_switch(tables: Any, pairs: Any, mode: Any, side: int, n: int, h: float, work: Any) -> Any:
    """s and kind of one pair's first event within a Taylor step of length h.

    Most steps have none, and the ranges of the lanes prove it.
    """
    c, at, size = tables.c, tables.at, tables.size
    loss = pairs[side, DISSIPATION]
    if mode[side] == HELD or mode[side] == ABSENT:
        return math.inf, TOUCH
    z = Z_L + side
    low, high = lane_range(c, z, h, at, size)
    if mode[side] == OPEN:
        if c[z] <= 0.0 and high < 0.0:
            return math.inf, TOUCH
        return rise_of_lanes(tables, n, h, 1.0, z, -1, 0.0, work), TOUCH
    released = math.inf
    if not (c[z] >= 0.0 and low > 0.0):
        released = rise_of_lanes(tables, n, h, -1.0, z, -1, 0.0, work)
    front, back = (V_L, V_O) if side == LEFT else (V_O, V_R)
    if loss > 0.0 and mode[side] == CONTACT:
        slowest = lane_range(c, front, h, at, size)[0] - lane_range(c, back, h, at, size)[1]
        if 1.0 + loss * (c[front] - c[back]) >= 0.0 and 1.0 + loss * slowest > NOISE:
            return released, RELEASE
        clamped = rise_of_lanes(tables, n, min(h, released), -loss, front, back, -1.0, work)
        if not clamped >= released:
            return clamped, CLAMP
    if mode[side] == CLAMPED:
        again = rise_of_lanes(tables, n, min(h, released), loss, front, back, 1.0, work)
        if not again >= released:
            return again, REENTRY
    return released, RELEASE


@kernel
def contact_step(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, pace: float, span: float, tolerance: float,
                 n: int, work: Any) -> Any:
    """Expand the series at y; returns an accepted step in s / unit, and the unit. tables.at has the values at its end.

    G = w_l w_r, or u = w^2 with one side in contact, is expanded beside w: the mismatch at the end of the step
    consists of neglected terms only and decides whether the step is accepted. Shortening it costs no new expansion.
    """
    c, at = tables.c, tables.at
    left, right = mode[LEFT] == CONTACT, mode[RIGHT] == CONTACT
    for lane in range(LANES):
        c[lane] = y[lane]
    c[TIME] = 0.0
    w_l, v_l, w_r, v_r = 1.0, 0.0, 1.0, 0.0
    if left:
        c[Z_L] = math.sqrt(y[U_L])
        w_l, v_l = scales(bodies, pairs, y, mode, LEFT)
    if right:
        c[Z_R] = math.sqrt(y[U_L + 1])
        w_r, v_r = scales(bodies, pairs, y, mode, RIGHT)
    # The unit of s makes the radius of convergence about 1: coefficients must not leave the range of numbers.
    unit = 1.0 / max(v_l * w_r / w_l, v_r * w_l / w_r, 2.0 * w_l * w_r * pace)
    if left and right:
        expand_both(c, tables.f, bodies, pairs, unit, n)
    else:
        expand_one(c, tables.f, bodies, pairs, LEFT if left else RIGHT, unit, n)
    h = step_size(c, left, right, w_l, w_r, max(v_l, v_r), n, tolerance)
    if h == math.inf:
        h = span / ((c[Z_L] if left else 1.0) * (c[Z_R] if right else 1.0) * unit)
        values(c, n, h, at)
        return h, unit
    allowed = (100.0 * tolerance + 100.0 * EPS) * (w_l * w_r if left and right else (w_l * w_r) ** 2)
    for _ in range(60):
        values(c, n, h, at)
        if abs(at[CHECK] - (at[Z_L] if left else at[Z_R]) * (at[Z_R] if right else at[Z_L])) <= allowed:
            return h, unit
        work[2] += 1
        h *= 0.7
    return math.nan, unit


@kernel
def deliver_contact(tables: Any, left: bool, right: bool, unit: float, s: float, t: float, n: int, clock: Any, grid: Any, out: Any,
                    filled: Any) -> None:
    """Write the states at the output times before the end of a Taylor step, at s and after the time t."""
    at = tables.at
    row = filled[GRID]
    while row < grid.shape[0]:
        tau = (grid[row] - clock[0]) - clock[1]
        if not tau < t:
            break
        values(tables.c, n, invert_time(tables.c, n, unit, tau, s, t, left, right, at), at)
        u_l, u_r = at[Z_L] * at[Z_L] if left else at[Z_L], at[Z_R] * at[Z_R] if right else at[Z_R]
        out[row, X_L], out[row, V_L] = at[X_O] + u_l, at[V_L]
        out[row, X_O], out[row, V_O] = at[X_O], at[V_O]
        out[row, X_R], out[row, V_R] = at[X_O] - u_r, at[V_R]
        row += 1
    filled[GRID] = row


@kernel
def contact_segment(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, pace: float, clock: Any, span: float,
                    tolerance: float, n: int, grid: Any, out: Any, events: Any, filled: Any, work: Any) -> float:
    """One Taylor step, cut at its first event or at the end of the span.

    Returns its time, or nan if a search does not end.
    """
    work[1] += 1
    left, right = mode[LEFT] == CONTACT, mode[RIGHT] == CONTACT
    c, at = tables.c, tables.at
    h, unit = contact_step(tables, bodies, pairs, y, mode, pace, span, tolerance, n, work)
    curvatures(c, n, h, tables.size)
    s_l, kind_l = contact_switch(tables, pairs, mode, LEFT, n, h, work)
    s_r, kind_r = contact_switch(tables, pairs, mode, RIGHT, n, h, work)
    if math.isnan(h) or math.isnan(s_l) or math.isnan(s_r):
        return math.nan
    s = min(h, s_l, s_r)
    if s < h:
        values(c, n, s, at)
    t = at[TIME]
    if t > span:
        s = invert_time(c, n, unit, span, s, t, left, right, at)
        t = span
        values(c, n, s, at)
    u_l, u_r = at[Z_L] * at[Z_L] if left else at[Z_L], at[Z_R] * at[Z_R] if right else at[Z_R]
    y[X_L], y[V_L], y[X_O], y[V_O], y[X_R], y[V_R] = at[X_O] + u_l, at[V_L], at[X_O], at[V_O], at[X_O] - u_r, at[V_R]
    y[U_L], y[U_L + 1] = u_l, u_r
    deliver_contact(tables, left, right, unit, s, t, n, clock, grid, out, filled)
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
    n = tables.row.shape[0] - 1
    pace = fastest_rate(bodies)
    idle = 0
    while True:
        limit = (span - clock[0]) - clock[1]
        row = filled[GRID]
        while row < grid.shape[0] and (grid[row] - clock[0]) - clock[1] <= 0.0:
            for column in range(6):
                out[row, column] = y[column]
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
            t = contact_segment(tables, bodies, pairs, y, mode, pace, clock, limit, tolerance, n, grid, out,
                                events, filled, work)
        else:
            t = flight_segment(tables, bodies, pairs, y, mode, pace, clock, limit, grid, out, events, filled, work)
        if held_l:
            resume(bodies, pairs, y, mode, LEFT, tolerance)
        if held_r:
            resume(bodies, pairs, y, mode, RIGHT, tolerance)
        idle = 0 if t > 0.0 else idle + 1
        if not math.isfinite(y.sum()):
            return NOT_FINITE
        if math.isnan(t) or idle > MAX_IDLE:
            return STALLED

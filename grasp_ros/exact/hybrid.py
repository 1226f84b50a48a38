"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the switches of (10).

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings fire together.
"""

import math
from typing import Any

from grasp_ros.exact.contact import contact_segment
from grasp_ros.exact.energy_check import energy_level, rises
from grasp_ros.exact.flight import (
    FLIGHT_ORDER,
    REENTRY_ROOT,
    RELEASE_ROOT,
    TOUCH_ROOT,
    displacement,
    expand_flight,
    flight_root,
    fly,
    launch,
)
from grasp_ros.exact.friction import FREE, STUCK, TRUE_MASS, fire_slide, flight_stop, judge_slide, rub
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.modes import (
    ABSENT,
    CLAMPED,
    CONTACT,
    EVENTS,
    GRID,
    HELD,
    OPEN,
    REENTRY,
    RELEASE,
    SLIP,
    SPARE,
    TOGETHER,
    TOUCH,
    UNKNOWN,
    classify,
    fastest_rate,
    fire,
    hold_time,
    press,
    record,
    relative_motion,
    resume,
    settle,
    tick,
)
from grasp_ros.exact.polynomial import values
from grasp_ros.physics.layout import DISSIPATION, LEFT, MASS, OBJECT, RIGHT, U_L, V_L, V_O, V_R, X_L, X_O, X_R, Outcome

DONE, EVENTS_FULL, NOT_FINITE, STALLED, ENERGY_RISES, WORK_USED = (int(o) for o in Outcome)
MAX_IDLE = 1000  # segments without progress in time


@kernel
def flight_switch(bodies: Any, pairs: Any, y: Any, mode: Any, side: int, arm: Any, body: Any, pace: float,
                  span: float, work: Any) -> Any:
    """Time and kind of one pair's first event in a flight of at most `span`."""
    sign = 1.0 if side == LEFT else -1.0
    d, _ = relative_motion(bodies, y, side)
    start = (y[U_L + side], d)
    if mode[side] == HELD or mode[side] == ABSENT:
        return math.inf, TOUCH
    if mode[side] == OPEN:
        touched = flight_root(TOUCH_ROOT, bodies[side], bodies[OBJECT], arm, body, start, sign, 0.0, pace, span, work)
        return touched, TOUCH
    released = flight_root(RELEASE_ROOT, bodies[side], bodies[OBJECT], arm, body, start, sign, 0.0, pace, span, work)
    if mode[side] == CLAMPED:
        back = flight_root(REENTRY_ROOT, bodies[side], bodies[OBJECT], arm, body, start, sign,
                           1.0 / pairs[side, DISSIPATION], pace, min(span, released), work)
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


@inlined
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


@inlined
def flight_segment(tables: Any, bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any, pace: float, clock: Any,
                   span: float, grid: Any, out: Any, events: Any, filled: Any, work: Any) -> float:
    """Fly to the first event or to the end of the span; returns the flight time, or nan if a search does not end."""
    work[0] += 1
    flights = (
        launch(bodies[LEFT], y[X_L], y[V_L]),
        launch(bodies[RIGHT], y[X_R], y[V_R]),
        launch(bodies[OBJECT], y[X_O], y[V_O]),
    )
    t_l, kind_l = flight_switch(bodies, pairs, y, mode, LEFT, flights[LEFT], flights[OBJECT], pace, span, work)
    t_r, kind_r = flight_switch(bodies, pairs, y, mode, RIGHT, flights[RIGHT], flights[OBJECT], pace, span, work)
    if math.isnan(t_l) or math.isnan(t_r):
        return math.nan
    t_o = flight_stop(bodies, y, mode)
    t = min(span, t_l, t_r, t_o)
    deliver_flight(tables, bodies, flights, pace, t, clock, grid, out, filled)
    depth_l, depth_r = y[U_L], y[U_L + 1]
    if mode[LEFT] == HELD or mode[RIGHT] == HELD:  # much shallower than the positions are exact
        away = displacement(flights[OBJECT], t)
        depth_l += displacement(flights[LEFT], t) - away
        depth_r += away - displacement(flights[RIGHT], t)
    fly_all(flights, t, y)
    if mode[LEFT] == HELD:
        y[U_L] = depth_l
    if mode[RIGHT] == HELD:
        y[U_L + 1] = depth_r
    tick(clock, t)
    if t_l <= t * TOGETHER:
        fire(y, mode, LEFT, kind_l, clock[0], events, filled)
    if t_r <= t * TOGETHER:
        fire(y, mode, RIGHT, kind_r, clock[0], events, filled)
    if t_o <= t * TOGETHER:
        fire_slide(bodies, pairs, friction, y, mode, STUCK, clock[0], events, filled)
    return t


@kernel
def enter(bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any, clock: Any, events: Any, filled: Any) -> float:
    """Judge all modes by the state and the forces at the begin of a piece of time; returns the bodies' `fastest_rate`.

    A piece that goes on after it has handed over its events keeps its modes.
    """
    bodies[OBJECT, MASS] = friction[TRUE_MASS]
    pace = fastest_rate(bodies)
    if mode[LEFT] == UNKNOWN:
        mode[OBJECT] = FREE
        classify(bodies, pairs, y, mode, pace)
        judge_slide(bodies, pairs, friction, y, mode)
        classify(bodies, pairs, y, mode, pace)  # a pair at rest at u = 0 moves as friction lets it
    if clock[0] > 0.0:
        rub(bodies, friction, mode)
        return pace
    stuck = mode[OBJECT] == STUCK
    judge_slide(bodies, pairs, friction, y, mode)
    if stuck and mode[OBJECT] != STUCK:
        record(clock[0], OBJECT, SLIP, 0.0, 0.0, events, filled)
    for side in (LEFT, RIGHT):
        press(bodies, pairs, y, mode, side, pace, clock[0], events, filled)
    return pace


@kernel
def advance(tables: Any, bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any, clock: Any, span: float,
            tolerance: float, max_work: int, grid: Any, out: Any, events: Any, filled: Any, work: Any) -> int:
    """Integrate y in place from the clock to `span` with constant forces; returns a `layout.Outcome`.

    Parameters
    ----------
    tables : series.Tables
        Workspace; its size sets the order.
    bodies, pairs : arrays (3, 4) and (2, 2)
        See `layout`. Dry friction changes the row of the object.
    friction : array (3,)
        See `friction`.
    y : array (8,), mode : int array (3,), clock : array (2,)
        State, modes of the pairs and of the object, and compensated time, updated in place.
    span : float, s
        End of the integration on the clock.
    max_work : int
        Budget of flights, contact steps and evaluations of event functions together.
    grid, out : arrays (n,) and (n, 6)
        Ascending output times on the clock, and the states at them.
    events : array (m, 5)
        Filled with time, side, kind, u, u'.
    filled : int array (2,)
        Rows of `out` and of `events` in use, updated in place.
    work : int array (4,)
        Counters, see `layout.Work`.

    If it ends otherwise than DONE or with EVENTS_FULL, `out` holds nothing of the segment that failed.
    """
    n = tables.row.shape[0] - 1
    pace = enter(bodies, pairs, friction, y, mode, clock, events, filled)
    idle = 0
    level, size = energy_level(bodies, pairs, friction, y, mode, 0.0)
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
        if filled[EVENTS] + SPARE > events.shape[0]:
            return EVENTS_FULL
        if work[0] + work[1] + work[3] >= max_work:
            return WORK_USED
        settle(bodies, pairs, y, mode, pace, tolerance, clock[0], events, filled)
        held_l, held_r = mode[LEFT] == HELD, mode[RIGHT] == HELD
        if held_l:
            limit = min(limit, hold_time(bodies, pairs, y, mode, LEFT, pace, tolerance))
        if held_r:
            limit = min(limit, hold_time(bodies, pairs, y, mode, RIGHT, pace, tolerance))
        if mode[LEFT] == CONTACT or mode[RIGHT] == CONTACT:
            t = contact_segment(tables, bodies, pairs, friction, y, mode, pace, clock, limit, tolerance, n, grid, out,
                                events, filled, work)
        else:
            t = flight_segment(tables, bodies, pairs, friction, y, mode, pace, clock, limit, grid, out, events,
                               filled, work)
        if held_l:
            resume(bodies, pairs, y, mode, LEFT, pace, tolerance, clock[0], events, filled)
        if held_r:
            resume(bodies, pairs, y, mode, RIGHT, pace, tolerance, clock[0], events, filled)
        idle = 0 if t > 0.0 else idle + 1
        held = held_l or held_r  # what a held pair has not paid yet comes at once
        before, size_before = level, size
        level, size = energy_level(bodies, pairs, friction, y, mode, t)
        outcome = DONE
        if not math.isfinite(y.sum()):
            outcome = NOT_FINITE
        elif math.isnan(t) or idle > MAX_IDLE:
            outcome = STALLED
        elif not held and rises(bodies, pairs, y, mode, pace, level - before, max(size, size_before), tolerance):
            outcome = ENERGY_RISES
        if outcome != DONE:
            filled[GRID] = row
            return outcome

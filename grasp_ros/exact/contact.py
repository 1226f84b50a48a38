"""A segment in contact: one Taylor step with its acceptance, its events and its outputs."""

import math
from typing import Any

import numpy as np

from grasp_ros.exact.flight import EPS
from grasp_ros.exact.friction import FREE, contact_slide, fire_slide
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.modes import (
    ABSENT,
    CLAMP,
    CLAMPED,
    CONTACT,
    GRID,
    HELD,
    OPEN,
    REENTRY,
    RELEASE,
    TOGETHER,
    TOUCH,
    fire,
    scales,
    tick,
)
from grasp_ros.exact.polynomial import NOISE, curvatures, first_rise, invert_time, lane_range, values
from grasp_ros.exact.series import expand_both, expand_one, step_size
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
)

ALONE = np.int64(-1)  # no second lane
LONGEST = 2.0**500  # step in units of an impact


@inlined
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


@inlined
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
        return rise_of_lanes(tables, n, h, 1.0, z, ALONE, 0.0, work), TOUCH
    released = math.inf
    if not (c[z] >= 0.0 and low > 0.0):
        released = rise_of_lanes(tables, n, h, -1.0, z, ALONE, 0.0, work)
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


@inlined
def mismatch(at: Any, left: bool, right: bool) -> float:
    """Difference between the expanded product w_l w_r, or w w, and the product of the expanded factors."""
    return abs(at[CHECK] - (at[Z_L] if left else at[Z_R]) * (at[Z_R] if right else at[Z_L]))


@kernel
def stretch(c: Any, n: int, span: float, left: bool, right: bool, allowed: float, at: Any) -> float:
    """Step of a series whose tail has vanished, at rest or by underflow: to the end of the span, or while it agrees."""
    h = 1.0
    values(c, n, h, at)
    while at[TIME] < span and h < LONGEST:
        values(c, n, 2.0 * h, at)
        if not mismatch(at, left, right) <= allowed:
            break
        h *= 2.0
    values(c, n, h, at)
    return h


@inlined
def contact_step(tables: Any, bodies: Any, pairs: Any, y: Any, mode: Any, pace: float, span: float, tolerance: float,
                 n: int, work: Any) -> Any:
    """Expand the series at y; returns an accepted step in s / unit, and the unit. tables.at: values at its end.

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
        w_l, v_l = scales(bodies, pairs, y, mode, LEFT, pace)
    if right:
        c[Z_R] = math.sqrt(y[U_L + 1])
        w_r, v_r = scales(bodies, pairs, y, mode, RIGHT, pace)
    # The unit of s makes the radius of convergence about 1: coefficients must not leave the range of numbers.
    unit = 1.0 / max(v_l * w_r / w_l, v_r * w_l / w_r, 2.0 * w_l * w_r * pace)
    if left and right:
        expand_both(c, tables.f, bodies, pairs, unit, n)
    else:
        expand_one(c, tables.f, bodies, pairs, LEFT if left else RIGHT, unit, n)
    h = step_size(c, left, right, w_l, w_r, max(v_l, v_r), n, tolerance)
    allowed = (100.0 * tolerance + 100.0 * EPS) * (w_l * w_r if left and right else (w_l * w_r) ** 2)
    if h == math.inf:
        return stretch(c, n, span, left, right, allowed, at), unit
    for _ in range(60):
        values(c, n, h, at)
        if mismatch(at, left, right) <= allowed:
            return h, unit
        work[2] += 1
        h *= 0.7
    return math.nan, unit


@inlined
def penetration(z: float, touching: bool) -> float:
    """u of a pair from its lane; w^2, never negative, in contact."""
    return z * z if touching else z


@inlined
def write_state(at: Any, left: bool, right: bool, y: Any) -> None:
    """Positions and velocities from the values of the lanes."""
    y[X_L], y[V_L] = at[X_O] + penetration(at[Z_L], left), at[V_L]
    y[X_O], y[V_O] = at[X_O], at[V_O]
    y[X_R], y[V_R] = at[X_O] - penetration(at[Z_R], right), at[V_R]


@inlined
def deliver_contact(tables: Any, left: bool, right: bool, unit: float, s: float, t: float, n: int, clock: Any,
                    grid: Any, out: Any, filled: Any) -> None:
    """Write the states at the output times before the end of a Taylor step, at s and after the time t."""
    at = tables.at
    row = filled[GRID]
    while row < grid.shape[0]:
        tau = (grid[row] - clock[0]) - clock[1]
        if not tau < t:
            break
        values(tables.c, n, invert_time(tables.c, n, unit, tau, s, t, left, right, at), at)
        write_state(at, left, right, out[row])
        row += 1
    filled[GRID] = row


@inlined
def contact_segment(tables: Any, bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any, pace: float, clock: Any,
                    span: float, tolerance: float, n: int, grid: Any, out: Any, events: Any, filled: Any,
                    work: Any) -> float:
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
    s_o, following = math.inf, FREE
    if mode[OBJECT] != FREE:
        s_o, following = contact_slide(tables, pairs, friction, mode, n, h, work)
    if math.isnan(h) or math.isnan(s_l) or math.isnan(s_r) or math.isnan(s_o):
        return math.nan
    s = min(h, s_l, s_r, s_o)
    if s < h:
        values(c, n, s, at)
    t = at[TIME]
    if t > span:
        s = invert_time(c, n, unit, span, s, t, left, right, at)
        t = span
        values(c, n, s, at)
    write_state(at, left, right, y)
    y[U_L], y[U_L + 1] = penetration(at[Z_L], left), penetration(at[Z_R], right)
    deliver_contact(tables, left, right, unit, s, t, n, clock, grid, out, filled)
    tick(clock, t)
    if s_l <= s * TOGETHER:
        fire(y, mode, LEFT, kind_l, clock[0], events, filled)
    if s_r <= s * TOGETHER:
        fire(y, mode, RIGHT, kind_r, clock[0], events, filled)
    if s_o <= s * TOGETHER:
        fire_slide(bodies, pairs, friction, y, mode, following, clock[0], events, filled)
    return t

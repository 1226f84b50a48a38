"""The begin of a contact that the regularised time cannot begin: both pairs at u = 0 at once, or one at rest there.

Its series are those of `start_series`. The segment ends where one term of each quantity still decides its sign, so
that nothing happens within it.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.bits import orders_to_one, power_of_two, power_of_two_root
from grasp_ros.exact.clock import tick
from grasp_ros.exact.friction import push_on_object
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, keep_resting, reduced_mass
from grasp_ros.exact.observer import leave_step, notify
from grasp_ros.exact.outputs import due, write_row
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.records import Array, Integers, Output, Plant, Settings, Start, State, Tables
from grasp_ros.exact.rest import NEVER, UNDECIDED, is_negligible, leaning, time_of_impulse
from grasp_ros.exact.start_series import NONE, POWERS, damped_leads, expand_start, first_of, force_of, leads, reach_of
from grasp_ros.physics.layout import (
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LANES,
    LEFT,
    OBJECT,
    RIGHT,
    U_L,
    U_R,
    V_O,
    X_L,
    X_O,
    X_R,
    Body,
    Filled,
    Pair,
    Segment,
    Slide,
    Work,
)

ORDER = np.int64(72)  # of the series: the force of a pair appears at s^(3a/2), and acts on itself every a/2 + 8 orders
HALVINGS = 30
NOTHING = 2.0**-500  # of its impulse: a pair that has just touched stands at u = 0
FITS, MOST, MAX_SCALES = 4.0, 16, 100  # of the reach, and binary orders by which the time scale is changed at once


@inlined
def must_start(state: State) -> bool:
    """Whether a pair in contact stands where only this segment can begin."""
    y, mode = state.y, state.mode
    left = mode[LEFT] == Pair.CONTACT and y[U_L] == 0.0
    right = mode[RIGHT] == Pair.CONTACT and y[U_R] == 0.0
    return (left and (right or approach(y, LEFT) == 0.0)) or (right and approach(y, RIGHT) == 0.0)


@kernel
def power_of(plant: Plant, state: State, side: Body) -> int:
    """a of a pair in contact, u = s^a U; -a of one that parts from rest; otherwise NONE."""
    y, mode = state.y, state.mode[side]
    if mode not in (Pair.CONTACT, Pair.OPEN):
        return NONE
    if y[U_L + side] != 0.0 or approach(y, side) != 0.0:
        if mode == Pair.OPEN:
            return NONE
        return 0 if y[U_L + side] > 0.0 else POWERS
    order, value = leaning(plant, state, side)
    if order in (NEVER, UNDECIDED):
        return NONE
    return int(POWERS * order) if value > 0.0 else -int(POWERS * order)


@kernel
def time_scale(plant: Plant, state: State, settings: Settings) -> float:
    """A power of two near the time T, in s, within which a contact shows: the force has turned or damped its pair."""
    y = state.y
    scale = 1.0 / settings.rate if settings.rate > 0.0 else math.inf
    for side in (LEFT, RIGHT):
        if state.mode[side] != Pair.CONTACT:
            continue
        u, d = y[U_L + side], approach(y, side)
        per_hertz, loss = reduced_mass(plant.bodies, side) / plant.pairs[side, HERTZIAN], plant.pairs[side, DISSIPATION]
        if u > 0.0:
            scale = min(scale, power_of_two_root(per_hertz / math.sqrt(u), 2))
            if d != 0.0:
                scale = min(scale, power_of_two_root(u / abs(d), 1))
            if loss > 0.0:
                scale = min(scale, power_of_two_root(per_hertz / (loss * u * math.sqrt(u)), 1))
        elif d > 0.0:
            scale = min(scale, time_of_impulse(per_hertz, loss, 1.0, d))
        else:
            order, value = leaning(plant, state, side)
            if value < math.inf:
                scale = min(scale, time_of_impulse(per_hertz, loss, order, value / math.gamma(order + 1.0)))
    return scale


@kernel
def is_quiet(start: Start, plant: Plant, state: State, n: int, left: int, right: int, h: float) -> bool:
    """Whether no event can happen in (0, h]: in each quantity one term decides the sign."""
    c, mode = start.c, state.mode
    for side in (LEFT, RIGHT):
        lane, a = U_L + side, left if side == LEFT else right
        if mode[side] in (Pair.RESTING, Pair.ABSENT):
            continue
        first = first_of(c, n, lane) if a < 0 else a
        if not leads(c, n, lane, first, h, a > 0):
            return False
        if (a == 0 or mode[side] == Pair.CLAMPED) and not damped_leads(c, plant, n, side, h):
            return False
    if mode[OBJECT] == Slide.STUCK:
        total = 0.0
        for k in range(n - POWERS, -1, -1):  # of the last orders no force is known
            total = total * h + plant.pairs[LEFT, HERTZIAN] * abs(force_of(start.f, n, k, LEFT, left))
            total += plant.pairs[RIGHT, HERTZIAN] * abs(force_of(start.f, n, k, RIGHT, right))
        return total <= plant.coulomb - abs(plant.given[OBJECT, FORCE])
    return mode[OBJECT] == Slide.FREE or leads(c, n, V_O, first_of(c, n, V_O), h, False)


@kernel
def scaled_series(tables: Tables, plant: Plant, state: State, settings: Settings, left: int, right: int
                  ) -> tuple[float, float]:
    """Expand in a time scale that fits; returns it, and how far the series reach in s."""
    scale = time_scale(plant, state, settings)
    n, tail = ORDER, 2 * POWERS + max(left, right, 0) // 2
    reach, doubt = 0.0, push_on_object(plant, state).noise
    for _ in range(MAX_SCALES):
        expand_start(tables.start, plant, state.y, n, left, right, scale, doubt)
        reach = reach_of(tables.start.c, n, settings, tail)
        if 1.0 / FITS < reach < FITS or reach == math.inf:
            break
        scale *= power_of_two(POWERS * orders_to_one(reach, MOST))
    return scale, reach


@inlined
def place(at: Array, mode: Integers) -> None:
    """Positions of the arms in contact from those of the object and from u."""
    if mode[LEFT] == Pair.CONTACT:
        at[X_L] = at[X_O] + at[U_L]
    if mode[RIGHT] == Pair.CONTACT:
        at[X_R] = at[X_O] - at[U_R]


@kernel
def start_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """From u = 0 to where the regularised time goes on, or to the end of the span; returns the time in s."""
    out.work[Work.CONTACT_STEPS] += 1
    at, n = tables.at, ORDER
    for side in (LEFT, RIGHT):
        u, d = state.y[U_L + side], approach(state.y, side)
        if state.mode[side] == Pair.CONTACT and d > 0.0 and is_negligible(plant, side, u, d, NOTHING):
            state.y[U_L + side] = 0.0
    left, right = power_of(plant, state, LEFT), power_of(plant, state, RIGHT)
    scale, reach = scaled_series(tables, plant, state, settings, left, right)
    whole = math.sqrt(math.sqrt(span / scale))
    h = min(reach, whole)
    for _ in range(HALVINGS):
        if is_quiet(tables.start, plant, state, n, left, right, h):
            break
        h *= 0.5
    t = span if h == whole else scale * ((h * h) * (h * h))
    tau = due(state, out)
    while tau < t:
        values(tables.start.c, n, math.sqrt(math.sqrt(tau / scale)), at)
        place(at, state.mode)
        write_row(out, out.filled[Filled.OUTPUTS], at)
        out.filled[Filled.OUTPUTS] += 1
        tau = due(state, out)
    values(tables.start.c, n, h, at)
    place(at, state.mode)
    for lane in range(LANES):
        state.y[lane] = at[lane]
    keep_resting(state)
    tick(state.clock, t)
    leave_step(tables, h, scale)
    notify(out, Segment.START, t)
    return t

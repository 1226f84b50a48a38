"""The begin of a contact that the regularised time cannot begin: both pairs at u = 0 at once, or one at rest there.

Its series are those of `start_series`. The segment ends where one term of each quantity still decides its sign, so
that nothing happens within it, or where the other pair touches or parts.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.bits import orders_to_one, power_of_two
from grasp_ros.exact.clock import tick
from grasp_ros.exact.friction import push_on_object
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, keep_resting
from grasp_ros.exact.modes import make_transitions, mode_of, settle
from grasp_ros.exact.observer import leave_step, notify
from grasp_ros.exact.outputs import due, write_row
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.records import (
    Array,
    Candidate,
    Integers,
    Output,
    Plant,
    Settings,
    SlideCandidate,
    Start,
    State,
    Tables,
)
from grasp_ros.exact.rest import is_negligible
from grasp_ros.exact.roots import first_rise
from grasp_ros.exact.start_scales import holding_time, own_power, power_of, time_scale
from grasp_ros.exact.start_series import (
    ALIKE,
    NONE,
    POWERS,
    damped_leads,
    expand_start,
    first_of,
    force_of,
    leads,
    reach_of,
)
from grasp_ros.exact.sums import forget
from grasp_ros.physics.layout import (
    EPS,
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
    Transition,
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


@inlined
def passes_zero(state: State, side: Body, power: int) -> bool:
    """Whether a pair may touch, or part: none that its own force begins to press, and none that moves alike."""
    mode = state.mode[side]
    if mode == Pair.CONTACT:
        return bool(power <= 0 and power != NONE and power != ALIKE)
    return bool(mode in (Pair.CLAMPED, Pair.LEAVING) or (mode == Pair.OPEN and power != ALIKE))


@kernel
def event_beside(tables: Tables, state: State, side: Body, power: int, n: int, h: float, work: Integers) -> Candidate:
    """The touch or the release of a pair in (0, h]."""
    is_open = state.mode[side] == Pair.OPEN
    kind = Transition.TOUCH if is_open else Transition.RELEASE
    if not passes_zero(state, side, power):
        return Candidate(math.inf, kind)
    for k in range(n + 1):
        u = tables.start.c[LANES * k + U_L + side]
        tables.f[k] = u if is_open else -u
    return Candidate(first_rise(tables.f, n, h, EPS * abs(state.y[U_L + side]), work), kind)


@kernel
def is_quiet(start: Start, plant: Plant, state: State, n: int, left: int, right: int, h: float) -> bool:
    """Whether no event of a pair can happen in (0, h]: in each quantity one term decides the sign."""
    c, mode = start.c, state.mode
    for side in (LEFT, RIGHT):
        lane, a = U_L + side, left if side == LEFT else right
        if mode[side] in (Pair.RESTING, Pair.ABSENT):
            continue
        first = first_of(c, n, lane) if a < 0 else a
        if not (passes_zero(state, side, a) or leads(c, n, lane, first, h, a > 0)):
            return False
        reaches = mode[side] == Pair.CLAMPED or (mode[side] == Pair.CONTACT and a <= 0)  # -1/p; not with a > 0
        if reaches and not damped_leads(c, plant, n, side, h):
            return False
    return True


@kernel
def keeps_sliding(start: Start, plant: Plant, state: State, n: int, left: int, right: int, h: float) -> bool:
    """Whether no event of the object can happen in (0, h]: its velocity has one sign, or its friction holds it."""
    if state.mode[OBJECT] != Slide.STUCK:
        return state.mode[OBJECT] == Slide.FREE or leads(start.c, n, V_O, first_of(start.c, n, V_O), h, False)
    push = change = 0.0
    for k in range(n - POWERS, -1, -1):  # of the last orders no force is known
        push = plant.pairs[LEFT, HERTZIAN] * force_of(start.f, n, k, LEFT, left)
        push -= plant.pairs[RIGHT, HERTZIAN] * force_of(start.f, n, k, RIGHT, right)
        change = (change + abs(push)) * h if k > 0 else change
    return change <= plant.coulomb - abs(push + plant.given[OBJECT, FORCE])


@kernel
def scaled_series(tables: Tables, plant: Plant, state: State, settings: Settings, left: int, right: int
                  ) -> tuple[float, float]:
    """Expand in a time scale that fits; returns it, and how far the series reach in s."""
    scale, orders = time_scale(plant, state, settings), 0
    n, tail = ORDER, 2 * POWERS + max(left, right, 0) // 2
    reach, doubt = 0.0, push_on_object(plant, state).noise
    for _ in range(MAX_SCALES):
        scale *= power_of_two(POWERS * orders)
        expand_start(tables.start, plant, state.y, n, left, right, scale, doubt)
        reach = reach_of(tables.start.c, n, settings, tail)
        if 1.0 / FITS < reach < FITS or reach == math.inf:
            break
        orders = orders_to_one(reach, MOST)
    return scale, reach


@inlined
def place(at: Array, mode: Integers) -> None:
    """Positions of the arms in contact from those of the object and from u."""
    if mode[LEFT] == Pair.CONTACT:
        at[X_L] = at[X_O] + at[U_L]
    if mode[RIGHT] == Pair.CONTACT:
        at[X_R] = at[X_O] - at[U_R]


@kernel
def quiet_length(tables: Tables, plant: Plant, state: State, n: int, left: int, right: int, longest: float) -> float:
    """Length in s, at most `longest`, without an event but for those of `event_beside`.

    Where a quantity is at its limit within rounding none is short enough.
    """
    h = longest
    for _ in range(HALVINGS):
        if is_quiet(tables.start, plant, state, n, left, right, h) and keeps_sliding(
                tables.start, plant, state, n, left, right, h):
            return h
        h = 0.5 * h if h <= FITS else max(math.sqrt(h), FITS)  # series that end have no reach
    return h


@inlined
def deliver(tables: Tables, state: State, scale: float, t: float, n: int, out: Output) -> None:
    """Write the states at the output times before the end t of the segment."""
    tau = due(state, out)
    while tau < t:
        values(tables.start.c, n, math.sqrt(math.sqrt(tau / scale)), tables.at)
        place(tables.at, state.mode)
        write_row(out, out.filled[Filled.OUTPUTS], tables.at)
        out.filled[Filled.OUTPUTS] += 1
        tau = due(state, out)


@inlined
def stand_at_zero(plant: Plant, state: State, side: Body) -> None:
    """Set u = 0 of a pair that has just touched."""
    u, d = state.y[U_L + side], approach(state.y, side)
    if state.mode[side] == Pair.CONTACT and d > 0.0 and is_negligible(plant, side, u, d, NOTHING):
        state.y[U_L + side] = 0.0


@inlined
def open_if_parting(state: State, side: Body, power: int, out: Output) -> None:
    """A pair that was pressed by no more than the other one has just lost, where that stands at u = 0, is open."""
    if state.mode[side] == Pair.CONTACT and power < NONE:
        settle(state, side, Pair.OPEN, out)


@kernel
def start_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """From u = 0 to where the regularised time goes on, an event beside or the end of a span; its time in s, or nan."""
    out.work[Work.CONTACT_STEPS] += 1
    n = ORDER
    stand_at_zero(plant, state, LEFT)
    stand_at_zero(plant, state, RIGHT)
    left, right = power_of(plant, state, LEFT), power_of(plant, state, RIGHT)
    open_if_parting(state, LEFT, left, out)
    open_if_parting(state, RIGHT, right, out)
    scale, reach = scaled_series(tables, plant, state, settings, left, right)
    held = holding_time(plant, state, settings)
    if held > 0.0 and (reach == math.inf or held > scale * (reach * reach) * (reach * reach)):
        left, right = own_power(plant, state, LEFT), own_power(plant, state, RIGHT)
        scale, reach = scaled_series(tables, plant, state, settings, left, right)
        reach = min(reach, math.sqrt(math.sqrt(held / scale)))
    whole = math.sqrt(math.sqrt(span / scale))
    h = quiet_length(tables, plant, state, n, left, right, min(reach, whole))
    beside_l = event_beside(tables, state, LEFT, left, n, h, out.work)
    beside_r = event_beside(tables, state, RIGHT, right, n, h, out.work)
    if math.isnan(beside_l.when) or math.isnan(beside_r.when):
        return math.nan
    h = min(h, beside_l.when, beside_r.when)
    t = span if h == whole else scale * ((h * h) * (h * h))
    deliver(tables, state, scale, t, n, out)
    values(tables.start.c, n, h, tables.at)
    place(tables.at, state.mode)
    for lane in range(LANES):
        state.y[lane] = tables.at[lane]
    keep_resting(state)
    forget(state)
    tick(state.clock, t)
    leave_step(tables, h, scale)
    notify(out, Segment.START, t)
    make_transitions(plant, state, beside_l, beside_r, SlideCandidate(math.inf, Slide.FREE), h, out)
    for side, power in ((LEFT, left), (RIGHT, right)):
        if power == ALIKE:
            settle(state, side, mode_of(plant, state, side), out)
    return t

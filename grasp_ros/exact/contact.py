"""A segment in contact: one Taylor step with its events and its outputs."""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.beside import end_beside, free_flight, part_beside, place_beside, placing
from grasp_ros.exact.clock import tick
from grasp_ros.exact.friction import slide_in_contact
from grasp_ros.exact.impact import damping_factor
from grasp_ros.exact.jit import inlined
from grasp_ros.exact.kinematics import keep_resting, rate_lanes
from grasp_ros.exact.modes import TOGETHER, make_transitions
from grasp_ros.exact.observer import leave_orders, leave_step, notify
from grasp_ros.exact.outputs import due
from grasp_ros.exact.polynomial import NOISE, invert_time, lane_range, values_and_ways
from grasp_ros.exact.records import (
    Array,
    Candidate,
    Flight,
    Integers,
    Output,
    Placing,
    Plant,
    Settings,
    SlideCandidate,
    State,
    Step,
    Tables,
)
from grasp_ros.exact.roots import first_rise
from grasp_ros.exact.scales import new_step, within_decay
from grasp_ros.exact.sums import add_ways
from grasp_ros.exact.taylor_step import accepted_length, fitted_step
from grasp_ros.physics.layout import (
    DISSIPATION,
    EPS,
    LANES,
    LEFT,
    OBJECT,
    RIGHT,
    TIME,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Z_L,
    Z_R,
    Body,
    Filled,
    Pair,
    Segment,
    Slide,
    Transition,
    Work,
)

ALONE = np.int64(-1)  # no second lane
CANCELS = 16.0  # times u' at either end: terms so large leave their roundings in what a relaxation ends with


@inlined
def rise_of_lanes(tables: Tables, n: int, h: float, factor: float, front: int, back: int, offset: float, work: Integers
                  ) -> float:
    """First s in (0, h] at which offset + factor (c_front - c_back) rises through zero; back < 0: without it."""
    c, row = tables.c, tables.row
    for k in range(n + 1):
        i = LANES * k
        row[k] = factor * (c[i + front] - c[i + back] if back >= 0 else c[i + front])
    row[0] += offset
    noise = abs(c[front]) + abs(c[back]) if back >= 0 else abs(c[front])
    return first_rise(row, n, h, EPS * (abs(offset) + abs(factor) * noise), work)


@inlined
def pair_candidate(tables: Tables, plant: Plant, state: State, n: int, side: Body, h: float, work: Integers
                   ) -> Candidate:
    """First event of one pair within a Taylor step of length h.

    Most steps have none, and the ranges of the lanes prove it.
    """
    mode, c = state.mode[side], tables.c
    if mode in (Pair.RESTING, Pair.ABSENT):
        return Candidate(math.inf, Transition.TOUCH)
    z = Z_L + side
    low, high = lane_range(tables, z, h)
    if mode == Pair.OPEN:
        if c[z] <= 0.0 and high < 0.0:
            return Candidate(math.inf, Transition.TOUCH)
        return Candidate(rise_of_lanes(tables, n, h, 1.0, z, ALONE, 0.0, work), Transition.TOUCH)
    released = math.inf
    if not (c[z] >= 0.0 and low > 0.0):
        released = rise_of_lanes(tables, n, h, -1.0, z, ALONE, 0.0, work)
        if math.isnan(released):
            return Candidate(released, Transition.RELEASE)
    crossed, kind = surface_candidate(tables, plant, state, n, side, min(h, released), work)
    return Candidate(released, Transition.RELEASE) if crossed >= released else Candidate(crossed, kind)


@inlined
def surface_candidate(tables: Tables, plant: Plant, state: State, n: int, side: Body, h: float, work: Integers
                      ) -> tuple[float, Transition]:
    """First s in (0, h] at which u' crosses -1/p, down out of contact or up back into it; inf if there is none."""
    mode, c = state.mode[side], tables.c
    loss = plant.pairs[side, DISSIPATION]
    front, back = rate_lanes(side)
    if mode == Pair.CONTACT and loss > 0.0:
        slowest = lane_range(tables, front, h)[0] - lane_range(tables, back, h)[1]
        if damping_factor(loss, c[front] - c[back]) >= 0.0 and damping_factor(loss, slowest) > NOISE:
            return math.inf, Transition.CLAMP
        return rise_of_lanes(tables, n, h, -loss, front, back, -1.0, work), Transition.CLAMP
    if mode == Pair.CLAMPED:
        return rise_of_lanes(tables, n, h, loss, front, back, 1.0, work), Transition.REENTRY
    return math.inf, Transition.CLAMP


@inlined
def is_blurred(tables: Tables, plant: Plant, n: int, side: Body, candidate: Candidate, s: float) -> bool:
    """Whether u' crosses -1/p at s, where it has the roundings of terms far larger than itself."""
    if candidate.when > s * TOGETHER or candidate.what not in (Transition.CLAMP, Transition.REENTRY):
        return False
    (front, back), slow, total = rate_lanes(side), 1.0 / plant.pairs[side, DISSIPATION], 0.0
    for k in range(n, -1, -1):
        total = total * s + abs(tables.c[LANES * k + front] - tables.c[LANES * k + back])
    return total > CANCELS * max(abs(tables.c[front] - tables.c[back]), slow)


@inlined
def clear_end(tables: Tables, plant: Plant, n: int, left: Candidate, right: Candidate, h: float) -> float:
    """Where a step of length h ends for its pairs: at their first event, or half-way if that is blurred from here."""
    s = min(h, left.when, right.when)
    if s < h and (is_blurred(tables, plant, n, LEFT, left, s) or is_blurred(tables, plant, n, RIGHT, right, s)):
        s *= 0.5
    return s


@inlined
def penetration(z: float, touching: bool) -> float:
    """u of a pair from its lane; w^2, never negative, in contact."""
    return z * z if touching else z


@inlined
def write_state(at: Array, x_o: float, u_l: float, u_r: float, y: Array) -> None:
    """Positions and velocities from x_o and u, and from the values of the lanes."""
    y[X_L], y[V_L] = x_o + u_l, at[V_L]
    y[X_O], y[V_O] = x_o, at[V_O]
    y[X_R], y[V_R] = x_o - u_r, at[V_R]


@inlined
def deliver(tables: Tables, step: Step, s: float, t: float, how: tuple[Placing, Placing], free: tuple[Flight, Flight],
            state: State, out: Output) -> None:
    """Write the states at the output times before the end of a Taylor step, at s and after the time t."""
    at = tables.at
    tau = due(state, out)
    while tau < t:
        row = out.rows[out.filled[Filled.OUTPUTS]]
        values_and_ways(tables.c, step.order.number, invert_time(tables, step, tau, s, t), at)
        write_state(at, at[X_O], penetration(at[Z_L], step.left), penetration(at[Z_R], step.right), row)
        place_beside(at, how, free, tau, row)
        out.filled[Filled.OUTPUTS] += 1
        tau = due(state, out)


@inlined
def contact_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """One Taylor step to its first event, whose transitions it makes, or to the end of the span; its time, or nan."""
    out.work[Work.CONTACT_STEPS] += 1
    c, at, y, mode = tables.c, tables.at, state.y, state.mode
    span = within_decay(plant, mode, span)
    step, h = fitted_step(tables, plant, state, settings, new_step(plant, state, settings, span), span)
    n = step.order.number
    h = accepted_length(tables, step, h, settings, out.work)
    left = pair_candidate(tables, plant, state, n, LEFT, h, out.work)
    right = pair_candidate(tables, plant, state, n, RIGHT, h, out.work)
    if math.isnan(h) or math.isnan(left.when) or math.isnan(right.when):
        return math.nan
    s = clear_end(tables, plant, n, left, right, h)
    if s < h:
        values_and_ways(c, n, s, at)
    slide = SlideCandidate(math.inf, Slide.FREE)
    if mode[OBJECT] != Slide.FREE:
        slide = slide_in_contact(tables, plant, state, n, s, out.work)
    if math.isnan(slide.when):
        return math.nan
    if slide.when <= s:  # the search for it has left another state in `at`
        s = slide.when
        values_and_ways(c, n, s, at)
    t = at[TIME]
    if t > span:
        s = invert_time(tables, step, span, s, t)
        t = span
        values_and_ways(c, n, s, at)
    how = (placing(tables, plant, y, LEFT, step.left, s, t), placing(tables, plant, y, RIGHT, step.right, s, t))
    free = (free_flight(plant, y, LEFT, how[0]), free_flight(plant, y, RIGHT, how[1]))
    add_ways(state, at, step.left, step.right)
    write_state(at, y[X_O], y[U_L], y[U_R], y)
    end_beside(state, at, how, free, t)
    part_beside(plant, how, free, t, state)
    keep_resting(state)
    deliver(tables, step, s, t, how, free, state, out)
    tick(state.clock, t)
    leave_step(tables, s, step.unit)
    leave_orders(tables, n, out)
    notify(out, Segment.CONTACT, t)
    make_transitions(plant, state, left, right, slide, s, out)
    return t

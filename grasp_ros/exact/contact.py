"""A segment in contact: one Taylor step with its acceptance, its events and its outputs."""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.clock import tick, until
from grasp_ros.exact.friction import slide_in_contact
from grasp_ros.exact.impact import damping_factor
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import rate_lanes
from grasp_ros.exact.modes import make_transitions
from grasp_ros.exact.polynomial import NOISE, curvatures, first_rise, invert_time, lane_range, values
from grasp_ros.exact.records import (
    Array,
    Candidate,
    Integers,
    Output,
    Plant,
    Scale,
    Settings,
    SlideCandidate,
    State,
    Step,
    Tables,
)
from grasp_ros.exact.scales import scales
from grasp_ros.exact.series import expand_both, expand_one, step_size
from grasp_ros.physics.layout import (
    CHECK,
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
    Slide,
    Transition,
    Work,
)

ALONE = np.int64(-1)  # no second lane
LONGEST = 2.0**500  # step in units of an impact


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
    if mode == Pair.BALLISTIC or mode == Pair.ABSENT:
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
def defect(at: Array, step: Step) -> float:
    """Difference between the expanded product w_l w_r, or w w, and the product of the expanded factors."""
    return abs(at[CHECK] - (at[Z_L] if step.left else at[Z_R]) * (at[Z_R] if step.right else at[Z_L]))


@kernel
def vanished_step(tables: Tables, step: Step, span: float, allowed: float) -> float:
    """Step of a series whose tail has vanished, at rest or by underflow: to the end of the span, or while it agrees."""
    c, at, n = tables.c, tables.at, step.order
    h = 1.0
    values(c, n, h, at)
    while at[TIME] < span and h < LONGEST:
        values(c, n, 2.0 * h, at)
        if not defect(at, step) <= allowed:
            break
        h *= 2.0
    values(c, n, h, at)
    return h


@inlined
def begin_series(tables: Tables, plant: Plant, state: State, settings: Settings) -> tuple[Step, Scale]:
    """Write order 0 of the series; returns what they stand for, and the scales of the impact."""
    c, y = tables.c, state.y
    left, right = state.mode[LEFT] == Pair.CONTACT, state.mode[RIGHT] == Pair.CONTACT
    for lane in range(LANES):
        c[lane] = y[lane]
    c[TIME] = 0.0
    w_l, v_l, w_r, v_r = 1.0, 0.0, 1.0, 0.0
    if left:
        c[Z_L] = math.sqrt(y[U_L])
        w_l, v_l = scales(plant, state, settings, LEFT)
    if right:
        c[Z_R] = math.sqrt(y[U_R])
        w_r, v_r = scales(plant, state, settings, RIGHT)
    # The unit of s makes the radius of convergence about 1: coefficients must not leave the range of numbers.
    unit = 1.0 / max(v_l * w_r / w_l, v_r * w_l / w_r, 2.0 * w_l * w_r * settings.rate)
    return Step(settings.order, unit, left, right), Scale(w_l, w_r, max(v_l, v_r))


@inlined
def accepted_length(tables: Tables, step: Step, scale: Scale, settings: Settings, span: float, work: Integers) -> float:
    """Length in units of a step that is exact enough, or nan; the values at its end are left in `tables.at`.

    G = w_l w_r, or u = w^2 with one side in contact, is expanded beside w: the defect at the end of the step consists
    of neglected terms only and decides whether the step is accepted. Shortening it costs no new expansion.
    """
    c, n, left, right = tables.c, step.order, step.left, step.right
    h = step_size(c, left, right, scale.w_l, scale.w_r, scale.v, n, settings.tolerance)
    product = scale.w_l * scale.w_r
    allowed = (100.0 * settings.tolerance + 100.0 * EPS) * (product if left and right else product**2)
    if h == math.inf:
        return vanished_step(tables, step, span, allowed)
    for _ in range(60):
        values(c, n, h, tables.at)
        if defect(tables.at, step) <= allowed:
            return h
        work[Work.REJECTED_STEPS] += 1
        h *= 0.7
    return math.nan


@inlined
def penetration(z: float, touching: bool) -> float:
    """u of a pair from its lane; w^2, never negative, in contact."""
    return z * z if touching else z


@inlined
def write_state(at: Array, step: Step, y: Array) -> None:
    """Positions and velocities from the values of the lanes."""
    y[X_L], y[V_L] = at[X_O] + penetration(at[Z_L], step.left), at[V_L]
    y[X_O], y[V_O] = at[X_O], at[V_O]
    y[X_R], y[V_R] = at[X_O] - penetration(at[Z_R], step.right), at[V_R]


@inlined
def deliver(tables: Tables, step: Step, s: float, t: float, state: State, out: Output) -> None:
    """Write the states at the output times before the end of a Taylor step, at s and after the time t."""
    at = tables.at
    row = out.filled[Filled.OUTPUTS]
    while row < out.grid.shape[0]:
        tau = until(state.clock, out.grid[row])
        if not tau < t:
            break
        values(tables.c, step.order, invert_time(tables, step, tau, s, t), at)
        write_state(at, step, out.rows[row])
        row += 1
    out.filled[Filled.OUTPUTS] = row


@inlined
def contact_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """One Taylor step to its first event, whose transitions it makes, or to the end of the span; its time, or nan."""
    out.work[Work.CONTACT_STEPS] += 1
    c, at, y, n = tables.c, tables.at, state.y, settings.order
    step, scale = begin_series(tables, plant, state, settings)
    if step.left and step.right:
        expand_both(c, tables.f, plant.bodies, plant.pairs, step.unit, n)
    else:
        expand_one(c, tables.f, plant.bodies, plant.pairs, LEFT if step.left else RIGHT, step.unit, n)
    h = accepted_length(tables, step, scale, settings, span, out.work)
    curvatures(c, n, h, tables.size)
    left = pair_candidate(tables, plant, state, n, LEFT, h, out.work)
    right = pair_candidate(tables, plant, state, n, RIGHT, h, out.work)
    slide = SlideCandidate(math.inf, Slide.FREE)
    if state.mode[OBJECT] != Slide.FREE:
        slide = slide_in_contact(tables, plant, state.mode, n, h, out.work)
    if math.isnan(h) or math.isnan(left.when) or math.isnan(right.when) or math.isnan(slide.when):
        return math.nan
    s = min(h, left.when, right.when, slide.when)
    if s < h:
        values(c, n, s, at)
    t = at[TIME]
    if t > span:
        s = invert_time(tables, step, span, s, t)
        t = span
        values(c, n, s, at)
    write_state(at, step, y)
    y[U_L], y[U_R] = penetration(at[Z_L], step.left), penetration(at[Z_R], step.right)
    deliver(tables, step, s, t, state, out)
    tick(state.clock, t)
    make_transitions(plant, state, left, right, slide, s, out)
    return t

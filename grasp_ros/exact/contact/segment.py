"""A segment in contact: one Taylor step in regularised time, its events, and where it ends."""

from __future__ import annotations

import math

from grasp_ros.exact.automaton.begin import leaves_force_out, speed_of_pair
from grasp_ros.exact.automaton.edge import LOWEST, deciding_derivative, other_push
from grasp_ros.exact.automaton.friction import slide_in_contact
from grasp_ros.exact.compensated import add, keep_together, move_arm_in_contact, move_in_flight, velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.flight.closed_form import fly
from grasp_ros.exact.impact import damping_factor
from grasp_ros.exact.kinematics import approach, difference, is_resting, rate_lanes, surface_factor
from grasp_ros.exact.numerics.polynomial import invert_time, lane_range, values
from grasp_ros.exact.numerics.powers_of_two import power_of_two
from grasp_ros.exact.numerics.roots import first_rise
from grasp_ros.exact.records import Array, Candidate, Ends, Flight, Integers, Plant, Segment, State, Tables
from grasp_ros.exact.tolerances import BEYOND, CANCELS, DERIVATIVE, NOISE, SURFACE, TOGETHER
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Pair, Slide, Transition, V, X, Z

MOST_HALVINGS = 64  # of a step


@inlined
def rise_of_rate(tables: Tables, n: int, h: float, factor: float, side: Body, offset: float, work: Integers) -> float:
    """First s in (0, h] at which offset + factor u' of a pair rises through zero."""
    c, row, (front, back) = tables.c, tables.row, rate_lanes(side)
    for k in range(n + 1):
        row[k] = factor * (c[LANES * k + front] - c[LANES * k + back])
    row[0] += offset
    return first_rise(row, n, h, EPS * (abs(offset) + abs(factor) * (abs(c[front]) + abs(c[back]))), work)


@inlined
def pair_candidate(tables: Tables, plant: Plant, state: State, n: int, side: Body, h: float, work: Integers
                   ) -> Candidate:
    """First event of one pair within a Taylor step of length h.

    Most steps have none, and the ranges of the lanes prove it.
    """
    mode, c, size, at = state.mode[side], tables.c, tables.size, tables.at
    if mode in (Pair.RESTING, Pair.ABSENT, Pair.BEGINNING):
        return Candidate(math.inf, Transition.TOUCH)
    z = Z.L + side
    low, high = lane_range(c, size, z, h, at[z])
    if mode == Pair.OPEN:
        if c[z] <= 0.0 and high < 0.0:
            return Candidate(math.inf, Transition.TOUCH)
        return Candidate(crossing_of_depth(tables, plant, state, n, side, h, work), Transition.TOUCH)
    released = math.inf
    if not (c[z] >= 0.0 and low > 0.0):
        released = crossing_of_depth(tables, plant, state, n, side, h, work)
        if math.isnan(released):
            return Candidate(released, Transition.RELEASE)
    crossed, kind = surface_candidate(tables, plant, state, n, side, min(h, released), work)
    return Candidate(released, Transition.RELEASE) if crossed >= released else Candidate(crossed, kind)


@kernel
def crossing_of_depth(tables: Tables, plant: Plant, state: State, n: int, side: Body, h: float, work: Integers
                      ) -> float:
    """First s in (0, h] at which u of an open pair rises through zero, or w or u of a closed one falls.

    Where a pair at u = u' = 0 opens, coefficients that say otherwise before the one that opens it are roundings.
    """
    row, is_open = tables.row, state.mode[side] == Pair.OPEN
    for k in range(n + 1):
        row[k] = tables.c[LANES * k + Z.L + side] if is_open else -tables.c[LANES * k + Z.L + side]
    if is_open and is_resting(state.y, side) and deciding_derivative(plant, state, side).value < 0.0:
        for k in range(n + 1):
            if row[k] < 0.0:
                break
            row[k] = 0.0
    return first_rise(row, n, h, EPS * abs(row[0]), work)


@inlined
def surface_candidate(tables: Tables, plant: Plant, state: State, n: int, side: Body, h: float, work: Integers
                      ) -> tuple[float, Transition]:
    """First s in (0, h] at which u' crosses -1/p, down out of contact or up back into it; inf if there is none."""
    mode, c, size, at = state.mode[side], tables.c, tables.size, tables.at
    loss = plant.pairs[side, Law.DISSIPATION]
    front, back = rate_lanes(side)
    if mode == Pair.CONTACT and loss > 0.0:
        slowest = lane_range(c, size, front, h, at[front])[0] - lane_range(c, size, back, h, at[back])[1]
        if damping_factor(loss, c[front] - c[back]) >= 0.0 and damping_factor(loss, slowest) > NOISE:
            return math.inf, Transition.CLAMP
        beyond = BEYOND * EPS * damping_factor(loss, abs(c[front]) + abs(c[back]))
        offset = -1.0 - beyond if surface_factor(plant.pairs, state.y, side, SURFACE) == 0.0 else -1.0
        return rise_of_rate(tables, n, h, -loss, side, offset, work), Transition.CLAMP
    if mode == Pair.CLAMPED:
        return rise_of_rate(tables, n, h, loss, side, 1.0, work), Transition.REENTRY
    return math.inf, Transition.CLAMP


@inlined
def is_blurred(tables: Tables, plant: Plant, n: int, side: Body, candidate: Candidate, s: float) -> bool:
    """Whether u' crosses -1/p at s, where it has the roundings of terms far larger than itself."""
    if candidate.when > s * TOGETHER or candidate.what not in (Transition.CLAMP, Transition.REENTRY):
        return False
    (front, back), slow, total = rate_lanes(side), 1.0 / plant.pairs[side, Law.DISSIPATION], 0.0
    for k in range(n, -1, -1):
        total = total * s + abs(tables.c[LANES * k + front] - tables.c[LANES * k + back])
    return total > CANCELS * max(abs(tables.c[front] - tables.c[back]), slow)


@inlined
def step_ends(tables: Tables, plant: Plant, state: State, segment: Segment, work: Integers) -> Ends:
    """First events of the pairs and of the object within a step, in its variable."""
    n, h = segment.step.order.number, segment.s
    left = pair_candidate(tables, plant, state, n, LEFT, h, work)
    right = pair_candidate(tables, plant, state, n, RIGHT, h, work)
    slide = Candidate(math.inf, Slide.FREE)
    if math.isnan(h) or math.isnan(left.when) or math.isnan(right.when):
        return Ends(left, right, slide, math.nan)
    s = min(h, left.when, right.when)
    if s < h and (is_blurred(tables, plant, n, LEFT, left, s) or is_blurred(tables, plant, n, RIGHT, right, s)):
        s *= 0.5
    if state.mode[OBJECT] != Slide.FREE:
        if s < h:
            values(tables.c, n, s, tables.at)
        slide = slide_in_contact(tables, plant, state, n, s, work)
    return Ends(left, right, slide, math.nan if math.isnan(slide.when) else min(s, slide.when))


@inlined
def cut_step(tables: Tables, plant: Plant, state: State, segment: Segment, ends: Ends, span: float) -> Segment:
    """Cut a step at its first event, the end of the span, or the end of a force-free begin.

    The values at its end, and the changes of the lanes, are left in `tables.at`.
    """
    c, at, step, s = tables.c, tables.at, segment.step, ends.end
    if math.isnan(s):
        return Segment(segment.kind, math.nan, math.nan, step, segment.flights)
    if s < segment.s or state.mode[OBJECT] != Slide.FREE:  # the search for a slip leaves another state in `at`
        values(c, step.order.number, s, at)
    if state.mode[LEFT] == Pair.BEGINNING or state.mode[RIGHT] == Pair.BEGINNING:
        s = force_free_length(tables, plant, state, step.order.number, s)
        values(c, step.order.number, s, at)
    t = at[Lane.TIME]
    if t > span:
        s, t = invert_time(c, at, step, span, s, t), span
        values(c, step.order.number, s, at)
    return Segment(segment.kind, t, s, step, segment.flights)


@kernel
def force_free_length(tables: Tables, plant: Plant, state: State, n: int, s: float) -> float:
    """Length, at most s, of a step in which the force of a BEGINNING pair is negligible.

    It is doubled from a small one until `may_last` is False: later, a pair may be within the bound again.
    """
    part, left, right = power_of_two(-MOST_HALVINGS), blur(plant, state, LEFT), blur(plant, state, RIGHT)
    while part < 1.0:
        values(tables.c, n, 2.0 * part * s, tables.at)
        if not (may_last(plant, state, LEFT, tables.at, left) and may_last(plant, state, RIGHT, tables.at, right)):
            break
        part *= 2.0
    return part * s


@kernel
def blur(plant: Plant, state: State, side: Body) -> float:
    """Rounding of u'' of a BEGINNING pair at the begin of a step, m/s^2; 0 of any other pair."""
    if state.mode[side] != Pair.BEGINNING:
        return 0.0
    return DERIVATIVE * (difference(plant, state.y, side, LOWEST)[1] + abs(other_push(plant, state, side)[0]))


@inlined
def may_last(plant: Plant, state: State, side: Body, at: Array, blurred: float) -> bool:
    """Whether a BEGINNING pair has neither opened again at the values `at` nor a force that matters there.

    The rounding of u in m and u' in m/s is allowed; `blurred`, that of u'' in m/s^2, adds up over the step.
    """
    if state.mode[side] != Pair.BEGINNING:
        return True
    t, u, d, speed = at[Lane.TIME], at[Z.L + side], approach(at, side), speed_of_pair(at, side)
    least_d = EPS * speed + blurred * t
    least_u = EPS * abs(at[X.O]) + least_d * t
    if abs(u) <= least_u and abs(d) <= least_d:
        return True
    return bool(u >= -least_u and leaves_force_out(plant, side, u, d, speed))


@inlined
def moves_alike(plant: Plant, state: State, side: Body, at: Array, flight: Flight) -> bool:
    """Whether arm and object of a pair at rest have moved alike in a step, but for the rounding of u'' if it begins.

    Their changes are compared: these have smaller roundings.
    """
    if state.mode[side] != Pair.BEGINNING or not is_resting(state.y, side):
        return state.mode[side] == Pair.RESTING
    flown, least, way = fly(flight, at[Lane.TIME]), blur(plant, state, side) * at[Lane.TIME], at[LANES + X.O]
    return bool(abs(flown.change - at[LANES + V.O]) <= least
                and abs(flown.way - way) <= least * at[Lane.TIME] + 2.0 * EPS * abs(way))


@inlined
def move_by_step(tables: Tables, plant: Plant, segment: Segment, state: State) -> None:
    """Move the state to the end of a step, whose values are in `tables.at`; pairs that move alike stay at u = 0."""
    at, step, (left, right, _) = tables.at, segment.step, segment.flights
    alike_l, alike_r = moves_alike(plant, state, LEFT, at, left), moves_alike(plant, state, RIGHT, at, right)
    add(state, X.O, at[LANES + X.O])
    add(state, V.O, at[LANES + V.O])
    for side, pushed, flight, alike in ((LEFT, step.left, left, alike_l), (RIGHT, step.right, right, alike_r)):
        if pushed:
            v, z = velocity_lane(side), Z.L + side
            move_arm_in_contact(state, side, at[LANES + X.O], at[z], at[LANES + z])
            add(state, v, at[LANES + v])
        else:
            move_in_flight(state, side, fly(flight, segment.t))
        if alike:
            keep_together(state, side)


@inlined
def state_in_step(tables: Tables, segment: Segment, tau: float, row: Array) -> None:
    """Write positions and velocities after tau s of a step."""
    c, at, step = tables.c, tables.at, segment.step
    values(c, step.order.number, invert_time(c, at, step, tau, segment.s, segment.t), at)
    row[X.O], row[V.O] = at[X.O], at[V.O]
    if step.left:
        row[X.L], row[V.L] = at[X.O] + at[Z.L] * at[Z.L], at[V.L]
    else:
        row[X.L], row[V.L], _, _ = fly(segment.flights.left, tau)
    if step.right:
        row[X.R], row[V.R] = at[X.O] - at[Z.R] * at[Z.R], at[V.R]
    else:
        row[X.R], row[V.R], _, _ = fly(segment.flights.right, tau)

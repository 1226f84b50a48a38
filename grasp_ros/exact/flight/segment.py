"""A segment of free flight: its events, and where it ends."""

from __future__ import annotations

import math

from grasp_ros.exact.automaton.begin import force_free_time
from grasp_ros.exact.automaton.edge import NEVER, own_difference, parting_time
from grasp_ros.exact.automaton.friction import slide_in_flight
from grasp_ros.exact.compensated import keep_together, move_in_flight
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.flight.closed_form import FLIGHT_ORDER, NO_STEP, expand_flight, flights_of, fly, settling_time
from grasp_ros.exact.flight.search import first_root, motion_at, pair_in_flight
from grasp_ros.exact.kinematics import approach, arm_of, is_resting, next_derivative, own_acceleration
from grasp_ros.exact.numerics.polynomial import values
from grasp_ros.exact.records import Array, Candidate, Ends, Integers, Motion, Plant, Segment, Settings, State, Tables
from grasp_ros.exact.tolerances import STEEP, TOGETHER
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Kind, Of, Pair, Transition, U, V, Work, X


@inlined
def is_far(plant: Plant, y: Array, side: Body, span: float) -> bool:
    """Whether an open pair cannot touch within a span in s, by a bound that costs less than a search.

    The first step of the search reaches beyond the span then: |u''| is no more than the accelerations and what their
    rates add, and a hundredth is more than the roundings of both.
    """
    x, v, _ = arm_of(y, side)
    arm, body = plant.bodies[side], plant.bodies[OBJECT]
    a, a_o = own_acceleration(arm, x, v), own_acceleration(body, y[X.O], y[V.O])
    j, j_o = next_derivative(arm, v, a), next_derivative(body, y[V.O], a_o)
    curvature = abs(a) + abs(a_o) + span * (abs(j) + abs(j_o))
    way = span * (abs(approach(y, side)) + 0.5 * span * curvature)
    return 1.01 * way < -y[U.L + side] and arm[Of.DAMPING] >= 0.0 and body[Of.DAMPING] >= 0.0


@inlined
def pair_candidate(row: Array, plant: Plant, state: State, flight: Segment, side: Body, until: float, work: Integers
                   ) -> tuple[Candidate, float]:
    """First event of one pair in a flight, unless it is later than `until`.

    The second value is the time at which `first_root` gave up.
    """
    mode = state.mode[side]
    if mode in (Pair.RESTING, Pair.ABSENT, Pair.BEGINNING):
        return Candidate(math.inf, Transition.TOUCH), math.inf
    if mode == Pair.OPEN and is_far(plant, state.y, side, flight.t):
        work[Work.ROOT_ITERATIONS] += 1
        return Candidate(math.inf, Transition.TOUCH), math.inf
    return search_pair(row, plant, state, flight, side, until, work)


@kernel
def search_pair(row: Array, plant: Plant, state: State, flight: Segment, side: Body, until: float, work: Integers
                ) -> tuple[Candidate, float]:
    """The same of a pair that is closed, or near enough."""
    mode, y, span = state.mode[side], state.y, flight.t
    pair = pair_in_flight(plant, y, flight.flights, side)
    t, d = 0.0, approach(y, side)
    at = Motion(pair.arm_flight.x, pair.arm_flight.v, pair.body_flight.x, pair.body_flight.v, pair.u, d, abs(pair.u))
    if pair.u == 0.0 and d == 0.0:
        t = parting_time(row, plant, state, side, work)
        if t >= span:
            return Candidate(math.inf, Transition.TOUCH), math.inf
        at = motion_at(pair, t)
    if mode == Pair.OPEN:
        touched, known = first_root(Transition.TOUCH, pair, t, at, span, until, work)
        return Candidate(touched, Transition.TOUCH), known
    latest = math.inf if mode == Pair.CLAMPED else until  # which pair comes first must not set the next search's span
    released, known = first_root(Transition.RELEASE, pair, t, at, span, latest, work)
    if mode == Pair.CLAMPED:
        back, also = first_root(Transition.REENTRY, pair, 0.0, at, min(span, released), until, work)
        known = min(known, also)
        if not back >= released:
            return Candidate(back, Transition.REENTRY), known
    return Candidate(released, Transition.RELEASE), known


@inlined
def fly_free(plant: Plant, state: State, span: float, work: Integers) -> Segment:
    """A flight over the span, or until all has died out, where it may rest."""
    work[Work.FLIGHTS] += 1
    flights = flights_of(plant, state.y, False, False)
    settled = max(settling_time(flights.left, span), settling_time(flights.right, span),
                  settling_time(flights.object, span))
    return Segment(Kind.FLIGHT, settled if 0.0 < settled < span else span, 0.0, NO_STEP, flights)


@inlined
def flight_ends(row: Array, plant: Plant, state: State, segment: Segment, work: Integers) -> Ends:
    """First events of pairs and object in a flight, in s; a search that gives up, or a begin, ends it, too.

    `row` is scratch.
    """
    left, known_l = pair_candidate(row, plant, state, segment, LEFT, math.inf, work)
    right, known_r = pair_candidate(row, plant, state, segment, RIGHT, TOGETHER * left.when, work)
    slide = slide_in_flight(plant, state)
    if math.isnan(left.when) or math.isnan(right.when):
        return Ends(left, right, slide, math.nan)
    known = min(segment.t, left.when, right.when, slide.when, known_l, known_r)
    for side in (LEFT, RIGHT):
        known = min(known, force_free_time(row, plant, state, side))
    return Ends(left, right, slide, known)


@inlined
def move_by_flight(plant: Plant, segment: Segment, state: State) -> None:
    """Move the state on to the end of a flight; pairs that nothing moves stay together."""
    t, (left, right, body) = segment.t, segment.flights
    alike_l, alike_r = moves_alike(plant, state, LEFT), moves_alike(plant, state, RIGHT)
    move_in_flight(state, LEFT, fly(left, t))
    move_in_flight(state, RIGHT, fly(right, t))
    move_in_flight(state, OBJECT, fly(body, t))
    if alike_l:
        keep_together(state, LEFT)
    if alike_r:
        keep_together(state, RIGHT)


@inlined
def moves_alike(plant: Plant, state: State, side: Body) -> bool:
    """Whether arm and object of a pair without force stay together."""
    mode = state.mode[side]
    alone = mode == Pair.BEGINNING and is_resting(state.y, side) and own_difference(plant, state.y, side).order == NEVER
    return mode == Pair.RESTING or alone


@inlined
def state_in_flight(tables: Tables, plant: Plant, segment: Segment, settings: Settings, tau: float, expanded: float
                    ) -> float:
    """Leave the state after tau s of a flight in `tables.at`; returns which part of it the table holds now.

    The tables belong to fixed parts of the flight, so that no state depends on the other output times; `expanded` is
    the part that they hold.
    """
    rate, at = settings.rate, tables.at
    if not rate < STEEP:
        at[X.L], at[V.L], _, _ = fly(segment.flights.left, tau)
        at[X.O], at[V.O], _, _ = fly(segment.flights.object, tau)
        at[X.R], at[V.R], _, _ = fly(segment.flights.right, tau)
        return expanded
    part = math.floor(tau * 2.0 * rate)
    begin = part * (0.5 / rate) if part > 0.0 else 0.0  # exact: the rate is a power of two
    if part != expanded:
        expand_flight(plant.bodies, segment.flights, begin, tables.c)
    values(tables.c, FLIGHT_ORDER, tau - begin, at)
    return part

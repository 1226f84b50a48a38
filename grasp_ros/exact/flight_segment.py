"""A segment of free flight: to its first event or to the end of the span."""

from __future__ import annotations

import math

from grasp_ros.exact.clock import tick
from grasp_ros.exact.flight import FLIGHT_ORDER, expand_flight, flights_of, fly
from grasp_ros.exact.flight_events import first_root, motion_at, pair_in_flight
from grasp_ros.exact.friction import slide_in_flight
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import (
    apart,
    approach,
    arm_of,
    keep_resting,
    next_derivative,
    own_acceleration,
)
from grasp_ros.exact.modes import TOGETHER, make_transitions
from grasp_ros.exact.observer import notify
from grasp_ros.exact.outputs import due, write_row
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.records import Array, Candidate, Flights, Integers, Motion, Output, Plant, Settings, State, Tables
from grasp_ros.exact.rest import parting_time
from grasp_ros.exact.sums import add, put
from grasp_ros.physics.layout import (
    DAMPING,
    LEFT,
    OBJECT,
    RIGHT,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Body,
    Filled,
    Pair,
    Segment,
    Transition,
    Work,
)

TOLD = 2.0**-20  # of a gap
PARTS = 2.0**44  # of a flight, beyond which a rounding of the time may be longer than one
STEEP = 1e16  # rate in 1/s whose powers leave the range of numbers


@inlined
def is_far(plant: Plant, y: Array, side: Body, span: float) -> bool:
    """Whether an open pair cannot touch within a span in s, by a bound that costs less than a search.

    The first step of the search reaches beyond the span then: |u''| is no more than the accelerations and what their
    rates add, and a hundredth is more than the roundings of both.
    """
    x, v, _ = arm_of(y, side)
    arm, body = plant.bodies[side], plant.bodies[OBJECT]
    a, a_o = own_acceleration(arm, x, v), own_acceleration(body, y[X_O], y[V_O])
    j, j_o = next_derivative(arm, v, a), next_derivative(body, y[V_O], a_o)
    curvature = abs(a) + abs(a_o) + span * (abs(j) + abs(j_o))
    way = span * (abs(approach(y, side)) + 0.5 * span * curvature)
    return 1.01 * way < -y[U_L + side] and arm[DAMPING] >= 0.0 and body[DAMPING] >= 0.0


@kernel
def pair_candidate(plant: Plant, state: State, flights: Flights, side: Body, span: float, until: float, work: Integers
                   ) -> tuple[Candidate, float]:
    """First event of one pair in a flight of at most `span` seconds, unless it is later than `until`.

    And the time up to which it is known, as `first_root` says.
    """
    mode, y = state.mode[side], state.y
    if mode in (Pair.RESTING, Pair.ABSENT):
        return Candidate(math.inf, Transition.TOUCH), math.inf
    if mode == Pair.OPEN and is_far(plant, y, side, span):
        work[Work.ROOT_ITERATIONS] += 1
        return Candidate(math.inf, Transition.TOUCH), math.inf
    pair = pair_in_flight(plant, y, flights, side)
    t, d = 0.0, approach(y, side)
    at = Motion(pair.arm_flight.x, pair.arm_flight.v, pair.body_flight.x, pair.body_flight.v, pair.u, d, abs(pair.u))
    if mode == Pair.OPEN:
        if pair.u == 0.0 and d == 0.0:
            t = parting_time(plant, state, side, span)
            if t >= span:
                return Candidate(math.inf, Transition.TOUCH), math.inf
            at = motion_at(pair, t)
        touched, known = first_root(Transition.TOUCH, pair, t, at, span, until, work)
        return Candidate(touched, Transition.TOUCH), known
    latest = math.inf if mode == Pair.CLAMPED else until  # which pair comes first must not set the next search's span
    released, known = first_root(Transition.RELEASE, pair, 0.0, at, span, latest, work)
    if mode == Pair.CLAMPED:
        back, also = first_root(Transition.REENTRY, pair, 0.0, at, min(span, released), until, work)
        known = min(known, also)
        if not back >= released:
            return Candidate(back, Transition.REENTRY), known
    return Candidate(released, Transition.RELEASE), known


@inlined
def fly_all(flights: Flights, t: float, at: Array) -> None:
    """Positions and velocities of all bodies after t s, in their places of the state."""
    at[X_L], at[V_L], _ = fly(flights.left, t)
    at[X_O], at[V_O], _ = fly(flights.object, t)
    at[X_R], at[V_R], _ = fly(flights.right, t)


@inlined
def deliver(tables: Tables, plant: Plant, state: State, settings: Settings, flights: Flights, t: float, out: Output
            ) -> None:
    """Write the states at the output times before the end t of a flight.

    The tables belong to fixed parts of the flight, so that no state depends on the other output times.
    """
    rate, part, begin = settings.rate, -1.0, 0.0
    tau = due(state, out)
    while tau < t:
        if rate < STEEP and tau * 2.0 * rate < PARTS:
            own = math.floor(tau * 2.0 * rate)
            if own != part:
                part = own
                begin = part / (2.0 * rate) if part > 0.0 else 0.0
                expand_flight(plant.bodies, flights, begin, tables.c)
            values(tables.c, FLIGHT_ORDER, tau - begin, tables.at)
        else:
            fly_all(flights, tau, tables.at)
        write_row(out, out.filled[Filled.OUTPUTS], tables.at)
        out.filled[Filled.OUTPUTS] += 1
        tau = due(state, out)


@inlined
def places_tell(y: Array, side: Body) -> bool:
    """Whether the places of a pair say about what its u is: they may be apart by the roundings of a contact."""
    return apart(y, side) <= TOLD * abs(y[U_L + side])


@inlined
def move(flights: Flights, state: State, t: float) -> None:
    """Move the state on by t s; u has its own digits where a flight is short and the places have no finer ones.

    They never have where they did not tell u at the begin.
    """
    y = state.y
    u_l, u_r = y[U_L], y[U_R]
    told_l, told_r = places_tell(y, LEFT), places_tell(y, RIGHT)
    x_l, y[V_L], away_l = fly(flights.left, t)
    x_r, y[V_R], away_r = fly(flights.right, t)
    x_o, y[V_O], away = fly(flights.object, t)
    add(state, X_L, away_l, x_l)
    add(state, X_R, away_r, x_r)
    add(state, X_O, away, x_o)
    if math.isnan(away_l - away) or (told_l and abs(y[X_L]) + abs(y[X_O]) < abs(u_l)):
        put(state, U_L, y[X_L] - y[X_O])
    else:
        add(state, U_L, away_l - away, u_l + (away_l - away))
    if math.isnan(away - away_r) or (told_r and abs(y[X_O]) + abs(y[X_R]) < abs(u_r)):
        put(state, U_R, y[X_O] - y[X_R])
    else:
        add(state, U_R, away - away_r, u_r + (away - away_r))
    keep_resting(state)


@inlined
def flight_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """Fly to the first event, make its transitions, or to where none is before; returns the time in s, nan: failed."""
    out.work[Work.FLIGHTS] += 1
    flights = flights_of(plant, state.y)
    left, known_l = pair_candidate(plant, state, flights, LEFT, span, math.inf, out.work)
    right, known_r = pair_candidate(plant, state, flights, RIGHT, span, TOGETHER * left.when, out.work)
    if math.isnan(left.when) or math.isnan(right.when):
        return math.nan
    slide = slide_in_flight(plant, state)
    t = min(span, left.when, right.when, slide.when, known_l, known_r)
    deliver(tables, plant, state, settings, flights, t, out)
    move(flights, state, t)
    tick(state.clock, t)
    notify(out, Segment.FLIGHT, t)
    make_transitions(plant, state, left, right, slide, t, out)
    return t

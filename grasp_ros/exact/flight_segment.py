"""A segment of free flight: to its first event or to the end of the span.

Events are found by steps that cannot jump over a root: with |g''| <= M for all later times,

    g(t + h) <= g(t) + g'(t) h + M h^2 / 2,

so up to the zero of the right-hand side g stays negative. The steps approach the first root from the left and
converge quadratically. Where the arm's whole remaining swing cannot reach the object, the envelope of the swing
allows a longer step, or proves that no root exists.
"""

from __future__ import annotations

import math

from grasp_ros.exact.clock import tick, until
from grasp_ros.exact.flight import FLIGHT_ORDER, displacement, expand_flight, fly, launch
from grasp_ros.exact.friction import slide_in_flight
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, own_acceleration, write_penetrations
from grasp_ros.exact.modes import leaning, make_transitions
from grasp_ros.exact.outputs import write_row
from grasp_ros.exact.polynomial import safe_step, values
from grasp_ros.exact.records import (
    Array,
    Candidate,
    Flights,
    Integers,
    Motion,
    Output,
    PairFlight,
    Plant,
    Settings,
    State,
    Tables,
)
from grasp_ros.exact.scales import probe_time
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    EPS,
    FORCE,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
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
    Transition,
    Work,
)

MAX_ITERATIONS = 10_000_000


@kernel
def bound(body: Array, q: float, q_rate: float, span: float) -> float:
    """Bound on |q| for the next `span` seconds, for q with m q'' + c q' + k q = 0.

    x - x_e, x'', x''' are such quantities. The first bound is the energy of q, the second uses the impulse
    response, which stays below min(t, m/c).
    """
    if q_rate == 0.0:
        return abs(q)
    response = span
    if body[DAMPING] > 0.0:
        response = min(response, body[MASS] / body[DAMPING])
    linear = abs(q) + abs(q_rate) * response
    if body[STIFFNESS] > 0.0:
        return min(linear, math.sqrt(q * q + q_rate * q_rate * body[MASS] / body[STIFFNESS]))
    return linear


@kernel
def envelope_step(pair: PairFlight, at: Motion) -> float:
    """Time for which the arm's swing cannot reach the object: 0 if it can now, inf if never.

    Drag can only delay an object that approaches, but it also brakes one that moves away.
    """
    arm, body = pair.arm, pair.body
    if arm[STIFFNESS] <= 0.0:
        return 0.0
    x_e = arm[FORCE] / arm[STIFFNESS]
    room = pair.sign * (at.x_o - x_e) - bound(arm, at.x - x_e, at.v, math.inf)
    if room <= 4.0 * EPS * (abs(at.x_o) + abs(x_e)):
        return 0.0
    towards = -pair.sign * at.v_o
    if body[DAMPING] > 0.0:
        towards = max(towards, 0.0)
    return safe_step(-room, towards, max(-pair.sign * body[FORCE] / body[MASS], 0.0))


@kernel
def motion_at(pair: PairFlight, t: float) -> Motion:
    """Where arm and object are after t seconds of flight."""
    x, v = fly(pair.arm_flight, t)
    x_o, v_o = fly(pair.body_flight, t)
    return Motion(x, v, x_o, v_o, pair.sign * (x - x_o), pair.sign * (v - v_o))


@inlined
def event_function(kind: Transition, pair: PairFlight, at: Motion, left: float) -> tuple[float, float, float, float]:
    """g, g', a bound on |g''| for the next `left` seconds, and the rounding of g, of a g that rises through 0."""
    arm, body = pair.arm, pair.body
    a = own_acceleration(arm, at.x, at.v)
    a_o = own_acceleration(body, at.x_o, at.v_o)
    j = -(arm[DAMPING] * a + arm[STIFFNESS] * at.v) / arm[MASS]
    j_o = -(body[DAMPING] * a_o + body[STIFFNESS] * at.v_o) / body[MASS]
    if kind == Transition.REENTRY:
        snap = -(arm[DAMPING] * j + arm[STIFFNESS] * a) / arm[MASS]
        snap_o = -(body[DAMPING] * j_o + body[STIFFNESS] * a_o) / body[MASS]
        curvature = bound(arm, j, snap, left) + bound(body, j_o, snap_o, left)
        return at.d + pair.inverse_p, pair.sign * (a - a_o), curvature, EPS * pair.inverse_p
    turn = 1.0 if kind == Transition.TOUCH else -1.0
    curvature = bound(arm, a, j, left) + bound(body, a_o, j_o, left)
    return turn * at.u, turn * at.d, curvature, EPS * (abs(at.x) + abs(at.x_o))


@kernel
def first_root(kind: Transition, pair: PairFlight, t: float, at: Motion, span: float, work: Integers) -> float:
    """First time in (t, span] at which u rises or falls through 0, or u' rises through -1/p; inf if there is none.

    Parameters
    ----------
    kind : Transition
        TOUCH, RELEASE or REENTRY.
    t, at : float in s, Motion
        Where the search begins.
    """
    for _ in range(MAX_ITERATIONS):
        work[Work.ROOT_ITERATIONS] += 1
        left = span - t
        g, g_rate, curvature, noise = event_function(kind, pair, at, left)
        if g >= -noise and g_rate > 0.0:
            return t
        step = safe_step(min(g, -noise), g_rate, curvature)
        if kind == Transition.TOUCH:
            step = max(step, envelope_step(pair, at))
        if not step <= left:
            return math.inf if step > left else math.nan
        if t > 0.0 and step <= EPS * t:
            return t
        t += step if step > 0.0 else 1e-9 * left
        at = motion_at(pair, t)
    return math.nan


@kernel
def pair_candidate(plant: Plant, state: State, settings: Settings, flights: Flights, side: Body, span: float,
                   work: Integers) -> Candidate:
    """First event of one pair in a flight of at most `span` seconds."""
    mode, y = state.mode[side], state.y
    if mode == Pair.BALLISTIC or mode == Pair.ABSENT:
        return Candidate(math.inf, Transition.TOUCH)
    arm, sign = (flights.left, 1.0) if side == LEFT else (flights.right, -1.0)
    loss = plant.pairs[side, DISSIPATION]
    inverse_p = 1.0 / loss if loss > 0.0 else math.inf
    pair = PairFlight(plant.bodies[side], plant.bodies[OBJECT], arm, flights.object, sign, inverse_p)
    at = Motion(arm.x, arm.v, flights.object.x, flights.object.v, y[U_L + side], approach(y, side))
    if mode == Pair.OPEN:
        t = 0.0
        if at.u == 0.0 and at.d == 0.0:  # a pair that parts from rest does not come back within the probe
            t = probe_time(settings, span)
            if t >= span or leaning(plant, y, settings, side) == 0.0:
                return Candidate(math.inf, Transition.TOUCH)
            at = motion_at(pair, t)
        return Candidate(first_root(Transition.TOUCH, pair, t, at, span, work), Transition.TOUCH)
    released = first_root(Transition.RELEASE, pair, 0.0, at, span, work)
    if mode == Pair.CLAMPED:
        back = first_root(Transition.REENTRY, pair, 0.0, at, min(span, released), work)
        if not back >= released:
            return Candidate(back, Transition.REENTRY)
    return Candidate(released, Transition.RELEASE)


@inlined
def deliver(tables: Tables, plant: Plant, state: State, settings: Settings, flights: Flights, t: float, out: Output
            ) -> None:
    """Write the states at the output times before the end t of a flight.

    The tables belong to fixed parts of the flight, so that no state depends on the other output times.
    """
    row, rate = out.filled[Filled.OUTPUTS], settings.rate
    part = -1.0
    begin = 0.0
    while row < out.grid.shape[0]:
        tau = until(state.clock, out.grid[row])
        if not tau < t:
            break
        own = math.floor(tau * 2.0 * rate)
        if own != part:
            part = own
            begin = part / (2.0 * rate) if part > 0.0 else 0.0
            expand_flight(plant.bodies, flights, begin, tables.c)
        values(tables.c, FLIGHT_ORDER, tau - begin, tables.at)
        write_row(out, row, tables.at)
        row += 1
    out.filled[Filled.OUTPUTS] = row


@inlined
def move(flights: Flights, state: State, t: float) -> None:
    """Move the state on by t seconds. A ballistic pair is much shallower than the positions are exact."""
    y, mode = state.y, state.mode
    depth_l, depth_r = y[U_L], y[U_R]
    if mode[LEFT] == Pair.BALLISTIC or mode[RIGHT] == Pair.BALLISTIC:
        away = displacement(flights.object, t)
        depth_l += displacement(flights.left, t) - away
        depth_r += away - displacement(flights.right, t)
    y[X_L], y[V_L] = fly(flights.left, t)
    y[X_R], y[V_R] = fly(flights.right, t)
    y[X_O], y[V_O] = fly(flights.object, t)
    write_penetrations(y)
    if mode[LEFT] == Pair.BALLISTIC:
        y[U_L] = depth_l
    if mode[RIGHT] == Pair.BALLISTIC:
        y[U_R] = depth_r


@inlined
def flight_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, out: Output) -> float:
    """Fly to the first event, make its transitions, or to the end of the span; returns the time in s, nan: failed."""
    out.work[Work.FLIGHTS] += 1
    y, bodies = state.y, plant.bodies
    flights = Flights(
        launch(bodies[LEFT], y[X_L], y[V_L]), launch(bodies[RIGHT], y[X_R], y[V_R]),
        launch(bodies[OBJECT], y[X_O], y[V_O]),
    )
    left = pair_candidate(plant, state, settings, flights, LEFT, span, out.work)
    right = pair_candidate(plant, state, settings, flights, RIGHT, span, out.work)
    if math.isnan(left.when) or math.isnan(right.when):
        return math.nan
    slide = slide_in_flight(plant, state)
    t = min(span, left.when, right.when, slide.when)
    deliver(tables, plant, state, settings, flights, t, out)
    move(flights, state, t)
    tick(state.clock, t)
    make_transitions(plant, state, left, right, slide, t, out)
    return t

"""The first event of a pair in free flight, by steps that cannot jump over a root.

With |g''| <= M for all later times,

    g(t + h) <= g(t) + g'(t) h + M h^2 / 2,

so up to the zero of the right-hand side g stays negative. The steps approach the first root from the left and
converge quadratically. Where arm and object move nearly alike their accelerations cancel, and a bound on g''' allows
longer ones. Where the arm's whole remaining swing cannot reach the object, the envelope of the swing allows a longer
step, or proves that no root exists.
"""

from __future__ import annotations

import math

from grasp_ros.exact.flight import fly
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import bound, next_derivative, own_acceleration
from grasp_ros.exact.records import Array, EventFunction, Flights, Integers, Motion, PairFlight, Plant
from grasp_ros.exact.roots import safe_step
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    EPS,
    FORCE,
    LEFT,
    MASS,
    OBJECT,
    STIFFNESS,
    U_L,
    Body,
    Transition,
    Work,
)

MAX_ITERATIONS = 10_000_000


@kernel
def envelope_step(pair: PairFlight, at: Motion) -> float:
    """Time for which the arm's swing cannot reach the object: 0 if it can now, inf if never.

    Drag can only delay an object that approaches, but it also brakes one that moves away.
    """
    arm, body = pair.arm, pair.body
    if arm[STIFFNESS] <= 0.0:
        return 0.0
    x_e = arm[FORCE] / arm[STIFFNESS]
    swing = bound(arm, at.x - x_e, at.v, math.inf)
    room = pair.sign * (at.x_o - x_e) - swing - 8.0 * EPS * (abs(at.x_o) + abs(x_e) + swing)
    if not room > 0.0:
        return 0.0
    towards = -pair.sign * at.v_o
    if body[DAMPING] > 0.0:
        towards = max(towards, 0.0)
    return safe_step(-room, towards, max(-pair.sign * body[FORCE] / body[MASS], 0.0))


@kernel
def motion_at(pair: PairFlight, t: float) -> Motion:
    """Where arm and object are after t seconds of flight; u of a short one without the common digits of the places."""
    x, v, away = fly(pair.arm_flight, t)
    x_o, v_o, away_o = fly(pair.body_flight, t)
    d, moved = pair.sign * (v - v_o), pair.sign * (away - away_o)
    if math.isnan(moved):
        return Motion(x, v, x_o, v_o, pair.sign * (x - x_o), d, abs(x) + abs(x_o))
    return Motion(x, v, x_o, v_o, pair.u + moved, d, abs(pair.u) + abs(away) + abs(away_o))


@inlined
def event_function(kind: Transition, pair: PairFlight, at: Motion, left: float) -> EventFunction:
    """A function g of time that rises through 0 at an event."""
    arm, body = pair.arm, pair.body
    a, a_o = own_acceleration(arm, at.x, at.v), own_acceleration(body, at.x_o, at.v_o)
    j, j_o = next_derivative(arm, at.v, a), next_derivative(body, at.v_o, a_o)
    snap, snap_o = next_derivative(arm, a, j), next_derivative(body, a_o, j_o)
    if pair.alike:
        growth = bound(arm, j - j_o, snap - snap_o, left)
    else:
        growth = bound(arm, j, snap, left) + bound(body, j_o, snap_o, left)
    if kind == Transition.REENTRY:
        return EventFunction(at.d + pair.inverse_p, pair.sign * (a - a_o), growth, EPS * pair.inverse_p, growth, 0.0)
    turn = 1.0 if kind == Transition.TOUCH else -1.0
    if pair.alike:
        curvature = bound(arm, a - a_o, j - j_o, left)
    else:
        curvature = bound(arm, a, j, left) + bound(body, a_o, j_o, left)
    bend = turn * pair.sign * (a - a_o) + 4.0 * EPS * (abs(a) + abs(a_o))
    return EventFunction(turn * at.u, turn * at.d, curvature, EPS * at.size, bend, growth)


@inlined
def certain_step(g: EventFunction, last: float) -> float:
    """Time for which g stays below 0: by its bound, or by its own curvature for as long as that can change little."""
    below = min(g.value, -g.noise)
    step = safe_step(below, g.rate, g.curvature)
    reach = 4.0 * max(step, last)
    bend = max(g.bend + g.growth * reach, 0.0)
    if bend < 0.5 * g.curvature:
        step = max(step, min(reach, safe_step(below, g.rate, bend)))
    return step


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
    step = 0.0
    for _ in range(MAX_ITERATIONS):
        work[Work.ROOT_ITERATIONS] += 1
        left = span - t
        g = event_function(kind, pair, at, min(left, pair.horizon))
        if g.value >= -g.noise and g.rate > 0.0:
            return t
        step = certain_step(g, step)
        if kind == Transition.TOUCH:
            step = max(step, envelope_step(pair, at))
        step = min(step, pair.horizon)
        if not step <= left:
            return math.inf if step > left else math.nan
        if step <= EPS * t or step == 0.0:
            return t
        t += step
        at = motion_at(pair, t)
    return math.nan


@kernel
def pair_in_flight(plant: Plant, y: Array, flights: Flights, side: Body) -> PairFlight:
    """Arm and object of a flight from y."""
    flight, sign = (flights.left, 1.0) if side == LEFT else (flights.right, -1.0)
    arm, body, loss = plant.bodies[side], plant.bodies[OBJECT], plant.pairs[side, DISSIPATION]
    alike = arm[STIFFNESS] * body[MASS] == body[STIFFNESS] * arm[MASS]
    alike = alike and arm[DAMPING] * body[MASS] == body[DAMPING] * arm[MASS]
    growth = max(-arm[DAMPING] / arm[MASS], -body[DAMPING] / body[MASS])
    horizon = 1.0 / growth if growth > 0.0 else math.inf
    inverse_p = 1.0 / loss if loss > 0.0 else math.inf
    return PairFlight(arm, body, flight, flights.object, sign, y[U_L + side], alike, horizon, inverse_p)



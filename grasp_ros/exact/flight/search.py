"""The first event of a pair in free flight, such as a touch, by steps that cannot jump over a root.

With |g''| <= M for all later times,

    g(t + h) <= g(t) + g'(t) h + M h^2 / 2,

so g stays negative up to the zero of the right-hand side. Steps to that zero approach the first root from the left.
Once the bounds show that g rises up to the root, the root is that of the Taylor series of g about the time reached.
Longer steps are possible where the accelerations of arm and object nearly cancel, by a bound on the third derivative;
and where the arm cannot reach the object in all its remaining swing, by the envelope of the swing, which may also prove
that there is no root.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.flight.closed_form import fly
from grasp_ros.exact.kinematics import bound_by, envelope_step, rates_of
from grasp_ros.exact.numerics.roots import safe_step
from grasp_ros.exact.records import Array, Flights, Integers, Motion, PairFlight, Plant, Rates
from grasp_ros.exact.tolerances import BRACKET, LAST_CORRECTION, SMALLEST_RATE
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, Body, Law, Transition, U, Work

MAX_ITERATIONS = 100_000  # after which a flight goes on from where the search is
MAX_NEWTON, MAX_REFINEMENTS = 20, 200


class Derivatives(NamedTuple):
    """Derivatives of a body's position in flight, m/s^n."""

    second: float
    third: float
    fourth: float
    fifth: float


class EventSeries(NamedTuple):
    """A function g of time that rises through 0 at an event: g and its derivatives."""

    value: float
    rate: float
    second: float
    third: float
    fourth: float
    noise: float  # rounding of g
    second_noise: float  # rounding of its second derivative


@kernel
def motion_at(pair: PairFlight, t: float) -> Motion:
    """Where arm and object are after t seconds of flight; in a short flight u is that at its begin plus both ways."""
    x, v, away, _ = fly(pair.arm_flight, t)
    x_o, v_o, away_o, _ = fly(pair.body_flight, t)
    d, moved = pair.sign * (v - v_o), pair.sign * (away - away_o)
    if math.isnan(moved):
        return Motion(x, v, x_o, v_o, pair.sign * (x - x_o), d, abs(x) + abs(x_o))
    return Motion(x, v, x_o, v_o, pair.u + moved, d, abs(pair.u) + abs(away) + abs(away_o))


@kernel
def derivatives_of(rates: Rates, x: float, v: float) -> Derivatives:
    """Derivatives of a body's flight."""
    second = (rates.force - rates.stiffness * x) - rates.damping * v
    third = -(rates.damping * second + rates.stiffness * v)
    fourth = -(rates.damping * third + rates.stiffness * second)
    return Derivatives(second, third, fourth, -(rates.damping * fourth + rates.stiffness * third))


@inlined
def event_series(kind: Transition, pair: PairFlight, at: Motion, own: Derivatives, body: Derivatives) -> EventSeries:
    """The series of a function g of time that rises through 0 at an event."""
    turn = -1.0 if kind == Transition.RELEASE else 1.0
    sign = turn * pair.sign
    second, third = sign * (own.second - body.second), sign * (own.third - body.third)
    fourth, fifth = sign * (own.fourth - body.fourth), sign * (own.fifth - body.fifth)
    if kind == Transition.REENTRY:
        noise, second_noise = EPS * pair.inverse_p, 4.0 * EPS * (abs(own.third) + abs(body.third))
        return EventSeries(at.d + pair.inverse_p, second, third, fourth, fifth, noise, second_noise)
    second_noise = 4.0 * EPS * (abs(own.second) + abs(body.second))
    return EventSeries(turn * at.u, turn * at.d, second, third, fourth, EPS * at.size, second_noise)


@inlined
def relative_bound(pair: PairFlight, q: float, q_rate: float, q_o: float, q_o_rate: float, left: float) -> float:
    """Bound on the difference of a derivative q of the arm's flight and q_o of the object's for `left` seconds."""
    if pair.alike:
        return bound_by(pair.arm_rates, q - q_o, q_rate - q_o_rate, left)
    return bound_by(pair.arm_rates, q, q_rate, left) + bound_by(pair.body_rates, q_o, q_o_rate, left)


@inlined
def certain_step(g: EventSeries, curvature: float, growth: float, last: float) -> float:
    """Time for which g stays below 0: by the bound on |g''|, or by g'' now and its largest change if that is longer."""
    below = min(g.value, -g.noise)
    step = safe_step(below, g.rate, curvature)
    reach = min(4.0 * max(step, last), 1.0 / SMALLEST_RATE)  # finite: `growth` may be 0
    bend = max(g.second + g.second_noise + growth * reach, 0.0)
    if bend < 0.5 * curvature:
        step = max(step, min(reach, safe_step(below, g.rate, bend)))
    return step


@inlined
def reach_of_root(g: EventSeries, growth: float, left: float) -> float:
    """Time within which g has exactly one root, as g' keeps half of its size until then; 0 if that is not known."""
    if not (g.value < 0.0 and g.rate > SMALLEST_RATE):
        return 0.0
    reach = -2.0 * g.value / g.rate
    lost = reach * (max(g.second_noise - g.second, 0.0) + growth * reach)
    return reach if reach <= left and lost <= 0.5 * g.rate else 0.0


@inlined
def root_of_series(g: EventSeries) -> float:
    """Time to the root of g by its series, by Newton's iteration; nan if that does not converge."""
    two, three, four = 0.5 * g.second, g.third / 6.0, g.fourth / 24.0
    t = safe_step(g.value, g.rate, max(g.second, 0.0)) if g.value < 0.0 else -g.value / g.rate
    for _ in range(MAX_NEWTON):
        value = (((four * t + three) * t + two) * t + g.rate) * t + g.value
        rate = ((4.0 * four * t + 3.0 * three) * t + 2.0 * two) * t + g.rate
        step = value / rate
        t -= step
        if abs(step) <= LAST_CORRECTION * abs(t):
            return t
    return math.nan


@kernel
def root_between(kind: Transition, pair: PairFlight, low: float, high: float, g: EventSeries, growth: float,
                 work: Integers) -> float:
    """The root in (low, high] of a function that rises there; g is its series at low.

    Each step goes to the root of the series, or to the middle of the interval if that root lies outside. It is the last
    one if the first neglected term, of fifth order, shifts the root by no more than a few roundings of the time.
    """
    t = low
    for _ in range(MAX_REFINEMENTS):
        step = root_of_series(g)
        if not low <= t + step <= high:
            step = 0.5 * (low + high) - t
        elif growth * pair.square_rate * abs(step) ** 5 <= 8.0 * EPS * t * g.rate:
            return t + step
        t += step
        if high - low <= BRACKET * high:
            return t
        work[Work.ROOT_ITERATIONS] += 1
        at = motion_at(pair, t)
        own, body = derivatives_of(pair.arm_rates, at.x, at.v), derivatives_of(pair.body_rates, at.x_o, at.v_o)
        g = event_series(kind, pair, at, own, body)
        if abs(g.value) <= g.noise:
            return t
        if g.value > 0.0:
            high = t
        else:
            low = t
    return t


@kernel
def first_root(kind: Transition, pair: PairFlight, t: float, at: Motion, span: float, until: float, work: Integers
               ) -> tuple[float, float]:
    """First time in (t, span] at which u rises or falls through 0, or u' rises through -1/p; inf if there is none.

    Parameters
    ----------
    kind : Transition
        TOUCH, RELEASE or REENTRY.
    t, at : float in s, Motion
        Where the search begins.
    until : float, s
        What comes later need not be found.

    Returns
    -------
    float, float
        That time; and the time that the search has reached if it was given up, otherwise inf. It is given up after
        MAX_ITERATIONS, because a pair that swings within a rounding of a touch would keep it busy for the whole flight.
    """
    step = 0.0
    for _ in range(MAX_ITERATIONS):
        work[Work.ROOT_ITERATIONS] += 1
        left = min(span - t, pair.horizon)
        own, body = derivatives_of(pair.arm_rates, at.x, at.v), derivatives_of(pair.body_rates, at.x_o, at.v_o)
        g = event_series(kind, pair, at, own, body)
        if g.value >= -g.noise and g.rate > 0.0:
            return t, math.inf
        third = relative_bound(pair, own.third, own.fourth, body.third, body.fourth, left)
        if kind == Transition.REENTRY:  # bounds on the second and the third derivative of g for `left` seconds
            curvature, growth = third, relative_bound(pair, own.fourth, own.fifth, body.fourth, body.fifth, left)
        else:
            curvature, growth = relative_bound(pair, own.second, own.third, body.second, body.third, left), third
        reach = reach_of_root(g, growth, left)
        if reach > 0.0:
            return root_between(kind, pair, t, t + reach, g, growth, work), math.inf
        step = certain_step(g, curvature, growth, step)
        if kind == Transition.TOUCH:
            step = max(step, envelope_step(pair, at))
        step = min(step, pair.horizon)
        if not step <= span - t or t > until:
            return (math.nan if math.isnan(step) else math.inf), math.inf
        if step <= EPS * t or step == 0.0:
            return t, math.inf
        t += step
        at = motion_at(pair, t)
    return math.inf, t


@kernel
def pair_in_flight(plant: Plant, y: Array, flights: Flights, side: Body) -> PairFlight:
    """Arm and object of a flight from y."""
    flight, sign = (flights.left, 1.0) if side == LEFT else (flights.right, -1.0)
    arm, body, loss = rates_of(plant.bodies[side]), rates_of(plant.bodies[OBJECT]), plant.pairs[side, Law.DISSIPATION]
    alike = arm.stiffness == body.stiffness and arm.damping == body.damping
    growth = max(-arm.damping, -body.damping)
    horizon = 1.0 / growth if growth > 0.0 else math.inf
    inverse_p = 1.0 / loss if loss > 0.0 else math.inf
    x_e = arm.force / arm.stiffness if arm.stiffness > 0.0 else 0.0
    fastest = max(arm.stiffness + arm.damping * arm.damping, body.stiffness + body.damping * body.damping)
    return PairFlight(arm, body, flight, flights.object, sign, y[U.L + side], alike, horizon, inverse_p, x_e, fastest)

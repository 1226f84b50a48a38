"""How an arm stands to the object: u and u', and what changes them while nothing pushes."""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.impact import damping_factor
from grasp_ros.exact.numerics.roots import safe_step
from grasp_ros.exact.records import Array, Motion, PairFlight, Plant, Rates
from grasp_ros.exact.tolerances import DIED_OUT
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, U, V, X


@kernel
def other(side: Body) -> Body:
    """The other side."""
    return RIGHT if side == LEFT else LEFT


@kernel
def arm_of(y: Array, side: Body) -> tuple[float, float, float]:
    """x and v of an arm, and the sign with which they enter u and u'."""
    return (y[X.L], y[V.L], 1.0) if side == LEFT else (y[X.R], y[V.R], -1.0)


@kernel
def rate_lanes(side: Body) -> tuple[int, int]:
    """Indices of the two velocities whose difference is u', (8)."""
    return (V.L, V.O) if side == LEFT else (V.O, V.R)


@kernel
def approach(y: Array, side: Body) -> float:
    """u' of a pair, m/s."""
    front, back = rate_lanes(side)
    return y[front] - y[back]


@kernel
def own_acceleration(body: Array, x: float, v: float) -> float:
    """x'' of a body, m/s^2, without impact forces: (1) to (3)."""
    return (body[Of.FORCE] - body[Of.STIFFNESS] * x - body[Of.DAMPING] * v) / body[Of.MASS]


@kernel
def own_size(body: Array, x: float, v: float) -> float:
    """Sum of the sizes of the terms of `own_acceleration`, m/s^2."""
    return (abs(body[Of.FORCE]) + abs(body[Of.STIFFNESS] * x) + abs(body[Of.DAMPING] * v)) / body[Of.MASS]


@inlined
def relative_motion(plant: Plant, y: Array, side: Body) -> tuple[float, float]:
    """u' and the u'' that both bodies would have without impact forces."""
    x, v, sign = arm_of(y, side)
    a = own_acceleration(plant.bodies[side], x, v)
    a_o = own_acceleration(plant.bodies[OBJECT], y[X.O], y[V.O])
    return approach(y, side), sign * (a - a_o)


@kernel
def reduced_mass(bodies: Array, side: Body) -> float:
    """mu of one pair, kg."""
    m, m_o = bodies[side, Of.MASS], bodies[OBJECT, Of.MASS]
    return m / (1.0 + m / m_o)  # m_o is infinite if the object sticks


@kernel
def rates_of(body: Array) -> Rates:
    """What the equation of a body divides by its mass; body is its row (4,)."""
    m, k, c, f = body[Of.MASS], body[Of.STIFFNESS], body[Of.DAMPING], body[Of.FORCE]
    return Rates(k / m, c / m, f / m, m / c if c > 0.0 else math.inf, m / k if k > 0.0 else math.inf)


@kernel
def bound_by(rates: Rates, q: float, q_rate: float, span: float) -> float:
    """Bound on |q| for the next `span` seconds, for q with m q'' + c q' + k q = 0.

    x - x_e, x'', x''' are such quantities. The first bound is the energy of q, the second uses the impulse
    response, which stays below min(t, m/c). What a feedback drives, c < 0,
    grows by e in the time m/|c|; no span may be longer.
    """
    grown = math.e if rates.damping < 0.0 else 1.0
    if q_rate == 0.0:
        return grown * abs(q)
    linear = abs(q) + abs(q_rate) * min(span, rates.response)
    if rates.square_time < math.inf:
        swing = math.sqrt(q * q + q_rate * q_rate * rates.square_time)
        if not DIED_OUT < swing < 1.0 / DIED_OUT:  # squares have left the range of numbers
            swing = math.hypot(q, q_rate * math.sqrt(rates.square_time))
        linear = min(linear, swing)
    return grown * linear


@kernel
def envelope_step(pair: PairFlight, at: Motion) -> float:
    """Time for which the arm's swing cannot reach the object: 0 if it can now, inf if never.

    Drag can only delay an object that approaches, but it also brakes one that moves away.
    """
    arm, body = pair.arm_rates, pair.body_rates
    if arm.stiffness <= 0.0:
        return 0.0
    x_e = pair.x_e
    swing = bound_by(arm, at.x - x_e, at.v, math.inf)
    room = pair.sign * (at.x_o - x_e) - swing - 8.0 * EPS * (abs(at.x_o) + abs(x_e) + swing)
    if not room > 0.0:
        return 0.0
    towards = -pair.sign * at.v_o
    if body.damping > 0.0:
        towards = max(towards, 0.0)
    return safe_step(-room, towards, max(-pair.sign * body.force, 0.0))


@kernel
def next_derivative(body: Array, before: float, value: float) -> float:
    """The derivative after two of a body's flight, from the second one on: m q'' = -(c q' + k q)."""
    return -(body[Of.DAMPING] * value + body[Of.STIFFNESS] * before) / body[Of.MASS]


@kernel
def derivatives(body: Array, x: float, v: float, order: int) -> tuple[float, float]:
    """Derivative `order` >= 2 of a body's flight, m/s^order, and the sum of the sizes of its terms."""
    m, k, c = body[Of.MASS], body[Of.STIFFNESS], body[Of.DAMPING]
    value, size = own_acceleration(body, x, v), own_size(body, x, v)
    before, before_size = v, abs(v)
    for _ in range(order - 2):
        following, following_size = next_derivative(body, before, value), (abs(c) * size + k * before_size) / m
        before, before_size, value, size = value, size, following, following_size
    return value, size


@kernel
def difference(plant: Plant, y: Array, side: Body, order: int) -> tuple[float, float]:
    """A derivative of u without impact forces, and the sum of the sizes of its terms."""
    x, v, sign = arm_of(y, side)
    value, size = derivatives(plant.bodies[side], x, v, order)
    value_o, size_o = derivatives(plant.bodies[OBJECT], y[X.O], y[V.O], order)
    return sign * (value - value_o), size + size_o


@inlined
def is_closed(mode: Pair) -> bool:
    """Whether a pair is between its touch and its release."""
    return mode in (Pair.CONTACT, Pair.BEGINNING, Pair.CLAMPED, Pair.LEAVING)


@kernel
def surface_factor(pairs: Array, y: Array, side: Body, roundings: float) -> float:
    """1 + p u' of a pair; 0 within some roundings of its terms."""
    loss, (front, back) = pairs[side, Law.DISSIPATION], rate_lanes(side)
    factor = damping_factor(loss, y[front] - y[back])
    return factor if abs(factor) > roundings * EPS * (1.0 + loss * (abs(y[front]) + abs(y[back]))) else 0.0


@inlined
def is_resting(y: Array, side: Body) -> bool:
    """Whether a pair is at u = u' = 0."""
    return y[U.L + side] == 0.0 and approach(y, side) == 0.0

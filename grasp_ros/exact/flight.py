"""Free flight: m x'' + c x' + k x = f with f constant, solved in closed form, and its first event.

Every body between contacts obeys this equation, so a flight of any length costs one evaluation. Events are found
by steps that cannot jump over a root: with |g''| <= M for all later times,

    g(t + h) <= g(t) + g'(t) h + M h^2 / 2,

so up to the zero of the right-hand side g stays negative. The steps approach the first root from the left and
converge quadratically. Where the arm's whole remaining swing cannot reach the object, the envelope of the swing
allows a longer step, or proves that no root exists.
"""

import math
from typing import Any

import numpy as np

from grasp_ros.exact.jit import kernel
from grasp_ros.physics.layout import DAMPING, FORCE, LANES, LEFT, MASS, OBJECT, RIGHT, STIFFNESS, X_L, X_O, X_R

EPS = 2.220446049250313e-16
DRIFT, UNDER, NEAR, OVER = 0.0, 1.0, 2.0, 3.0  # regimes of the closed form
MAX_ITERATIONS = 10_000_000
PROBE = 1e-3  # part of the time constants within which the first derivative that differs decides
FLIGHT_ORDER = 16  # (1/2)^16 / 16! is below rounding, see `expand_flight`
# Typed integers: numba would compile the search once per literal kind.
TOUCH_ROOT, RELEASE_ROOT, REENTRY_ROOT = np.int64(0), np.int64(1), np.int64(2)


@kernel
def launch(body: Any, x: float, v: float) -> Any:
    """Constants of one body's flight from (x, v): a tuple of floats for `fly`.

    (regime, x, v, x - x_e, x_e, a, sigma, rate, omega0^2) with sigma = c/2m, rate = the damped frequency or
    sqrt(sigma^2 - omega0^2), x_e the rest position (0 where the regime does not need it), a = (f - k x) / m.
    """
    m = body[MASS]
    k = body[STIFFNESS]
    sigma = 0.5 * body[DAMPING] / m
    omega0_2 = k / m
    push = (body[FORCE] - k * x) / m
    discriminant = omega0_2 - sigma * sigma
    rate = math.sqrt(abs(discriminant))
    if omega0_2 == 0.0 and sigma == 0.0:
        return (DRIFT, x, v, 0.0, 0.0, push, 0.0, 0.0, 0.0)
    x_e = body[FORCE] / k if k > 0.0 else math.inf
    if discriminant <= 0.0 and rate > 0.5 * sigma and abs(x_e) > abs(x):
        return (OVER, x, v, 0.0, 0.0, push, sigma, rate, omega0_2)
    return (UNDER if discriminant > 0.0 else NEAR, x, v, x - x_e, x_e, push, sigma, rate, omega0_2)


@kernel
def fly(flight: Any, t: float) -> Any:
    """Position and velocity after the time t >= 0 of flight.

    `UNDER` and `NEAR` (critical or over-damped) describe the swing around the rest position, which decays without
    loss of digits. `OVER` is for an over-damped body whose rest position is too far away to be subtracted from,
    or does not exist; for the same reason short flights use the power series of the equation. expm1 keeps the
    digits in the limits of equal roots and of a vanishing spring.
    """
    regime, x, v, swing, x_e, push, sigma, rate, omega0_2 = flight
    if regime == DRIFT:
        return x + t * (v + 0.5 * t * push), v + t * push
    if t * (2.0 * sigma + math.sqrt(omega0_2)) < 0.25:
        away, v = short_flight(v, push, sigma, omega0_2, t)
        return x + away, v
    if regime == UNDER:
        decay = math.exp(-sigma * t)
        response = decay * math.sin(rate * t) / rate
        cosine = decay * math.cos(rate * t)
        return (
            x_e + swing * (cosine + sigma * response) + v * response,
            v * (cosine - sigma * response) + push * response,
        )
    slow = -omega0_2 / (sigma + rate)
    fast = -(sigma + rate)
    decay = math.exp(slow * t)
    response = decay * t if rate == 0.0 else decay * -math.expm1(-2.0 * rate * t) / (2.0 * rate)
    cosine = 0.5 * (decay + math.exp(fast * t))
    velocity = v * (cosine - sigma * response) + push * response
    if regime == NEAR:
        return x_e + swing * (cosine + sigma * response) + v * response, velocity
    slow_part = t if slow == 0.0 else math.expm1(slow * t) / slow
    return x + v * response + push * (slow_part - math.expm1(fast * t) / fast) / (2.0 * rate), velocity


@kernel
def short_flight(v: float, push: float, sigma: float, omega0_2: float, t: float) -> Any:
    """Displacement and velocity after a time below both time constants: the power series of the flight."""
    before = v  # (n+1) y_(n+1) t^n
    term = (push - 2.0 * sigma * v) * t
    position = v * t
    velocity = v
    n = 1
    while n < 24:
        velocity += term
        position += term * t / (n + 1)
        following = -t * (2.0 * sigma * term + omega0_2 * before * t / n) / (n + 1)
        before, term = term, following
        n += 1
        if abs(term) <= 1e-18 * abs(velocity) and abs(before) <= 1e-18 * abs(velocity):
            break
    return position, velocity


@kernel
def displacement(flight: Any, t: float) -> float:
    """x(t) - x without their common digits, for a time below both time constants."""
    _, _, v, _, _, push, sigma, _, omega0_2 = flight
    return short_flight(v, push, sigma, omega0_2, t)[0]


@kernel
def parting(arm: Any, x: float, v: float, body: Any, x_o: float, v_o: float, t: float) -> float:
    """By how much an arm and the object part within t, at most PROBE time constants; 0 where rounding decides."""
    far, far_o = displacement(launch(arm, x, v), t), displacement(launch(body, x_o, v_o), t)
    return far - far_o if abs(far - far_o) > 4.0 * EPS * (abs(far) + abs(far_o)) else 0.0


@kernel
def expand_flight(bodies: Any, flights: Any, t: float, c: Any) -> None:
    """Write the Taylor table about the time t of flight: positions and velocities in their places of the state.

    Within half of the time constants one table serves many outputs: a polynomial costs less than a closed form.
    """
    for i in range(LANES):
        c[i] = 0.0
    for body, lane in ((LEFT, X_L), (OBJECT, X_O), (RIGHT, X_R)):
        m = bodies[body, MASS]
        force, k, d = bodies[body, FORCE] / m, bodies[body, STIFFNESS] / m, bodies[body, DAMPING] / m
        x, v = fly(flights[body], t)
        c[lane], c[lane + 1] = x, v
        for n in range(FLIGHT_ORDER):
            share = 1.0 / (n + 1)
            x, v = share * v, share * ((force - k * x) - d * v)
            force = 0.0
            i = LANES * (n + 1) + lane
            c[i], c[i + 1] = x, v


@kernel
def bound(body: Any, q: float, q_rate: float, span: float) -> float:
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
def safe_step(g: float, g_rate: float, curvature: float) -> float:
    """Smallest h > 0 with g + g' h + M h^2 / 2 = 0 for g <= 0; inf if there is none.

    An exact zero at the start does not count: for g = 0 and g' < 0 the second root is returned.
    """
    if curvature <= 0.0:
        return -g / g_rate if g_rate > 0.0 else math.inf
    root = math.sqrt(g_rate * g_rate - 2.0 * curvature * g)
    return (root - g_rate) / curvature if g_rate <= 0.0 else -2.0 * g / (root + g_rate)


@kernel
def envelope_step(arm: Any, body: Any, x: float, v: float, x_o: float, v_o: float, sign: float) -> float:
    """Time for which the arm's swing cannot reach the object: 0 if it can now, inf if never.

    sign is +1 for the left side and -1 for the right one: u = sign (x - x_o). Drag can only delay an object that
    approaches, but it also brakes one that moves away.
    """
    if arm[STIFFNESS] <= 0.0:
        return 0.0
    x_e = arm[FORCE] / arm[STIFFNESS]
    room = sign * (x_o - x_e) - bound(arm, x - x_e, v, math.inf)
    if room <= 4.0 * EPS * (abs(x_o) + abs(x_e)):
        return 0.0
    approach = -sign * v_o
    if body[DAMPING] > 0.0:
        approach = max(approach, 0.0)
    return safe_step(-room, approach, max(-sign * body[FORCE] / body[MASS], 0.0))


@kernel
def flight_root(kind: int, arm: Any, body: Any, arm_flight: Any, object_flight: Any, start: Any, sign: float,
                inverse_p: float, pace: float, span: float, work: Any) -> float:
    """First time in (0, span] at which a pair in free flight switches; inf if there is none.

    Parameters
    ----------
    kind : int
        TOUCH_ROOT: u rises through 0. RELEASE_ROOT: u falls through 0. REENTRY_ROOT: u' rises through -1/p.
    arm, body : array (4,)
        Rows of the arm and of the object.
    start : (float, float)
        u and u' at the start, exact where the positions are not.
    inverse_p : float
        1/p, only used by REENTRY_ROOT.
    pace : float, 1/s
        See `switching.fastest_rate`. A pair that parts from rest at u = 0 does not come back within a part of it.
    """
    t = 0.0
    u, d = start
    x, v = arm_flight[1], arm_flight[2]
    x_o, v_o = object_flight[1], object_flight[2]
    if kind == TOUCH_ROOT and u == 0.0 and d == 0.0:
        t = PROBE / pace if pace > 0.0 else span
        if t >= span or parting(arm, x, v, body, x_o, v_o, t) == 0.0:
            return math.inf
        x, v = fly(arm_flight, t)
        x_o, v_o = fly(object_flight, t)
        u, d = sign * (x - x_o), sign * (v - v_o)
    for _ in range(MAX_ITERATIONS):
        work[3] += 1
        a = (arm[FORCE] - arm[STIFFNESS] * x - arm[DAMPING] * v) / arm[MASS]
        a_o = (body[FORCE] - body[STIFFNESS] * x_o - body[DAMPING] * v_o) / body[MASS]
        j = -(arm[DAMPING] * a + arm[STIFFNESS] * v) / arm[MASS]
        j_o = -(body[DAMPING] * a_o + body[STIFFNESS] * v_o) / body[MASS]
        left = span - t
        if kind == REENTRY_ROOT:
            snap = -(arm[DAMPING] * j + arm[STIFFNESS] * a) / arm[MASS]
            snap_o = -(body[DAMPING] * j_o + body[STIFFNESS] * a_o) / body[MASS]
            g, g_rate = d + inverse_p, sign * (a - a_o)
            curvature = bound(arm, j, snap, left) + bound(body, j_o, snap_o, left)
            noise = EPS * inverse_p
        else:
            turn = 1.0 if kind == TOUCH_ROOT else -1.0
            g, g_rate = turn * u, turn * d
            curvature = bound(arm, a, j, left) + bound(body, a_o, j_o, left)
            noise = EPS * (abs(x) + abs(x_o))
        if g >= -noise and g_rate > 0.0:
            return t
        step = safe_step(min(g, -noise), g_rate, curvature)
        if kind == TOUCH_ROOT:
            step = max(step, envelope_step(arm, body, x, v, x_o, v_o, sign))
        if not step <= left:
            return math.inf if step > left else math.nan
        if t > 0.0 and step <= EPS * t:
            return t
        t += step if step > 0.0 else 1e-9 * left
        x, v = fly(arm_flight, t)
        x_o, v_o = fly(object_flight, t)
        u, d = sign * (x - x_o), sign * (v - v_o)
    return math.nan

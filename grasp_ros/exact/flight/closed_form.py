"""Free flight: m x'' + c x' + k x = f with f constant, solved in closed form.

Every body between contacts obeys this equation, so a flight of any length costs one evaluation.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined, kernel, whole
from grasp_ros.exact.kinematics import rates_of
from grasp_ros.exact.numerics.polynomial import INVERSE
from grasp_ros.exact.records import Array, Flight, Flights, Flown, Order, Plant, Rates, Regime, Step
from grasp_ros.exact.tolerances import FAR, FAR_SHORT, SETTLED, SHORT_FLIGHT, TERM
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Of, V, X

FLIGHT_ORDER = whole(16)  # (1/2)^16 / 16! is below rounding; typed, or numba compiles its users once more
NO_STEP = Step(Order(0, 1.0, 0), 1.0, False, False)  # of a segment that is a flight


@kernel
def launch(body: Array, x: float, v: float) -> Flight:
    """Constants of one body's flight from (x, v), for `fly`; body is its row (4,)."""
    m = body[Of.MASS]
    k = body[Of.STIFFNESS]
    sigma = 0.5 * body[Of.DAMPING] / m
    omega0_2 = k / m
    push = (body[Of.FORCE] - k * x) / m
    discriminant = omega0_2 - sigma * sigma
    rate = math.sqrt(abs(discriminant))
    if omega0_2 == 0.0 and sigma == 0.0:
        return Flight(Regime.DRIFT, x, v, 0.0, 0.0, push, 0.0, 0.0, 0.0)
    x_e = body[Of.FORCE] / k if k > 0.0 else math.inf
    if discriminant <= 0.0 and rate > 0.5 * sigma and abs(x_e) > abs(x):
        return Flight(Regime.OVER, x, v, 0.0, 0.0, push, sigma, rate, omega0_2)
    regime = Regime.UNDER if discriminant > 0.0 else Regime.NEAR
    return Flight(regime, x, v, x - x_e, x_e, push, sigma, rate, omega0_2)


@inlined
def flights_of(plant: Plant, y: Array, left: bool, right: bool) -> Flights:
    """Flights from y of all bodies that take no part in a contact on the left or right; the others are of no use."""
    still = Flight(Regime.DRIFT, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Flights(
        still if left else launch(plant.bodies[LEFT], y[X.L], y[V.L]),
        still if right else launch(plant.bodies[RIGHT], y[X.R], y[V.R]),
        still if left or right else launch(plant.bodies[OBJECT], y[X.O], y[V.O]),
    )


@kernel
def fly(flight: Flight, t: float) -> Flown:
    """Position and velocity after the time t >= 0 of flight, and how far they have come.

    `UNDER` and `NEAR` (critical or over-damped) describe the swing around the rest position, which decays without
    loss of digits. `OVER` is for an over-damped body whose rest position is too far away to be subtracted from,
    or does not exist; for the same reason short flights use the power series of the equation. expm1 keeps the
    digits in the limits of equal roots and of a vanishing spring; where the roots are far apart, a velocity is a
    difference of two decays, never of a decay and what has nearly the same size.
    """
    regime, x, v, swing, x_e, push, sigma, rate, omega0_2 = flight
    if regime == Regime.DRIFT:
        way, change = t * (v + 0.5 * t * push), t * push
        return Flown(x + way, v + change, way, change)
    if t * (2.0 * abs(sigma) + math.sqrt(omega0_2)) < (FAR_SHORT if abs(x_e) > FAR * abs(x) else SHORT_FLIGHT):
        way, change = short_flight(v, push, sigma, omega0_2, t)
        return Flown(x + way, v + change, way, change)
    if regime == Regime.UNDER:
        decay = math.exp(-sigma * t)
        response = decay * math.sin(rate * t) / rate
        cosine = decay * math.cos(rate * t)
        return Flown(
            x_e + swing * (cosine + sigma * response) + v * response,
            v * (cosine - sigma * response) + push * response, math.nan, math.nan,
        )
    fast = -(sigma + rate) if sigma >= 0.0 else omega0_2 / (rate - sigma)
    slow = omega0_2 / fast if sigma >= 0.0 else rate - sigma
    slow_decay, fast_decay = math.exp(slow * t), math.exp(fast * t)
    response = slow_decay * (t if rate == 0.0 else -math.expm1(-2.0 * rate * t) / (2.0 * rate))
    velocity = v * (fast_decay + slow * response) + push * response
    if regime == Regime.NEAR:
        return Flown(x_e + swing * (slow_decay - slow * response) + v * response, velocity, math.nan, math.nan)
    slow_part = t if slow == 0.0 else math.expm1(slow * t) / slow
    fast_part = t if fast == 0.0 else math.expm1(fast * t) / fast
    way = v * response + push * (slow_part - fast_part) / (2.0 * rate)
    return Flown(x + way, velocity, way, math.nan)


@inlined
def settling_time(flight: Flight, span: float) -> float:
    """Time in s after which a flight has died out; 0 of a body at rest, inf where it never does within a span."""
    _, _, v, _, _, push, sigma, rate, omega0_2 = flight
    if v == 0.0 and push == 0.0:
        return 0.0
    if sigma * span <= SETTLED or (omega0_2 == 0.0 and push + 2.0 * sigma * v != 0.0):
        return math.inf
    if flight.regime == Regime.UNDER:
        return SETTLED / sigma
    return SETTLED / (sigma + rate) if omega0_2 == 0.0 else SETTLED * (sigma + rate) / omega0_2


@kernel
def short_flight(v: float, push: float, sigma: float, omega0_2: float, t: float) -> tuple[float, float]:
    """Changes of position and velocity in a time below both time constants: the power series of the flight."""
    before = v  # (n+1) y_(n+1) t^n
    term = (push - 2.0 * sigma * v) * t
    position = v * t
    change = 0.0
    n = 1
    drag, spring = -2.0 * sigma * t, -omega0_2 * t * t
    while n < 24:
        change += term
        share = INVERSE[n + 1]
        position += (term * t) * share
        following = (drag * term + spring * (before * INVERSE[n])) * share
        before, term = term, following
        n += 1
        if abs(term) <= TERM * abs(change) and abs(before) <= TERM * abs(change):
            break
    return position, change


@kernel
def expand_flight(bodies: Array, flights: Flights, t: float, c: Array) -> None:
    """Write the Taylor table about the time t of flight: positions and velocities in their places of the state.

    Within half of the time constants one table serves many outputs: a polynomial costs less than a closed form. Numbers
    of three bodies side by side, in registers, do not wait for each other.
    """
    left, body, right = rates_of(bodies[LEFT]), rates_of(bodies[OBJECT]), rates_of(bodies[RIGHT])
    x_l, v_l, _, _ = fly(flights.left, t)
    x_o, v_o, _, _ = fly(flights.object, t)
    x_r, v_r, _, _ = fly(flights.right, t)
    for n in range(FLIGHT_ORDER + 1):
        i, share, one = LANES * n, INVERSE[n + 1], 1.0 if n == 0 else 0.0
        c[i + X.L], c[i + V.L], c[i + X.O], c[i + V.O], c[i + X.R], c[i + V.R] = x_l, v_l, x_o, v_o, x_r, v_r
        x_l, v_l = next_terms(left, one, x_l, v_l, share)
        x_o, v_o = next_terms(body, one, x_o, v_o, share)
        x_r, v_r = next_terms(right, one, x_r, v_r, share)


@inlined
def next_terms(rates: Rates, one: float, x: float, v: float, share: float) -> tuple[float, float]:
    """The next coefficients of position and velocity; `one` is 1 in order 0, which the constant force follows."""
    return share * v, share * ((one * rates.force - rates.stiffness * x) - rates.damping * v)

"""Where the energy of a segment goes: what dampers, feedback, friction and impacts take, and what inputs bring.

In a flight the energy of a body falls by (c + Kv) times the integral of v^2, so that the integral follows from both
ends. In a step the integrands are polynomials, for which Gauss quadrature of this order leaves no more than rounding.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.driver.energy_check import own_energy
from grasp_ros.exact.impact import elastic_force, stored_energy
from grasp_ros.exact.kinematics import approach
from grasp_ros.exact.numerics.polynomial import values
from grasp_ros.exact.records import Array
from grasp_ros.observe.sight import Seen, Sight
from grasp_ros.observe.step_extremes import WORK
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, Law, Of, Pair, U, V, X

NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(16)[0] + 1.0), 0.5 * np.polynomial.legendre.leggauss(16)[1])


@inlined
def add_damping(sight: Sight, seen: Array, body: Body, squares: float) -> None:
    """What damper and feedback of a body take, from the integral of v^2; drag of the object is friction."""
    taken = sight.own[body, Of.DAMPING] * squares
    if body == OBJECT:
        seen[Seen.FRICTION] += taken
    else:
        seen[Seen.DAMPERS] += taken
        seen[Seen.FEEDBACK] += (sight.bodies[body, Of.DAMPING] - sight.own[body, Of.DAMPING]) * squares


@kernel
def undamped_squares(row: Array, x: float, v: float, t: float) -> float:
    """Integral of v^2 over a flight without damping, where the energy does not tell it."""
    push = (row[Of.FORCE] - row[Of.STIFFNESS] * x) / row[Of.MASS]
    if row[Of.STIFFNESS] == 0.0:
        return t * (v * v + t * push * (v + t * push / 3.0))
    rate = math.sqrt(row[Of.STIFFNESS] / row[Of.MASS])
    a, b, turn = v, push / rate, rate * t  # v = a cos + b sin
    sine, cosine = math.sin(turn), math.cos(turn)
    half = 0.5 * sine * cosine / rate
    return a * a * (0.5 * t + half) + b * b * (0.5 * t - half) + a * b * sine * sine / rate


@kernel
def flight_squares(sight: Sight, body: Body) -> float:
    """Integral of v^2 over a flight, m^2/s."""
    row, lane = sight.bodies[body], velocity_lane(body)
    x, v, x_end, v_end = sight.before[lane - 1], sight.before[lane], sight.y[lane - 1], sight.y[lane]
    if row[Of.MASS] == math.inf:  # an object that sticks
        return 0.0
    if row[Of.DAMPING] == 0.0:
        return undamped_squares(row, x, v, sight.t)
    before = own_energy(row[Of.MASS], row[Of.STIFFNESS], row[Of.FORCE], x, v, 0.0)[0]
    after = own_energy(row[Of.MASS], row[Of.STIFFNESS], row[Of.FORCE], x_end, v_end, 0.0)[0]
    return 0.5 * (before - after) / row[Of.DAMPING]


@inlined
def clamped_loss(sight: Sight, side: Body) -> float:
    """What a pair that is closed without force takes: its stored energy goes."""
    if sight.mode[side] not in (Pair.CLAMPED, Pair.LEAVING):
        return 0.0
    hertzian = sight.pairs[side, Law.HERTZIAN]
    before, after = max(sight.before[U.L + side], 0.0), max(sight.y[U.L + side], 0.0)
    return stored_energy(hertzian, before) - stored_energy(hertzian, after)


@kernel
def flight_losses(sight: Sight, seen: Array) -> None:
    """Add what a flight takes."""
    for body in (LEFT, OBJECT, RIGHT):
        if sight.own[body, Of.DAMPING] != 0.0 or sight.bodies[body, Of.DAMPING] != 0.0:
            add_damping(sight, seen, body, flight_squares(sight, body))
    seen[Seen.IMPACTS] += clamped_loss(sight, LEFT) + clamped_loss(sight, RIGHT)


@inlined
def pace(sight: Sight, s: float) -> float:
    """dt/ds of the variable of the polynomials, s."""
    total = 0.0
    for k in range(sight.degree, 0, -1):
        total = total * s + k * sight.c[LANES * k + Lane.TIME]
    return total


@inlined
def impact_power(sight: Sight, at: Array, side: Body) -> float:
    """p H u^(3/2) u'^2 of a pair in contact, W."""
    if sight.mode[side] != Pair.CONTACT:
        return 0.0
    pair, d, z = sight.pairs[side], approach(at, side), max(at[U.L + side], 0.0)
    return pair[Law.DISSIPATION] * elastic_force(pair[Law.HERTZIAN], z * z) * d * d


@kernel
def step_losses(sight: Sight, seen: Array) -> None:
    """Add what a step with polynomials in regularised time takes."""
    at = sight.rows[WORK]
    left = right = middle = impacts = 0.0
    for j in range(NODES.shape[0]):
        s = sight.s * NODES[j]
        values(sight.c, sight.degree, s, at)
        share = sight.s * WEIGHTS[j] * pace(sight, s)
        left += share * at[velocity_lane(LEFT)] ** 2
        right += share * at[velocity_lane(RIGHT)] ** 2
        middle += share * at[V.O] ** 2
        impacts += share * (impact_power(sight, at, LEFT) + impact_power(sight, at, RIGHT))
    add_damping(sight, seen, LEFT, left)
    add_damping(sight, seen, RIGHT, right)
    add_damping(sight, seen, OBJECT, middle)
    seen[Seen.IMPACTS] += impacts + clamped_loss(sight, LEFT) + clamped_loss(sight, RIGHT)


@kernel
def add_losses(sight: Sight, base: Array, seen: Array) -> None:
    """Add what a segment takes, and the work of the forces that are not in `base`: held commands, external forces."""
    if sight.kind == Kind.FLIGHT:
        flight_losses(sight, seen)
    else:
        step_losses(sight, seen)
    for body in (LEFT, OBJECT, RIGHT):
        place = velocity_lane(body) - 1
        seen[Seen.WORK] += (sight.given[body, Of.FORCE] - base[body, Of.FORCE]) * (sight.y[place] - sight.before[place])
    if sight.bodies[OBJECT, Of.MASS] < math.inf:
        against = sight.given[OBJECT, Of.FORCE] - sight.bodies[OBJECT, Of.FORCE]
        seen[Seen.FRICTION] += against * (sight.y[X.O] - sight.before[X.O])

"""Where the energy of a segment goes: what dampers, feedback, friction and impacts take, and what inputs bring.

In a flight the energy of a body falls by (c + Kv) times the integral of v^2, so that the integral follows from both
ends. In a step the integrands are polynomials, for which Gauss quadrature of this order leaves no more than rounding.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.energy_check import own_energy
from grasp_ros.exact.impact import elastic_force, stored_energy
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, velocity_lane
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.records import Array
from grasp_ros.exact.sight import Seen, Sight
from grasp_ros.exact.step_extremes import WORK
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LANES,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    TIME,
    U_L,
    V_O,
    X_O,
    Body,
    Pair,
    Segment,
)

NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(16)[0] + 1.0), 0.5 * np.polynomial.legendre.leggauss(16)[1])


@inlined
def add_damping(sight: Sight, seen: Array, body: Body, squares: float) -> None:
    """What damper and feedback of a body take, from the integral of v^2; drag of the object is friction."""
    taken = sight.own[body, DAMPING] * squares
    if body == OBJECT:
        seen[Seen.FRICTION] += taken
    else:
        seen[Seen.DAMPERS] += taken
        seen[Seen.FEEDBACK] += (sight.bodies[body, DAMPING] - sight.own[body, DAMPING]) * squares


@kernel
def undamped_squares(row: Array, x: float, v: float, t: float) -> float:
    """Integral of v^2 over a flight without damping, where the energy does not tell it."""
    push = (row[FORCE] - row[STIFFNESS] * x) / row[MASS]
    if row[STIFFNESS] == 0.0:
        return t * (v * v + t * push * (v + t * push / 3.0))
    rate = math.sqrt(row[STIFFNESS] / row[MASS])
    a, b, turn = v, push / rate, rate * t  # v = a cos + b sin
    sine, cosine = math.sin(turn), math.cos(turn)
    half = 0.5 * sine * cosine / rate
    return a * a * (0.5 * t + half) + b * b * (0.5 * t - half) + a * b * sine * sine / rate


@kernel
def flight_squares(sight: Sight, body: Body) -> float:
    """Integral of v^2 over a flight, m^2/s."""
    row, lane = sight.bodies[body], velocity_lane(body)
    x, v, x_end, v_end = sight.before[lane - 1], sight.before[lane], sight.y[lane - 1], sight.y[lane]
    if row[MASS] == math.inf:  # an object that sticks
        return 0.0
    if row[DAMPING] == 0.0:
        return undamped_squares(row, x, v, sight.t)
    before = own_energy(row[MASS], row[STIFFNESS], row[FORCE], x, v, 0.0)[0]
    after = own_energy(row[MASS], row[STIFFNESS], row[FORCE], x_end, v_end, 0.0)[0]
    return 0.5 * (before - after) / row[DAMPING]


@inlined
def clamped_loss(sight: Sight, side: Body) -> float:
    """What a pair that is closed without force takes: its stored energy goes."""
    if sight.mode[side] not in (Pair.CLAMPED, Pair.LEAVING):
        return 0.0
    hertzian = sight.pairs[side, HERTZIAN]
    before, after = max(sight.before[U_L + side], 0.0), max(sight.y[U_L + side], 0.0)
    return stored_energy(hertzian, before) - stored_energy(hertzian, after)


@kernel
def flight_losses(sight: Sight, seen: Array) -> None:
    """Add what a flight takes."""
    for body in (LEFT, OBJECT, RIGHT):
        if sight.own[body, DAMPING] != 0.0 or sight.bodies[body, DAMPING] != 0.0:
            add_damping(sight, seen, body, flight_squares(sight, body))
    seen[Seen.IMPACTS] += clamped_loss(sight, LEFT) + clamped_loss(sight, RIGHT)


@inlined
def penetration_at(sight: Sight, at: Array, side: Body) -> float:
    """u of a pair in contact."""
    z = max(at[U_L + side], 0.0)
    return z * z if sight.kind == Segment.CONTACT else z


@inlined
def pace(sight: Sight, s: float) -> float:
    """dt/ds of the variable of the polynomials, s."""
    if sight.kind == Segment.START:
        return 4.0 * sight.unit * s * s * s
    total = 0.0
    for k in range(sight.degree, 0, -1):
        total = total * s + k * sight.c[LANES * k + TIME]
    return total


@inlined
def impact_power(sight: Sight, at: Array, side: Body) -> float:
    """p H u^(3/2) u'^2 of a pair in contact, W."""
    if sight.mode[side] != Pair.CONTACT:
        return 0.0
    pair, d = sight.pairs[side], approach(at, side)
    return pair[DISSIPATION] * elastic_force(pair[HERTZIAN], penetration_at(sight, at, side)) * d * d


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
        middle += share * at[V_O] ** 2
        impacts += share * (impact_power(sight, at, LEFT) + impact_power(sight, at, RIGHT))
    add_damping(sight, seen, LEFT, left)
    add_damping(sight, seen, RIGHT, right)
    add_damping(sight, seen, OBJECT, middle)
    seen[Seen.IMPACTS] += impacts + clamped_loss(sight, LEFT) + clamped_loss(sight, RIGHT)


@inlined
def energy_of(sight: Sight, y: Array) -> float:
    """Energy of bodies and pairs in a segment, J of V."""
    total = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = sight.bodies[body], velocity_lane(body)
        if row[MASS] < math.inf:
            total += own_energy(row[MASS], row[STIFFNESS], row[FORCE], y[lane - 1], y[lane], 0.0)[0]
    for side in (LEFT, RIGHT):
        if sight.mode[side] != Pair.ABSENT:
            total += 2.0 * stored_energy(sight.pairs[side, HERTZIAN], max(y[U_L + side], 0.0))
    return total


@kernel
def creep_losses(sight: Sight, seen: Array) -> None:
    """Add what an implicit step takes: of the impacts it is what the energy balance leaves."""
    at, dampers = sight.rows[WORK], 0.0
    for body in (LEFT, OBJECT, RIGHT):
        if sight.bodies[body, DAMPING] != 0.0:
            squares = 0.0
            for j in range(NODES.shape[0]):
                values(sight.c, sight.degree, sight.s * NODES[j], at)
                squares += sight.t * WEIGHTS[j] * at[velocity_lane(body)] ** 2
            dampers += sight.bodies[body, DAMPING] * squares
            add_damping(sight, seen, body, squares)
    seen[Seen.IMPACTS] += 0.5 * (energy_of(sight, sight.before) - energy_of(sight, sight.y)) - dampers


@kernel
def add_losses(sight: Sight, base: Array, seen: Array) -> None:
    """Add what a segment takes, and the work of the forces that are not in `base`: held commands, external forces."""
    if sight.kind == Segment.FLIGHT:
        flight_losses(sight, seen)
    elif sight.kind == Segment.CREEP:
        creep_losses(sight, seen)
    else:
        step_losses(sight, seen)
    for body in (LEFT, OBJECT, RIGHT):
        place = velocity_lane(body) - 1
        seen[Seen.WORK] += (sight.given[body, FORCE] - base[body, FORCE]) * (sight.y[place] - sight.before[place])
    if sight.bodies[OBJECT, MASS] < math.inf:
        against = sight.given[OBJECT, FORCE] - sight.bodies[OBJECT, FORCE]
        seen[Seen.FRICTION] += against * (sight.y[X_O] - sight.before[X_O])

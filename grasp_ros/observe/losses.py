"""Where the energy of a segment goes: what dampers, feedback, friction and impacts take, and what inputs bring.

In a flight the energy of a body falls by (c + Kv) times the integral of v^2, so that the integral follows from both
ends; where c + Kv takes next to nothing, the velocity itself is integrated. In a step the integrands are polynomials,
for which Gauss quadrature of this order leaves no more than rounding.
"""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.driver.energy_check import own_energy
from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.impact import elastic_force, stored_energy
from grasp_ros.exact.kinematics import approach
from grasp_ros.exact.numerics.polynomial import values
from grasp_ros.exact.records import Array, Flight
from grasp_ros.observe.extremes import WORK
from grasp_ros.observe.record import Seen, SegmentRecord
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, Law, Of, Pair, U, V, X

NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(16)[0] + 1.0), 0.5 * np.polynomial.legendre.leggauss(16)[1])
DAMPED = 1e-3  # of m/c: in a shorter time a damper takes so little of the energy that three digits and more are lost
SWUNG = 6.0  # rad, up to which the quadrature follows v^2 to rounding


@inlined
def add_damping(segment: SegmentRecord, body: Body, squares: float) -> None:
    """What damper and feedback of a body take, from the integral of v^2; drag of the object is friction."""
    seen, taken = segment.m.seen, segment.m.own[body, Of.DAMPING] * squares
    if body == OBJECT:
        seen[Seen.FRICTION] += taken
    else:
        seen[Seen.DAMPERS] += taken
        seen[Seen.FEEDBACK] += (segment.m.bodies[body, Of.DAMPING] - segment.m.own[body, Of.DAMPING]) * squares


@kernel
def flight_squares(segment: SegmentRecord, body: Body) -> float:
    """Integral of v^2 over a flight, m^2/s."""
    row, lane = segment.m.bodies[body], velocity_lane(body)
    x, v = segment.m.before[lane - 1], segment.m.before[lane]
    if row[Of.MASS] == math.inf:  # an object that sticks
        return 0.0
    if abs(row[Of.DAMPING]) * segment.t > DAMPED * row[Of.MASS]:
        before = own_energy(row[Of.MASS], row[Of.STIFFNESS], row[Of.FORCE], x, v, 0.0)[0]
        x, v = segment.m.y[lane - 1], segment.m.y[lane]
        after = own_energy(row[Of.MASS], row[Of.STIFFNESS], row[Of.FORCE], x, v, 0.0)[0]
        return 0.5 * (before - after) / row[Of.DAMPING]
    flight = launch(row, x, v)
    if flight.rate * segment.t > SWUNG:
        return swing_squares(flight, segment.t)
    total = 0.0
    for j in range(NODES.shape[0]):
        total += WEIGHTS[j] * fly(flight, segment.t * NODES[j]).v ** 2
    return segment.t * total


@kernel
def swing_squares(flight: Flight, t: float) -> float:
    """Integral of v^2, m^2/s, of an oscillation, v = exp(-sigma t) (a cos + b sin), in closed form."""
    a, b, p, turn = flight.v, (flight.push - flight.sigma * flight.v) / flight.rate, 2.0 * flight.sigma, flight.rate * t
    decay, q = math.exp(-p * t), 2.0 * flight.rate
    cosine, sine = decay * math.cos(2.0 * turn), decay * math.sin(2.0 * turn)
    mean = t if p == 0.0 else -math.expm1(-p * t) / p
    real = (p * (1.0 - cosine) + q * sine) / (p * p + q * q)
    imaginary = (q * (1.0 - cosine) - p * sine) / (p * p + q * q)
    return 0.5 * ((a * a + b * b) * mean + (a * a - b * b) * real) + a * b * imaginary


@inlined
def clamped_loss(segment: SegmentRecord, side: Body) -> float:
    """Stored energy that a CLAMPED or LEAVING pair loses in a segment."""
    if segment.m.mode[side] not in (Pair.CLAMPED, Pair.LEAVING):
        return 0.0
    hertzian = segment.m.pairs[side, Law.HERTZIAN]
    before, after = max(segment.m.before[U.L + side], 0.0), max(segment.m.y[U.L + side], 0.0)
    return stored_energy(hertzian, before) - stored_energy(hertzian, after)


@inlined
def impact_power(segment: SegmentRecord, at: Array, side: Body) -> float:
    """p H u^(3/2) u'^2 of a pair in contact, W."""
    if segment.m.mode[side] != Pair.CONTACT:
        return 0.0
    pair, d, z = segment.m.pairs[side], approach(at, side), max(at[U.L + side], 0.0)
    return pair[Law.DISSIPATION] * elastic_force(pair[Law.HERTZIAN], z * z) * d * d


@kernel
def step_losses(segment: SegmentRecord) -> None:
    """Add what a step with polynomials in regularised time takes."""
    at = segment.m.rows[WORK]
    left = right = middle = impacts = 0.0
    for j in range(NODES.shape[0]):
        s = segment.s * NODES[j]
        values(segment.m.c, segment.degree, s, at)
        pace = 0.0  # dt/ds
        for k in range(segment.degree, 0, -1):
            pace = pace * s + k * segment.m.c[LANES * k + Lane.TIME]
        share = segment.s * WEIGHTS[j] * pace
        left += share * at[velocity_lane(LEFT)] ** 2
        right += share * at[velocity_lane(RIGHT)] ** 2
        middle += share * at[V.O] ** 2
        impacts += share * (impact_power(segment, at, LEFT) + impact_power(segment, at, RIGHT))
    add_damping(segment, LEFT, left)
    add_damping(segment, RIGHT, right)
    add_damping(segment, OBJECT, middle)
    segment.m.seen[Seen.IMPACTS] += impacts + clamped_loss(segment, LEFT) + clamped_loss(segment, RIGHT)


@kernel
def add_losses(segment: SegmentRecord) -> None:
    """Add what a segment takes, and the work of the forces that are not in `base`: held commands, external forces."""
    seen = segment.m.seen
    if segment.kind == Kind.FLIGHT:
        for body in (LEFT, OBJECT, RIGHT):
            if segment.m.own[body, Of.DAMPING] != 0.0 or segment.m.bodies[body, Of.DAMPING] != 0.0:
                add_damping(segment, body, flight_squares(segment, body))
        seen[Seen.IMPACTS] += clamped_loss(segment, LEFT) + clamped_loss(segment, RIGHT)
    else:
        step_losses(segment)
    for body in (LEFT, OBJECT, RIGHT):
        lane = velocity_lane(body) - 1
        push = segment.m.given[body, Of.FORCE] - segment.m.base[body, Of.FORCE]
        seen[Seen.WORK] += push * (segment.m.y[lane] - segment.m.before[lane])
    if segment.m.bodies[OBJECT, Of.MASS] < math.inf:
        against = segment.m.given[OBJECT, Of.FORCE] - segment.m.bodies[OBJECT, Of.FORCE]
        seen[Seen.FRICTION] += against * (segment.m.y[X.O] - segment.m.before[X.O])

"""Start of a contact where regularised time stops: w_l w_r = 0, or u = u' = 0.

Such a pair is BEGINNING: it moves without its force while the impulse neglected is below FORCE_FREE mu v; mu: reduced
mass, v: the largest of |u'| and the speeds of its bodies, whose roundings are larger. `force_free_time`
finds how long; while the other pair pushes, `contact.segment.force_free_length` does. `modes.end_begin` ends it.
"""

from __future__ import annotations

import math

from grasp_ros.exact.automaton.edge import HIGHEST, LONGEST, short_time, write_own_series
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.kinematics import approach, other, rate_lanes, reduced_mass
from grasp_ros.exact.numerics.powers_of_two import exponent, power_of_two
from grasp_ros.exact.numerics.roots import value_and_rate
from grasp_ros.exact.records import Array, Plant, State
from grasp_ros.exact.tolerances import DERIVATIVE, FORCE_FREE
from grasp_ros.physics.layout import OBJECT, Body, Law, Of, Pair, U

MOST_HALVINGS = 200  # of a short flight


@inlined
def must_begin(state: State, side: Body) -> bool:
    """Whether a pair in contact is where no Taylor step can start."""
    y, opposite = state.y, other(side)
    if state.mode[side] != Pair.CONTACT or y[U.L + side] != 0.0:
        return False
    joint = state.mode[opposite] in (Pair.CONTACT, Pair.BEGINNING) and y[U.L + opposite] == 0.0
    return bool(joint or approach(y, side) == 0.0)


@inlined
def force_free_time(f: Array, plant: Plant, state: State, side: Body) -> float:
    """Time in s, a power of two, for which a pair at u = 0 that begins may fly without its force.

    The search multiplies a tiny time until the force neglected is too large or u' changes its sign: until then the
    force is largest at the end. inf if not BEGINNING or not moved. The series of u is left in f.
    """
    y = state.y
    if state.mode[side] != Pair.BEGINNING or write_own_series(plant, y, side, f) == 0.0:
        return math.inf
    longest, speed = min(short_time(plant, side), LONGEST), speed_of_pair(y, side)
    time = power_of_two(exponent(longest) - MOST_HALVINGS)
    closes = value_and_rate(f, HIGHEST, time)[1] > 0.0
    for stride in (2.0**16, 2.0):
        while stride * time <= longest:
            u, d, _ = value_and_rate(f, HIGHEST, stride * time)
            if u < 0.0 or (d > 0.0) != closes or not leaves_force_out(plant, side, u, d, speed):
                break
            time *= stride
    return time


@inlined
def speed_of_pair(y: Array, side: Body) -> float:
    """The larger speed of arm and object, m/s."""
    front, back = rate_lanes(side)
    return max(abs(y[front]), abs(y[back]))


@kernel
def leaves_force_out(plant: Plant, side: Body, u: float, d: float, speed: float) -> bool:
    """Whether a pair that begins may have moved to u, u' = d without its force; speed is the larger of its bodies."""
    d = abs(d)
    if u <= 0.0 or d == 0.0:
        return u <= 0.0
    pair, motion = plant.pairs[side], reduced_mass(plant.bodies, side) * max(d, speed)
    force = elastic_force(pair[Law.HERTZIAN], u) * damping_factor(pair[Law.DISSIPATION], d)
    # A stuck object slips by the force, not by the impulse.
    hidden = plant.coulomb == 0.0 or force <= FORCE_FREE * plant.coulomb
    return bool(hidden and force * (u / d) <= FORCE_FREE * motion)


@kernel
def is_negligible(plant: Plant, side: Body, u: float, d: float, part: float) -> bool:
    """Whether the impulse of a pair between u = 0 and u is below a part of mu u', with the reduced mass mu.

    If the object sticks the force itself must be negligible, too: whether the object slips depends on it.
    """
    pair, d = plant.pairs[side], abs(d)
    if u <= 0.0 or d == 0.0:
        return u <= 0.0
    force = elastic_force(pair[Law.HERTZIAN], u) * damping_factor(pair[Law.DISSIPATION], d)
    if plant.bodies[OBJECT, Of.MASS] == math.inf and force > DERIVATIVE * plant.coulomb:
        return False
    return force * (u / d) <= part * reduced_mass(plant.bodies, side) * d

"""The begin of a contact that the regularised time cannot begin: it stops where w_l w_r = 0, and where u = u' = 0.

Such a pair is BEGINNING: it moves without its force for as long as the impulse left out is below HELD mu v, where mu is
its reduced mass and v the largest of |u'| and the speeds of its two bodies. Roundings of these velocities are larger.
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
from grasp_ros.exact.tolerances import HELD
from grasp_ros.physics.layout import Body, Law, Pair, U

MOST_HALVINGS = 200  # of a short flight


@inlined
def must_begin(state: State, side: Body) -> bool:
    """Whether a pair is in contact where its Taylor steps cannot begin."""
    y, beside = state.y, other(side)
    if state.mode[side] != Pair.CONTACT or y[U.L + side] != 0.0:
        return False
    joint = state.mode[beside] in (Pair.CONTACT, Pair.BEGINNING) and y[U.L + beside] == 0.0
    return bool(joint or approach(y, side) == 0.0)


@kernel
def force_free_time(f: Array, plant: Plant, state: State, side: Body) -> float:
    """Time in s, a power of two, for which a pair at u = 0 that begins may fly without its force.

    The search multiplies a tiny time until the force left out is too large or u' changes its sign: up to there the
    force is largest at the end. inf where nothing moves the pair. The series of u is written to f.
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
    hidden = plant.coulomb == 0.0 or force <= HELD * plant.coulomb  # a stuck object slips by the force, not the impulse
    return bool(hidden and force * (u / d) <= HELD * motion)

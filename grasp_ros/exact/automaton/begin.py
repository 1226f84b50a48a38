"""The begin of a contact that the regularised time cannot begin: it stops where w_l w_r = 0, and where u = u' = 0.

Such a pair is BEGINNING: it moves without its force for as long as the impulse that this leaves out is below a part
2^-HELD of that of its motion, or of the velocities of its bodies, whose roundings are as large.
"""

from __future__ import annotations

import math

from grasp_ros.exact.automaton.resting_pair import HIGHEST, difference, short_time
from grasp_ros.exact.compilation.jit import inlined, kernel, whole
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.kinematics import approach, other, rate_lanes, reduced_mass
from grasp_ros.exact.numerics.powers_of_two import exponent, power_of_two
from grasp_ros.exact.records import Array, Plant, State
from grasp_ros.exact.tolerances import DERIVATIVE, HELD, OUTWEIGHS
from grasp_ros.physics.layout import Body, Law, Pair, U

FORCE, IMPULSE = whole(0), whole(2)  # twice the power of the time by which a force is multiplied


@inlined
def must_begin(state: State, side: Body) -> bool:
    """Whether a pair is in contact where its Taylor steps cannot begin."""
    y, beside = state.y, other(side)
    if state.mode[side] != Pair.CONTACT or y[U.L + side] != 0.0:
        return False
    joint = state.mode[beside] in (Pair.CONTACT, Pair.BEGINNING) and y[U.L + beside] == 0.0
    return bool(joint or approach(y, side) == 0.0)


@kernel
def time_of_impulse(per_hertz: float, loss: float, order: float, a: float) -> float:
    """Power of two below the time t, in s, at which the impulse of u = a t^order is 2^-HELD of that of the motion.

    H u^(5/2) (1 + p u') = 2^-HELD mu u'^2, without the numbers; per_hertz is mu / H. It compares exponents, and
    integers of them: other units give the same time. That of a^2 is one of its own, because a unit of a may be half a
    power.
    """
    part = a * power_of_two(-exponent(a))  # from 1 to 2; a^2 leaves the range of numbers
    twice, above = int(2.0 * order), 2 * exponent(a) + exponent(part * part) + 1  # 2^above >= a^2
    e = (4 * (exponent(per_hertz * order * order) - HELD) - above) // (twice + 8)
    if loss > 0.0:
        e = min(e, (4 * (exponent(per_hertz * order / loss) - HELD) - 3 * above) // (3 * twice + 4))
    return power_of_two(e)


@kernel
def time_of_force(reach: float, loss: float, order: int, a: float, power: int) -> float:
    """The time t at which u^(3/2) (1 + p u') t^(power / 2) has come to 2^-HELD `reach`, a power of two.

    With power FORCE a force has come to a part of another one, with IMPULSE its impulse to a part of a motion.
    """
    if reach == 0.0:
        return 0.0
    above = exponent(a) + 1
    e = (2 * (exponent(reach) - HELD) - 3 * above) // (3 * order + power)
    if loss > 0.0:
        e = min(e, (2 * (exponent(reach / (loss * order)) - HELD) - 5 * above) // (5 * order - 2 + power))
    return power_of_two(e)


@kernel
def force_free_time(plant: Plant, state: State, side: Body) -> float:
    """Time in s for which a pair at u = 0 that begins may fly without its force; inf where nothing moves it."""
    if state.mode[side] != Pair.BEGINNING:
        return math.inf
    y, loss = state.y, plant.pairs[side, Law.DISSIPATION]
    per_hertz = reduced_mass(plant.bodies, side) / plant.pairs[side, Law.HERTZIAN]
    time, factorial, speed = math.inf, 1.0, speed_of_pair(y, side)
    first, leading = 0, 0.0
    for order in range(1, HIGHEST + 1):
        factorial *= order
        value, size = (approach(y, side), 0.0) if order == 1 else difference(plant, y, side, order)
        if abs(value) <= DERIVATIVE * size:
            continue
        a = abs(value) / factorial
        if first == 0:
            first, leading = order, a
        else:
            time = min(time, power_of_two((exponent(leading / a) - OUTWEIGHS) // (order - first)))
        time = min(time, max(time_of_impulse(per_hertz, loss, float(order), a),
                             time_of_force(per_hertz * speed, loss, order, a, IMPULSE)))
        if plant.coulomb > 0.0:
            time = min(time, time_of_force(plant.coulomb / plant.pairs[side, Law.HERTZIAN], loss, order, a, FORCE))
    return time if time == math.inf else min(time, short_time(plant, side))


@inlined
def speed_of_pair(y: Array, side: Body) -> float:
    """The larger speed of arm and object, m/s."""
    front, back = rate_lanes(side)
    return max(abs(y[front]), abs(y[back]))


@kernel
def leaves_force_out(plant: Plant, side: Body, y: Array, u: float) -> bool:
    """Whether a pair that begins may have come to u and to the velocities in y without its force."""
    d = abs(approach(y, side))
    if u <= 0.0 or d == 0.0:
        return u <= 0.0
    pair, motion = plant.pairs[side], reduced_mass(plant.bodies, side) * max(d, speed_of_pair(y, side))
    force = elastic_force(pair[Law.HERTZIAN], u) * damping_factor(pair[Law.DISSIPATION], d)
    hidden = plant.coulomb == 0.0 or force <= 2.0**-HELD * plant.coulomb  # of an object that sticks the force decides
    return bool(hidden and force * (u / d) <= 2.0**-HELD * motion)

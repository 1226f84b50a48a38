"""A pair on the edge of a mode: which way it goes, how long that is certain, and whether its force matters.

The edges are u = u' = 0, and u' = -1/p, where the force ends. Each body obeys m x'' + c x' + k x = f, so its
derivatives follow from each other, and the first one in which arm and object differ decides. Their motion relative to
each other obeys an equation of order five: no difference up to order six means that they move together for ever.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import kernel, whole
from grasp_ros.exact.impact import elastic_force, elastic_slope
from grasp_ros.exact.kinematics import approach, difference, other, reduced_mass, relative_motion, surface_factor
from grasp_ros.exact.numerics.roots import first_rise
from grasp_ros.exact.records import Array, Deciding, Integers, Plant, State
from grasp_ros.exact.tolerances import CLAMPS, DERIVATIVE, SHORT_START, SURFACE, TURNS
from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.impact_law import EXPONENT
from grasp_ros.physics.layout import OBJECT, Body, Law, Of, Pair, U

LOWEST, NEXT, HIGHEST = (whole(order) for order in (2, 3, 6))  # int64: numba compiles anew for each literal
LONGEST = RANGES["duration"].high  # s
UNDECIDED, NEVER = 0.0, math.inf  # orders if no derivative decides
GROWTH = math.gamma(2.0 * EXPONENT + 1.0)  # derivative of that order of t^(2 EXPONENT); 2 EXPONENT is whole


@kernel
def other_push(plant: Plant, state: State, side: Body) -> tuple[float, float]:
    """Acceleration in m/s^2, and its rate, that the force of the other pair gives the object towards `side`."""
    opposite = other(side)
    u = state.y[U.L + opposite]
    if state.mode[opposite] != Pair.CONTACT or u <= 0.0:
        return 0.0, 0.0
    hertzian, loss = plant.pairs[opposite, Law.HERTZIAN], plant.pairs[opposite, Law.DISSIPATION]
    mass = plant.bodies[OBJECT, Of.MASS]
    d, a = relative_motion(plant, state.y, opposite)
    elastic, factor = elastic_force(hertzian, u), surface_factor(plant.pairs, state.y, opposite, SURFACE)
    a -= elastic * factor / reduced_mass(plant.bodies, opposite)
    pace = elastic_slope(hertzian, u) * d * factor + elastic * loss * a
    return elastic * factor / mass, pace / mass


@kernel
def deciding_derivative(plant: Plant, state: State, side: Body) -> Deciding:
    """The first derivative of u of a pair at rest that differs from zero by more than its rounding.

    If the other contact pushes, its force and the rate of its force are part of the derivatives 2 and 3, and no higher
    one is known. If it has no force yet, see `coming_push`, it closes this pair unless a lower derivative decides.
    """
    own = own_difference(plant, state.y, side)
    if plant.bodies[OBJECT, Of.MASS] == math.inf:
        return own
    opposite = other(side)
    presses = state.mode[opposite] == Pair.CONTACT and state.y[U.L + opposite] > 0.0
    if presses and surface_factor(plant.pairs, state.y, opposite, SURFACE) != 0.0:
        push, pace = other_push(plant, state, side)
        found = first_difference(plant, state.y, side, push, pace, NEXT)
        return found if found.order < NEVER else Deciding(UNDECIDED, 0.0)
    coming = coming_push(plant, state, opposite)
    if own.order < coming.order or coming.order == NEVER:
        return own
    return Deciding(coming.order, coming.value + own.value if own.order == coming.order else coming.value)


@kernel
def coming_push(plant: Plant, state: State, opposite: Body) -> Deciding:
    """The first derivative of u of a pair that the force of the pair `opposite` moves, which has no force yet.

    The force of a pair that closes from u = 0 like t^n grows like t^(3 n / 2), that of a pair at u' = -1/p like
    u' + 1/p. It moves u of this pair with two powers more. Without a derivative of that order to add to, it is inf.
    """
    y, mode, pair, mass = state.y, state.mode[opposite], plant.pairs[opposite], plant.bodies[OBJECT, Of.MASS]
    if mode not in (Pair.CONTACT, Pair.BEGINNING):
        return Deciding(NEVER, 0.0)
    u, (order, value) = y[U.L + opposite], own_difference(plant, y, opposite)
    if mode == Pair.CONTACT and u > 0.0:
        return Deciding(order + 1.0, elastic_force(pair[Law.HERTZIAN], u) * pair[Law.DISSIPATION] * value / mass)
    power = 1.0 if approach(y, opposite) != 0.0 else order
    grows = GROWTH * elastic_force(pair[Law.HERTZIAN], max(0.5 * value, 0.0)) / mass if power == LOWEST else math.inf
    return Deciding(EXPONENT * power + 2.0, grows)


@kernel
def first_difference(plant: Plant, y: Array, side: Body, push: float, pace: float, highest: int) -> Deciding:
    """The first derivative of u beyond its rounding, or NEVER; `push` is a further acceleration, `pace` its rate."""
    drag = plant.bodies[OBJECT, Of.DAMPING] / plant.bodies[OBJECT, Of.MASS]
    for order in range(LOWEST, highest + 1):
        value, size = difference(plant, y, side, order)
        added = push if order == 2 else (pace - drag * push if order == 3 else 0.0)
        value += added
        if abs(value) > DERIVATIVE * (size + abs(added)):
            return Deciding(float(order), value)
    return Deciding(NEVER, 0.0)


@kernel
def own_difference(plant: Plant, y: Array, side: Body) -> Deciding:
    """`first_difference` without the other pair's push."""
    return first_difference(plant, y, side, 0.0, 0.0, HIGHEST)


@kernel
def write_own_series(plant: Plant, y: Array, side: Body, f: Array) -> float:
    """Write the series of u without impact forces up to the order HIGHEST; returns its first coefficient that is not 0.

    0 if there is none.
    """
    f[0], f[1], factorial = y[U.L + side], approach(y, side), 1.0
    for order in range(LOWEST, HIGHEST + 1):
        factorial *= order
        value, size = difference(plant, y, side, order)
        f[order] = value / factorial if abs(value) > DERIVATIVE * size else 0.0
    for k in range(HIGHEST + 1):
        if f[k] != 0.0:
            return f[k]
    return 0.0


@kernel
def separates(plant: Plant, y: Array, side: Body) -> bool:
    """Whether a pair separates, and without its force neither turns back nor gets to u' = -1/p before u = 0."""
    d, loss = approach(y, side), plant.pairs[side, Law.DISSIPATION]
    if not d < 0.0:
        return False
    t = y[U.L + side] / -d
    a, jerk = abs(difference(plant, y, side, LOWEST)[0]), abs(difference(plant, y, side, NEXT)[0])
    change = max(t * a, 0.5 * t * (t * jerk))  # in this order, because squares underflow
    clamps = 0.0 < surface_factor(plant.pairs, y, side, SURFACE) < CLAMPS * loss * change
    return bool(TURNS * change < -d and not clamps)


@kernel
def short_time(plant: Plant, side: Body) -> float:
    """Time in s within which a flight from u = 0 takes its power series; inf without springs and dampers."""
    rate = 0.0
    for body in (side, OBJECT):
        row = plant.bodies[body]
        rate = max(rate, abs(row[Of.DAMPING]) / row[Of.MASS] + math.sqrt(row[Of.STIFFNESS] / row[Of.MASS]))
    return SHORT_START / rate if rate > 0.0 else math.inf


@kernel
def parting_time(f: Array, plant: Plant, state: State, side: Body, work: Integers) -> float:
    """Time in s for which a pair at rest keeps the sign of u in a short flight; inf if nothing moves it.

    Half of that by the series up to the order HIGHEST, which is left in f, to allow for higher terms.
    """
    first = write_own_series(plant, state.y, side, f)
    if first == 0.0:
        return math.inf
    if first > 0.0:
        for k in range(HIGHEST + 1):
            f[k] = -f[k]
    longest = short_time(plant, side)
    return 0.5 * min(first_rise(f, HIGHEST, min(longest, LONGEST), 0.0, work), longest)


@kernel
def surface_side(plant: Plant, state: State, side: Body) -> float:
    """1 + p u', positive in contact; if that is within its rounding, the first derivative of u' that is not 0, or 0."""
    factor = surface_factor(plant.pairs, state.y, side, SURFACE)
    if factor != 0.0:
        return float(factor)
    push, pace = other_push(plant, state, side)
    highest = HIGHEST if push == 0.0 and pace == 0.0 else NEXT  # of an impact no more is known
    return float(first_difference(plant, state.y, side, push, pace, highest).value)


@kernel
def keeps_rate(plant: Plant, state: State, side: Body) -> bool:
    """Whether u' of a pair stays as it is without impacts."""
    return bool(own_difference(plant, state.y, side).order == NEVER)


@kernel
def glides(plant: Plant, state: State, side: Body) -> bool:
    """Whether nothing moves a pair off u' = -1/p: neither its own motion nor a push of the other pair.

    The other one has no force, or glides as well: in a symmetric grasp both are treated alike at one instant. One that
    begins is going to push.
    """
    opposite = other(side)
    if state.mode[opposite] == Pair.BEGINNING or not keeps_rate(plant, state, side):
        return False
    if state.mode[opposite] == Pair.CONTACT and surface_factor(plant.pairs, state.y, opposite, SURFACE) != 0.0:
        return False
    return state.mode[opposite] not in (Pair.CONTACT, Pair.CLAMPED) or keeps_rate(plant, state, opposite)


@kernel
def has_glided(plant: Plant, state: State, side: Body, roundings: float) -> bool:
    """Whether a pair is at u' = -1/p but for some roundings, and nothing moves it off."""
    return surface_factor(plant.pairs, state.y, side, roundings) == 0.0 and bool(glides(plant, state, side))

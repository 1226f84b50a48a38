"""A pair at u = u' = 0: which way it goes, how long that is certain, and whether its force matters.

Each body obeys m x'' + c x' + k x = f, so its derivatives follow from each other, and the first one in which arm and
object differ decides. Their motion relative to each other obeys an equation of order five: no difference up to order
six means that they move together for ever.
"""

from __future__ import annotations

import math

from grasp_ros.exact.bits import exponent, power_of_two
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import (
    approach,
    arm_of,
    bound,
    derivatives,
    other,
    reduced_mass,
    relative_motion,
    surface_factor,
)
from grasp_ros.exact.records import Array, Leaning, Plant, State
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    EPS,
    HERTZIAN,
    MASS,
    OBJECT,
    STIFFNESS,
    U_L,
    V_O,
    X_O,
    Body,
    Pair,
)

NOTHING = 2.0**-72  # of a way: below its roundings long before
TURNS, CLAMPS = 20.0, 4.0  # times what u' may change on the way to u = 0: both terms, and those behind them
LOWEST, HIGHEST = 2, 6  # derivatives
ROUNDINGS = 4.0  # of 1 + p u'
DOUBT = 64.0 * EPS  # of the sum of the terms of a derivative
SHORT = 0.2  # of the time constants, well within those of `flight.SHORT`, where u keeps its own digits
UNDECIDED, NEVER = 0.0, math.inf  # orders of a `Leaning` that is none


@kernel
def impact_beside(plant: Plant, state: State, side: Body) -> tuple[float, float]:
    """Acceleration in m/s^2, and its rate, that the force of the other pair gives the object towards `side`."""
    beside = other(side)
    u = state.y[U_L + beside]
    if state.mode[beside] != Pair.CONTACT or u <= 0.0:
        return 0.0, 0.0
    hertzian, loss, mass = plant.pairs[beside, HERTZIAN], plant.pairs[beside, DISSIPATION], plant.bodies[OBJECT, MASS]
    d, a = relative_motion(plant, state.y, beside)
    elastic, factor = elastic_force(hertzian, u), surface_factor(plant, state.y, beside, ROUNDINGS)
    a -= elastic * factor / reduced_mass(plant.bodies, beside)
    pace = 1.5 * hertzian * math.sqrt(u) * d * factor + elastic * loss * a
    return elastic * factor / mass, pace / mass


@kernel
def leaning(plant: Plant, state: State, side: Body) -> Leaning:
    """The first derivative of u of a pair at rest that differs from zero by more than its rounding.

    The force of the other pair takes part with its value and its rate, unless it ends at once. Where that pair begins
    at u = 0 with t^n, its force grows with t^(3n/2), which moves the object with t^(2 + 3n/2).
    """
    y, beside = state.y, other(side)
    push, pace = impact_beside(plant, state, side)
    u, d = y[U_L + beside], approach(y, beside)
    left = u / -d if d < 0.0 else math.inf  # s until it ends; at once, if no velocity that is a number comes of it
    ends = (abs(push) + abs(pace) * left) * left == 0.0
    if state.mode[beside] != Pair.CONTACT or plant.bodies[OBJECT, MASS] == math.inf or ends:
        return own_difference(plant, y, side, LOWEST)
    if u > 0.0:
        found = first_difference(plant, y, side, push, pace, LOWEST, 3)
        return found if found.order < NEVER else Leaning(UNDECIDED, 0.0)
    begins = own_motion(plant, y, beside)
    found, pushed = own_difference(plant, y, side, LOWEST), 2.0 + 1.5 * begins.order
    while found.order < pushed and is_overtaken(plant, side, found, begins):
        found = own_difference(plant, y, side, int(found.order) + 1)
    return found if found.order < pushed else Leaning(pushed, math.inf)


@kernel
def is_overtaken(plant: Plant, side: Body, own: Leaning, begins: Leaning) -> bool:
    """Whether a pair at rest is moved so much more by the force of the other pair that its own difference is nothing.

    The other one begins with u = b t^m. When the first of both forces shows, its way has to be as much longer.
    """
    beside, m, b = other(side), begins.order, begins.value / math.gamma(begins.order + 1.0)
    hertzian, loss = plant.pairs[beside, HERTZIAN], plant.pairs[beside, DISSIPATION]
    if not 0.0 < b < math.inf:
        return False
    order = 2.0 + 1.5 * m
    force = elastic_force(hertzian, b) * damping_factor(loss, b if m == 1.0 else 0.0)
    way = force / (plant.bodies[OBJECT, MASS] * order * (order - 1.0))
    t = min(time_of_impulse(reduced_mass(plant.bodies, beside) / hertzian, loss, m, b),
            time_of_impulse(reduced_mass(plant.bodies, side) / plant.pairs[side, HERTZIAN],
                            plant.pairs[side, DISSIPATION], order, way))
    return abs(own.value) / math.gamma(own.order + 1.0) < NOTHING * way * t ** (order - own.order)


@kernel
def time_of_impulse(per_hertz: float, loss: float, order: float, a: float) -> float:
    """Power of two below the time t, in s, at which the impulse of u = a t^order is that of the motion itself.

    H u^(5/2) (1 + p u') = mu u'^2, without the numbers; per_hertz is mu / H. It compares exponents, and integers of
    them: other units give the same time. That of a^2 is one of its own, because a unit of a may be half a power.
    """
    part = a * power_of_two(-exponent(a))  # from 1 to 2; a^2 leaves the range of numbers
    twice, above = int(2.0 * order), 2 * exponent(a) + exponent(part * part) + 1  # 2^above >= a^2
    e = (4 * exponent(per_hertz * order * order) - above) // (twice + 8)
    if loss > 0.0:
        e = min(e, (4 * exponent(per_hertz * order / loss) - 3 * above) // (3 * twice + 4))
    return power_of_two(e)


@kernel
def first_difference(plant: Plant, y: Array, side: Body, push: float, pace: float, lowest: int, highest: int
                     ) -> Leaning:
    """The first derivative of u beyond its rounding, with an acceleration of the object and its rate added; NEVER."""
    drag = plant.bodies[OBJECT, DAMPING] / plant.bodies[OBJECT, MASS]
    for order in range(lowest, highest + 1):
        value, size = difference(plant, y, side, order)
        added = push if order == 2 else (pace - drag * push if order == 3 else 0.0)
        value += added
        if abs(value) > DOUBT * (size + abs(added)):
            return Leaning(float(order), value)
    return Leaning(NEVER, 0.0)


@kernel
def own_difference(plant: Plant, y: Array, side: Body, lowest: int) -> Leaning:
    """`first_difference` of arm and object by themselves, from an order on."""
    return first_difference(plant, y, side, 0.0, 0.0, lowest, HIGHEST)


@kernel
def own_motion(plant: Plant, y: Array, side: Body) -> Leaning:
    """The first derivative of u by which arm and object part or meet by themselves, that of order 1 included."""
    d = approach(y, side)
    return Leaning(1.0, d) if d != 0.0 else own_difference(plant, y, side, LOWEST)


@kernel
def difference(plant: Plant, y: Array, side: Body, order: int) -> tuple[float, float]:
    """A derivative of u without impact forces, and the sum of the sizes of its terms."""
    x, v, sign = arm_of(y, side)
    value, _, size = derivatives(plant.bodies[side], x, v, order)
    value_o, _, size_o = derivatives(plant.bodies[OBJECT], y[X_O], y[V_O], order)
    return sign * (value - value_o), size + size_o


@kernel
def certain_time(plant: Plant, y: Array, side: Body, order: int, value: float, span: float) -> float:
    """How long, in s, u of a flight from u = 0 has the sign of its first derivative, for certain.

    Derivatives of the same sign only help, so each of them may be the one that a bound on the next is held against;
    half of what that proves leaves room for rounding.
    """
    x, v, _ = arm_of(y, side)
    arm, body = plant.bodies[side], plant.bodies[OBJECT]
    longest = 0.0
    for n in range(order, HIGHEST + 1):
        here, size = (value, 0.0) if n == order else difference(plant, y, side, n)
        if abs(here) <= DOUBT * size:
            continue
        if (here > 0.0) != (value > 0.0):
            break
        q, q_rate, _ = derivatives(arm, x, v, n + 1)
        q_o, q_o_rate, _ = derivatives(body, y[X_O], y[V_O], n + 1)
        largest = bound(arm, q, q_rate, span) + bound(body, q_o, q_o_rate, span)
        longest = max(longest, 0.5 * (n + 1) * abs(here) / largest if largest > 0.0 else math.inf)
    return longest


@kernel
def is_negligible(plant: Plant, side: Body, u: float, d: float, part: float) -> bool:
    """Whether the impulse of a pair between u = 0 and u is below a part of that of its motion u'.

    What decides about an object that sticks is the force.
    """
    pair, d = plant.pairs[side], abs(d)
    if u <= 0.0 or d == 0.0:
        return u <= 0.0
    force = elastic_force(pair[HERTZIAN], u) * damping_factor(pair[DISSIPATION], d)
    if plant.bodies[OBJECT, MASS] == math.inf and force > DOUBT * plant.coulomb:
        return False
    return force * (u / d) <= part * reduced_mass(plant.bodies, side) * d


@kernel
def parts(plant: Plant, y: Array, side: Body) -> bool:
    """Whether a pair separates, and nothing but its force can turn it back, or take u' to -1/p, before u = 0."""
    d, loss = approach(y, side), plant.pairs[side, DISSIPATION]
    if not d < 0.0:
        return False
    t = y[U_L + side] / -d
    a, jerk = abs(difference(plant, y, side, 2)[0]), abs(difference(plant, y, side, 3)[0])
    change = max(t * a, 0.5 * t * (t * jerk))  # in this order, because squares underflow
    clamps = 0.0 < surface_factor(plant, y, side, ROUNDINGS) < CLAMPS * loss * change
    return bool(TURNS * change < -d and not clamps)


@inlined
def turn_back(state: State, side: Body) -> None:
    """A pair that is leaving is in contact again where the other one, `side`, touches: its force may turn it back."""
    beside = other(side)
    if state.mode[beside] == Pair.LEAVING:
        state.mode[beside] = Pair.CONTACT


@kernel
def parting_time(plant: Plant, state: State, side: Body, span: float) -> float:
    """How long, in s, a pair that parts from rest in a flight does not come back for certain; it is a short flight."""
    order, value = leaning(plant, state, side)
    if value == 0.0:
        return math.inf
    rate = 0.0
    for body in (side, OBJECT):
        row = plant.bodies[body]
        rate = max(rate, abs(row[DAMPING]) / row[MASS] + math.sqrt(row[STIFFNESS] / row[MASS]))
    certain = certain_time(plant, state.y, side, int(order), value, span)
    return min(certain, SHORT / rate) if rate > 0.0 else certain

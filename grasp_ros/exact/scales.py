"""How fast and how deep: the rates of the bodies, the scales of an impact, and the times that follow from them."""

from __future__ import annotations

import math

from grasp_ros.exact.impact import stored_energy
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, other, relative_motion
from grasp_ros.exact.records import Array, Plant, Settings, State
from grasp_ros.physics.layout import DAMPING, HERTZIAN, LEFT, MASS, OBJECT, RIGHT, STIFFNESS, U_L, Body, Pair

PROBE = 1e-3  # part of the time constants within which the first derivative that differs decides


@kernel
def power_of_two_root(x: float, degree: int) -> float:
    """The power of two above the root of x >= 0; comparing exponents is cheaper than taking the root."""
    return math.ldexp(1.0, (math.frexp(x)[1] - 1) // degree + 1) if x > 0.0 else 0.0


@kernel
def rate_bound(bodies: Array) -> float:
    """Power of two above the rates, in 1/s, at which the bodies (3, 4) move by themselves."""
    rate = 0.0
    for i in range(3):
        body = bodies[i]
        rate = max(rate, body[DAMPING] / body[MASS], math.sqrt(body[STIFFNESS] / body[MASS]))
    return power_of_two_root(rate, 1)


@kernel
def probe_time(settings: Settings, without_rate: float) -> float:
    """A time within which the first derivative that differs decides; `without_rate` where nothing sets a rate."""
    return PROBE / settings.rate if settings.rate > 0.0 else without_rate


@kernel
def reduced_mass(bodies: Array, side: Body) -> float:
    """mu of one pair, kg."""
    m, m_o = bodies[side, MASS], bodies[OBJECT, MASS]
    return m / (1.0 + m / m_o)  # m_o is infinite if the object sticks


@inlined
def impact_scales(hertzian: float, mu: float, u: float, d: float, a: float) -> tuple[float, float]:
    """Scales of sqrt(u) and u' of an impact: those at which a free impact has the same energy (O1 read backwards).

    The energy is that of the present motion and penetration, and of the motion that an acceleration a > 0 from
    outside will bring: it presses the pair to the depth (mu a / H)^(2/3).
    """
    energy = 0.5 * mu * d * d + stored_energy(hertzian, u)
    if a > 0.0:
        energy += mu * a * (mu * a / hertzian) ** (2.0 / 3.0)
    return power_of_two_root(2.5 * energy / hertzian, 5), power_of_two_root(2.0 * energy / mu, 2)


@inlined
def scales(plant: Plant, state: State, settings: Settings, side: Body) -> tuple[float, float]:
    """Scales of w and u' of one pair's impact; the other pair's impact may push it.

    An impact that would last longer than the bodies take to turn by themselves gets no deeper than they let it.
    """
    y, bodies, pairs, rate = state.y, plant.bodies, plant.pairs, settings.rate
    d, a = relative_motion(plant, y, side)
    beside = other(side)
    if state.mode[beside] in (Pair.CONTACT, Pair.BALLISTIC):
        mu = reduced_mass(bodies, beside)
        w, v = impact_scales(pairs[beside, HERTZIAN], mu, y[U_L + beside], approach(y, beside), 0.0)
        if w > 0.0:
            a = max(a, 0.0) + v * v / (w * w) * (mu / bodies[OBJECT, MASS])
    w, v = impact_scales(pairs[side, HERTZIAN], reduced_mass(bodies, side), y[U_L + side], d, a)
    if rate > 0.0:
        reach = power_of_two_root(4.0 * (y[U_L + side] + (abs(d) + max(a, 0.0) / rate) / rate), 2)
        w = min(w, reach) if w > 0.0 else reach  # 0 where the energy of a motion that died out underflows
    return w, max(v, power_of_two_root(abs(d), 1))


@kernel
def sliver(tolerance: float) -> float:
    """Part of an impact's depth whose impulse, of relative size sliver^2.5, is below the tolerance."""
    return 0.3 * tolerance**0.4


@kernel
def ballistic_time(plant: Plant, state: State, settings: Settings) -> float:
    """How long, in s, the pairs that start at u = 0 may go without force: a sliver of their impacts; inf if none does.

    At most half a time constant of the bodies, for `flight.displacement`; then they are ballistic again.

    The impulse lost relative to the impact's is of order (time)^2.5 if a pair approaches, and (time)^4 if it starts at
    rest and is pushed together.
    """
    longest = 0.5 / settings.rate if settings.rate > 0.0 else math.inf
    for side in (LEFT, RIGHT):
        if state.mode[side] != Pair.BALLISTIC:
            continue
        w, v = scales(plant, state, settings, side)
        if w == 0.0 or v == 0.0:  # only a higher derivative presses it together
            longest = min(longest, probe_time(settings, 0.0))
        else:
            part = sliver(settings.tolerance) if approach(state.y, side) > 0.0 else 0.3 * settings.tolerance**0.25
            longest = min(longest, part * w * w / v)
    return longest

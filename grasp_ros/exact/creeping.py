"""Whether a contact relaxes so fast that an implicit step may be worth its price, and how long that may be.

What relaxes dies out, and so do swings and creep on the way to balance: a step that is L-stable need not follow them
then, where a Taylor series has to for ever.
"""

from __future__ import annotations

import math

from grasp_ros.exact.impact import elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, reduced_mass, surface_factor
from grasp_ros.exact.records import Output, Plant, Settings, State
from grasp_ros.exact.rest import ROUNDINGS
from grasp_ros.physics.layout import (
    DISSIPATION,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    U_L,
    Body,
    Filled,
    Pair,
)

STIFF = 500.0  # relaxations within an implicit step from which on it is no dearer than the Taylor steps
FEW = 4.0  # the same where Taylor steps flutter
LENGTH = 3.0  # of an implicit step, in units of the fastest rate that must be resolved
PRESSED = 0.1  # of 1/p: a pair with a slower u' may follow its load; one that parts without a load is faster


@inlined
def brake(plant: Plant, state: State, side: Body) -> float:
    """Damping coefficient p H u^1.5 of a pair in contact, N s/m, (6); 0 without contact."""
    u, pair = state.y[U_L + side], plant.pairs[side]
    if state.mode[side] != Pair.CONTACT or not u > 0.0:
        return 0.0
    return pair[DISSIPATION] * elastic_force(pair[HERTZIAN], u)


@inlined
def relaxation(plant: Plant, state: State, side: Body) -> float:
    """Rate p H u^1.5 / mu at which u' of a pair in contact relaxes, 1/s; 0 without contact."""
    return brake(plant, state, side) / reduced_mass(plant.bodies, side)


@kernel
def slow_relaxation(plant: Plant, state: State) -> float:
    """Rate in 1/s of the slower one of both relaxations; a light object hands the force of one pair on to the other."""
    left, right = relaxation(plant, state, LEFT), relaxation(plant, state, RIGHT)
    if not min(left, right) > 0.0:
        return 0.0
    mass = plant.bodies[OBJECT, MASS]
    a, b = mass / plant.bodies[LEFT, MASS], mass / plant.bodies[RIGHT, MASS]
    own = 1.0 - 1.0 / ((1.0 + a) * (1.0 + b)) if a + b > 1e-8 else a + b
    total = left + right
    product = own * (left * right)  # in this order, for mirror images
    return 2.0 * product / (total + math.sqrt(max(total * total - 4.0 * product, 0.0)))


@inlined
def creep_rate(plant: Plant, state: State, side: Body, over: bool) -> float:
    """Rate in 1/s that an implicit step has to resolve of a pair; `over`: what it does by itself has died out.

    By itself it creeps at 1.5 / (p u) toward the depth that balances its load, or swings about it where its dissipation
    is weak. When that is over it follows the load, no faster than the heavier body swings; one that is stuck does not.
    No step begins at a touch, where the force grows like t^1.5: the rate is inf.
    """
    u, d, pair = state.y[U_L + side], approach(state.y, side), plant.pairs[side]
    if state.mode[side] != Pair.CONTACT:
        return 0.0
    if not u > 0.0:
        return math.inf
    fast, mu = relaxation(plant, state, side), reduced_mass(plant.bodies, side)
    stiffness = 1.5 * pair[HERTZIAN] * math.sqrt(u)
    swings = fast * fast * mu <= stiffness
    slow = fast + math.sqrt(stiffness / mu) if swings else 1.5 / (pair[DISSIPATION] * u)
    if over and (swings or pair[DISSIPATION] * abs(d) < PRESSED):
        slow = min(slow, math.sqrt(stiffness / max(plant.bodies[side, MASS], plant.bodies[OBJECT, MASS])))
    return slow + 5.0 * abs(d) / u


@kernel
def resolved_rate(plant: Plant, state: State, own: float, over: bool) -> float:
    """Rate in 1/s that an implicit step has to resolve; `own`: that of the bodies by themselves; see `creep_rate`."""
    return own + (creep_rate(plant, state, LEFT, over) + creep_rate(plant, state, RIGHT, over))


@kernel
def longest_step(plant: Plant, state: State, own: float, span: float) -> float:
    """Length in s that an implicit step of at most `span` may have if all that can die out has: a trial tells."""
    rate = resolved_rate(plant, state, own, True)
    return LENGTH / rate if rate * span > LENGTH else span


@inlined
def is_unresolved(plant: Plant, state: State, side: Body) -> bool:
    """Whether 1 + p u' of a pair in contact is rounding, where Taylor steps may flutter: clamp and re-enter."""
    closed = state.mode[side] == Pair.CONTACT and plant.pairs[side, DISSIPATION] > 0.0
    return closed and surface_factor(plant, state.y, side, ROUNDINGS) == 0.0


@kernel
def least_step(plant: Plant, state: State) -> float:
    """Length in s from which on an implicit step is worth its price, by the faster relaxation of both pairs."""
    flutters = is_unresolved(plant, state, LEFT) or is_unresolved(plant, state, RIGHT)
    fastest = max(relaxation(plant, state, LEFT), relaxation(plant, state, RIGHT))
    return (FEW if flutters else STIFF) / fastest


@inlined
def is_squeezed(plant: Plant, state: State, settings: Settings, span: float, out: Output) -> bool:
    """Whether a contact relaxes so fast that an implicit step may be worth its price; a trial that failed waits."""
    if not (relaxes(plant, state, LEFT, span) or relaxes(plant, state, RIGHT, span)):
        return False
    out.filled[Filled.WAIT] -= 1
    return out.filled[Filled.WAIT] < 0 and longest_step(plant, state, settings.rate, span) > least_step(plant, state)


@inlined
def relaxes(plant: Plant, state: State, side: Body, span: float) -> bool:
    """Whether `relaxation` times the span is beyond STIFF, without its quotient and its root."""
    loss, hertzian, u = plant.pairs[side, DISSIPATION], plant.pairs[side, HERTZIAN], state.y[U_L + side]
    if loss == 0.0 or state.mode[side] != Pair.CONTACT:
        return False
    m, m_o = plant.bodies[side, MASS], plant.bodies[OBJECT, MASS]
    pressed = loss * hertzian * u * span  # times sqrt(u) / mu; mu is no less than half of the smaller mass
    fast = pressed * pressed * u > (0.25 * STIFF * STIFF) * min(m, m_o) ** 2
    return fast and relaxation(plant, state, side) * span > STIFF

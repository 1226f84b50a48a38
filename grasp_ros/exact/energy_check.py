"""The numerical guard: under constant forces the energy of a segment cannot rise, whatever the contacts do."""

import math
from typing import Any

from grasp_ros.exact.flight import EPS
from grasp_ros.exact.friction import PUSH, TRUE_MASS
from grasp_ros.exact.jit import kernel
from grasp_ros.exact.modes import ABSENT, CONTACT, reduced_mass, scales
from grasp_ros.physics.layout import (
    DAMPING,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    RIGHT,
    STIFFNESS,
    U_L,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
)

UNDERFLOW = 1e-300  # J; energies of a motion that died out have few digits
ROUNDINGS = 128.0  # of the sum of all terms: flights, impacts and differences of positions
NEGLECTED = 1000.0  # of it times the accuracy: a contact step may be off by some hundred first neglected terms


@kernel
def body_energy(mass: float, stiffness: float, force: float, x: float, v: float, x_o: float, t: float) -> Any:
    """m v^2 + k x^2 - 2 f x, J, and the sum of the sizes of its terms, at the end of a segment of t s.

    The position of an arm in contact follows from that of the object, x_o, and has its digits. A force that carries
    the body away and a weak spring that brings it back leave small terms at both ends.
    """
    kinetic, spring, work = mass * v * v, stiffness * x * x, 2.0 * force * x
    size = kinetic + (abs(stiffness * x) + 2.0 * abs(force)) * (abs(x) + abs(x_o))
    if force != 0.0:
        away = t * (abs(v) + 0.5 * t * abs(force) / mass)
        size += 2.0 * abs(force) * (min(away, 2.0 * abs(force) / stiffness) if stiffness > 0.0 else away)
    return kinetic + spring - work, size


@kernel
def energy_level(bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any, t: float) -> Any:
    """V_c - 2 sum f x, J, and the sum of the sizes of its terms, at the end of a segment of t s.

    Dry friction is left out, because it only takes.
    """
    own, size_o = body_energy(friction[TRUE_MASS], 0.0, friction[PUSH], y[X_O], y[V_O], 0.0, t)
    arm_l, arm_r = bodies[LEFT], bodies[RIGHT]
    left, size_l = body_energy(arm_l[MASS], arm_l[STIFFNESS], arm_l[FORCE], y[X_L], y[V_L], y[X_O], t)
    right, size_r = body_energy(arm_r[MASS], arm_r[STIFFNESS], arm_r[FORCE], y[X_R], y[V_R], y[X_O], t)
    impact = 0.0
    for side in (LEFT, RIGHT):
        u = y[U_L + side]
        if u > 0.0 and mode[side] != ABSENT:
            impact += 0.8 * pairs[side, HERTZIAN] * u * u * math.sqrt(u)
    return left + right + own + impact, size_l + size_r + size_o + impact


@kernel
def rises(bodies: Any, pairs: Any, y: Any, mode: Any, pace: float, rise: float, size: float, tolerance: float) -> bool:
    """Whether a rise of the level in one segment is more than rounding and the accuracy explain.

    Steps in contact are as accurate as the impact is large that they are part of, which is looked at if need be.
    Where a feedback drives an arm (c + Kv < 0) energy may come.
    """
    allowed = ROUNDINGS * EPS + NEGLECTED * tolerance
    if not rise > allowed * size + UNDERFLOW or bodies[LEFT, DAMPING] < 0.0 or bodies[RIGHT, DAMPING] < 0.0:
        return False
    for side in (LEFT, RIGHT):
        if mode[side] == CONTACT:
            _, v = scales(bodies, pairs, y, mode, side, pace)
            size += 2.0 * reduced_mass(bodies, side) * v * v
    return rise > allowed * size

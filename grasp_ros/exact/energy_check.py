"""The energy check: under constant inputs the energy of a segment cannot rise, whatever the contacts do."""

from __future__ import annotations

import math

from grasp_ros.exact.impact import stored_energy
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.records import Array, Level, Plant, Settings, State
from grasp_ros.exact.scales import reduced_mass, scales
from grasp_ros.physics.body_energy import body_energy
from grasp_ros.physics.layout import (
    DAMPING,
    EPS,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Outcome,
    Pair,
)

UNDERFLOW = 1e-300  # J; energies of a motion that died out have few digits
ROUNDINGS = 128.0  # of the sum of all terms: flights, impacts and differences of positions
NEGLECTED = 1000.0  # of it times the accuracy: a contact step may be off by some hundred first neglected terms
MAX_IDLE = 1000  # segments without progress in time

own_energy = kernel(body_energy)


@kernel
def level_of(body: Array, x: float, v: float, x_o: float, t: float) -> Level:
    """Energy of a body (4,) at the end of a segment of t s; x_o: the object, if the body is an arm.

    A force that carries the body away and a weak spring that brings it back leave small terms at both ends.
    """
    mass, stiffness, force = body[MASS], body[STIFFNESS], body[FORCE]
    value, size = own_energy(mass, stiffness, force, x, v, abs(x) + abs(x_o))
    if force != 0.0:
        away = t * (abs(v) + 0.5 * t * abs(force) / mass)
        size += 2.0 * abs(force) * (min(away, 2.0 * abs(force) / stiffness) if stiffness > 0.0 else away)
    return Level(value, size)


@inlined
def energy_level(plant: Plant, state: State, t: float) -> Level:
    """V_c - 2 sum f x at the end of a segment of t s. Dry friction is left out, because it only takes."""
    y, given = state.y, plant.given
    own = level_of(given[OBJECT], y[X_O], y[V_O], 0.0, t)
    left = level_of(given[LEFT], y[X_L], y[V_L], y[X_O], t)
    right = level_of(given[RIGHT], y[X_R], y[V_R], y[X_O], t)
    impact = 0.0
    for side in (LEFT, RIGHT):
        u = y[U_L + side]
        if u > 0.0 and state.mode[side] != Pair.ABSENT:
            impact += 2.0 * stored_energy(plant.pairs[side, HERTZIAN], u)
    return Level(left.value + right.value + own.value + impact, left.size + right.size + own.size + impact)


@kernel
def impact_size(plant: Plant, state: State, settings: Settings, size: float) -> float:
    """`size` and the energies of the impacts: a step in contact is as accurate as the impact is large."""
    for side in (LEFT, RIGHT):
        if state.mode[side] == Pair.CONTACT:
            _, v = scales(plant, state, settings, side)
            size += 2.0 * reduced_mass(plant.bodies, side) * v * v
    return size


@inlined
def check_segment(plant: Plant, state: State, settings: Settings, before: Level, after: Level, t: float, idle: int,
                  ballistic: bool) -> Outcome:
    """Whether a segment of t s can be believed: finite, not stalled, and no rise of the energy beyond rounding.

    What a ballistic pair has left out comes at once: no comparison. Where a feedback drives an arm (c + Kv < 0) energy
    may come.
    """
    if not math.isfinite(state.y.sum()):
        return Outcome.NOT_FINITE
    if math.isnan(t) or idle > MAX_IDLE:
        return Outcome.STALLED
    rise, size = after.value - before.value, max(after.size, before.size)
    allowed = ROUNDINGS * EPS + NEGLECTED * settings.tolerance
    driven = plant.given[LEFT, DAMPING] < 0.0 or plant.given[RIGHT, DAMPING] < 0.0
    if ballistic or driven or not rise > allowed * size + UNDERFLOW:
        return Outcome.GO_ON
    return Outcome.ENERGY_RISES if rise > allowed * impact_size(plant, state, settings, size) else Outcome.GO_ON

"""The check of a segment: its energy cannot rise, nor fall by more than its losses, and no touch may be missed."""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.driver.rest import ENERGY as SCALE
from grasp_ros.exact.impact import elastic_force, stored_energy
from grasp_ros.exact.kinematics import arm_of, reduced_mass
from grasp_ros.exact.records import Array, Level, Plant, Settings, State
from grasp_ros.exact.tolerances import DIED_OUT, ENERGY, ENERGY_UNDERFLOW, MAX_IDLE, NEGLECTED, REST
from grasp_ros.physics.domain import LARGEST_POSITION, LARGEST_SPEED
from grasp_ros.physics.energy import body_energy
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Body, Law, Of, Outcome, Pair, U, V, X

own_energy = kernel(body_energy)


@kernel
def level_of(body: Array, x: float, v: float, way: float, t: float) -> tuple[float, float]:
    """Energy in J of V of a body (4,) at the end of a segment of t s, and the sum of the sizes of its terms.

    A position set to the object's has the rounding of its `way` in m. If a force carries a body away, and a weak spring
    brings it back, the terms at both ends are smaller than between them.
    """
    mass, stiffness, force = body[Of.MASS], body[Of.STIFFNESS], body[Of.FORCE]
    value, size = own_energy(mass, stiffness, force, x, v, abs(x) + way)
    if force != 0.0:
        away = t * (abs(v) + 0.5 * t * abs(force) / mass)
        size += 2.0 * abs(force) * (min(away, 2.0 * abs(force) / stiffness) if stiffness > 0.0 else away)
    return value, size


@inlined
def energy_level(plant: Plant, state: State, t: float) -> Level:
    """V_c - 2 sum f x at the end of a segment of t s, without dry friction, which only takes energy."""
    y, given = state.y, plant.given
    value, size = level_of(given[OBJECT], y[X.O], y[V.O], 0.0, t)
    way = abs(y[X.O]) + t * abs(y[V.O])
    left, size_l = level_of(given[LEFT], y[X.L], y[V.L], way, t)
    right, size_r = level_of(given[RIGHT], y[X.R], y[V.R], way, t)
    impact = 0.0
    for side in (LEFT, RIGHT):
        u = y[U.L + side]
        if u > 0.0 and state.mode[side] != Pair.ABSENT:
            impact += 2.0 * stored_energy(plant.pairs[side, Law.HERTZIAN], u)
    return Level(left + right + value + impact, size_l + size_r + size + impact, y[U.L], y[U.R])


@kernel
def losses(plant: Plant, before: Level, modes: tuple[int, int], size: float, t: float) -> float:
    """Bound, in J of V, on what is taken in t s from motions that have the energy `size`.

    A damper takes c v^2, friction F |v|, and a pair in contact p H u^1.5 u'^2; one without force loses what it stored.
    """
    rate = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        rate = max(rate, plant.given[body, Of.DAMPING] / plant.given[body, Of.MASS])
    loss = 2.0 * rate * t * size + 2.0 * plant.coulomb * t * math.sqrt(size / plant.given[OBJECT, Of.MASS])
    for side in (LEFT, RIGHT):
        mode, u = (modes[0], before.u_l) if side == LEFT else (modes[1], before.u_r)
        hertzian, u = plant.pairs[side, Law.HERTZIAN], max(u, 0.0)
        if mode == Pair.CONTACT:
            d = math.sqrt(size / reduced_mass(plant.given, side))
            loss += 2.0 * plant.pairs[side, Law.DISSIPATION] * elastic_force(hertzian, u + d * t) * d * d * t
        elif mode in (Pair.CLAMPED, Pair.LEAVING):
            loss += 2.0 * stored_energy(hertzian, u)
    return loss


@inlined
def set_back(plant: Plant, y: Array, side: Body, mode: int, u: float, t: float) -> float:
    """Energy in J of V by which an arm may change in a touch, which moves it to u = 0.

    Roundings may have left the object in it by `u`, and the search for the time of a touch ends two roundings of t s
    before or after it: behind many swings that is more than the roundings of the energy. It is no part of their `size`,
    from which the fastest speed and the losses follow.
    """
    if mode != Pair.OPEN:
        return 0.0
    x, v, _ = arm_of(y, side)
    way, arm = max(u, 0.0) + 2.0 * EPS * t * abs(v), plant.given[side]
    return 2.0 * way * (arm[Of.STIFFNESS] * (abs(x) + way) + abs(arm[Of.FORCE]))


@inlined
def penetrates(plant: Plant, state: State, side: Body, before: float, size: float, t: float, part: float) -> bool:
    """Whether an open pair has u > 0 by more than rounding and `part` of its travel in t s: a touch has been missed.

    A body is no faster than the energy `size` allows. A u below DIED_OUT is ignored. A u > 0 that was there `before` is
    no missed touch: it may be the rounding of a longer travel.
    """
    u = state.y[U.L + side]
    if state.mode[side] != Pair.OPEN or u <= max(before, 0.0):
        return False
    fastest = math.sqrt(size / plant.given[side, Of.MASS]) + math.sqrt(size / plant.given[OBJECT, Of.MASS])
    distance = abs(arm_of(state.y, side)[0]) + abs(state.y[X.O])
    return u > ENERGY * EPS * distance + part * t * fastest + DIED_OUT


@inlined
def check_segment(plant: Plant, state: State, settings: Settings, before: Level, after: Level, t: float, idle: int,
                  modes: tuple[int, int]) -> Outcome:
    """Whether a segment of t s, which began with both pairs in `modes`, can be believed.

    It must be finite, within the domain, not stalled, without a touch that was missed, and its energy may neither rise
    nor fall by more than rounding and losses explain, but for the energy of a motion that counts as rest. Where a
    feedback drives an arm (c + Kv < 0) energy may come.
    """
    y, rise, size = state.y, after.value - before.value, max(after.size, before.size)
    if not math.isfinite(y.sum()):
        return Outcome.NOT_FINITE
    if (max(abs(y[X.L]), abs(y[X.O]), abs(y[X.R])) > LARGEST_POSITION
            or max(abs(y[V.L]), abs(y[V.O]), abs(y[V.R])) > LARGEST_SPEED):
        return Outcome.OUTSIDE
    if idle > MAX_IDLE:
        return Outcome.STALLED
    part = ENERGY * EPS + NEGLECTED * settings.tolerance
    if (penetrates(plant, state, LEFT, before.u_l, size, t, part)
            or penetrates(plant, state, RIGHT, before.u_r, size, t, part)):
        return Outcome.PENETRATES
    rounding = part * size + max(REST * REST * state.rest[SCALE], ENERGY_UNDERFLOW) + (
        set_back(plant, y, LEFT, modes[0], before.u_l, t) + set_back(plant, y, RIGHT, modes[1], before.u_r, t))
    driven = plant.given[LEFT, Of.DAMPING] < 0.0 or plant.given[RIGHT, Of.DAMPING] < 0.0
    if driven or not abs(rise) > rounding:  # nan where energies overflow before the state does
        return Outcome.GO_ON
    if rise > rounding:
        return Outcome.ENERGY_RISES
    return Outcome.GO_ON if -rise - rounding <= losses(plant, before, modes, size, t) else Outcome.ENERGY_FALLS

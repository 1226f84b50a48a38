"""The check of a segment: its energy cannot rise, nor fall by more than its losses, and no touch may be missed."""

from __future__ import annotations

import math

from grasp_ros.exact.impact import elastic_force, stored_energy
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import apart, approach, arm_of, reduced_mass
from grasp_ros.exact.records import Array, Level, Plant, Settings, State
from grasp_ros.exact.taylor_step import STILL
from grasp_ros.physics.body_energy import body_energy
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    EPS,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Body,
    Outcome,
    Pair,
)

DIED_OUT = 1e-150  # m; of less, squares and products have left the range of numbers, and what moves it is not followed
OVERFLOWS = 1e150  # J; beyond, squares and products of what moves in contact leave the range of numbers
UNDERFLOW = 1e-300  # J; energies of a motion that died out have few digits
ROUNDINGS = 128.0  # of the sum of all terms: flights, impacts and differences of positions
NEGLECTED = 1000.0  # of it times the accuracy: a contact step may be off by some hundred first neglected terms
MAX_IDLE = 1000  # segments without progress in time

own_energy = kernel(body_energy)


@kernel
def level_of(body: Array, x: float, v: float, way: float, t: float) -> tuple[float, float]:
    """Energy in J of V of a body (4,) at the end of a segment of t s, and the sum of the sizes of its terms.

    An arm that touches the object takes its place, with the roundings of a `way` in m. A force that carries the body
    away and a weak spring that brings it back leave small terms at both ends.
    """
    mass, stiffness, force = body[MASS], body[STIFFNESS], body[FORCE]
    value, size = own_energy(mass, stiffness, force, x, v, abs(x) + way)
    if force != 0.0:
        away = t * (abs(v) + 0.5 * t * abs(force) / mass)
        size += 2.0 * abs(force) * (min(away, 2.0 * abs(force) / stiffness) if stiffness > 0.0 else away)
    return value, size


@kernel
def jump(plant: Plant, y: Array, side: Body, way: float, t: float) -> float:
    """What an arm gains or loses where it is put where object and u say, J of V.

    At a touch, where u = 0 is set, it goes by what a rounding of the time t in s has left of u, too.
    """
    if y[U_L + side] == 0.0:
        way += EPS * t * abs(approach(y, side))
    body = plant.given[side]
    held = abs(body[FORCE]) + abs(body[STIFFNESS]) * (abs(arm_of(y, side)[0]) + way)
    return 2.0 * held * way


@inlined
def left_open(mode: int, u: float) -> float:
    """What roundings had left of u, m, of a pair that was open; if it touches, the arm goes back by it."""
    return u if mode == Pair.OPEN and u > 0.0 else 0.0


@inlined
def energy_level(plant: Plant, state: State, t: float) -> Level:
    """V_c - 2 sum f x at the end of a segment of t s. Dry friction is left out, because it only takes."""
    y, given = state.y, plant.given
    value, size = level_of(given[OBJECT], y[X_O], y[V_O], 0.0, t)
    way = abs(y[X_O]) + t * abs(y[V_O])
    left, size_l = level_of(given[LEFT], y[X_L], y[V_L], way, t)
    right, size_r = level_of(given[RIGHT], y[X_R], y[V_R], way, t)
    impact = 0.0
    for side in (LEFT, RIGHT):
        u = y[U_L + side]
        if u > 0.0 and state.mode[side] != Pair.ABSENT:
            impact += 2.0 * stored_energy(plant.pairs[side, HERTZIAN], u)
    return Level(left + right + value + impact, size_l + size_r + size + impact, apart(y, LEFT), apart(y, RIGHT),
                 y[U_L], y[U_R])


@kernel
def losses(plant: Plant, before: Level, modes: tuple[int, int], size: float, t: float) -> float:
    """Bound, in J of V, on what is taken in t s from motions that have the energy `size`.

    A damper takes c v^2, friction F |v|, and a pair in contact p H u^1.5 u'^2; one without force loses what it stored.
    """
    rate = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        rate = max(rate, plant.given[body, DAMPING] / plant.given[body, MASS])
    loss = 2.0 * rate * t * size + 2.0 * plant.coulomb * t * math.sqrt(size / plant.given[OBJECT, MASS])
    for side in (LEFT, RIGHT):
        mode, u = (modes[0], before.u_l) if side == LEFT else (modes[1], before.u_r)
        hertzian, u = plant.pairs[side, HERTZIAN], max(u, 0.0)
        if mode == Pair.CONTACT:
            d = math.sqrt(size / reduced_mass(plant.given, side))
            loss += 2.0 * plant.pairs[side, DISSIPATION] * elastic_force(hertzian, u + d * t) * d * d * t
        elif mode in (Pair.CLAMPED, Pair.LEAVING):
            loss += 2.0 * stored_energy(hertzian, u)
    return loss


@inlined
def may_be_damped(plant: Plant, fall: float, size: float, t: float) -> bool:
    """Whether the damper of one body can take a fall of the energy: what most segments need to know, for less."""
    arm, body, far = plant.given[LEFT], plant.given[OBJECT], plant.given[RIGHT]
    most = 2.0 * t * size
    return bool(fall * arm[MASS] <= most * arm[DAMPING] or fall * far[MASS] <= most * far[DAMPING]
                or fall * body[MASS] <= most * body[DAMPING])


@inlined
def penetrates(plant: Plant, state: State, side: Body, before: float, told: float, size: float, t: float) -> bool:
    """Whether an open pair is closed by more than the roundings of its ways in t s: a touch has been missed.

    A body goes no faster than the energy `size` allows. What is STILL beside the fastest motion, or has DIED_OUT, is
    not followed. What u was `before`, roundings of a longer way may have left. So they may have the m by which the
    places `told` another u: near 0 it is they that tell it.
    """
    u = state.y[U_L + side]
    if state.mode[side] != Pair.OPEN or u <= max(before, 0.0):
        return False
    fastest = math.sqrt(size / plant.given[side, MASS]) + math.sqrt(size / plant.given[OBJECT, MASS])
    way = abs(arm_of(state.y, side)[0]) + abs(state.y[X_O]) + t * fastest
    still = STILL * t * (abs(state.y[V_L]) + abs(state.y[V_O]) + abs(state.y[V_R]))
    return u > ROUNDINGS * EPS * way + told + still + DIED_OUT


@inlined
def check_segment(plant: Plant, state: State, settings: Settings, before: Level, after: Level, t: float, idle: int,
                  modes: tuple[int, int]) -> Outcome:
    """Whether a segment of t s, which began with both pairs in `modes`, can be believed.

    It must be finite, its contacts, too, not stalled, without a touch that was missed, and its energy may neither rise
    nor fall by more than rounding and losses explain. Where a feedback drives an arm (c + Kv < 0) energy may come.
    """
    rise, size = after.value - before.value, max(after.size, before.size)
    touches = modes[0] == Pair.CONTACT or modes[1] == Pair.CONTACT
    if not math.isfinite(state.y.sum()) or (touches and size > OVERFLOWS):
        return Outcome.NOT_FINITE
    if math.isnan(t) or idle > MAX_IDLE:
        return Outcome.STALLED
    if (penetrates(plant, state, LEFT, before.u_l, before.left, size, t)
            or penetrates(plant, state, RIGHT, before.u_r, before.right, size, t)):
        return Outcome.PENETRATES
    rounding = (ROUNDINGS * EPS + NEGLECTED * settings.tolerance) * size + UNDERFLOW
    driven = plant.given[LEFT, DAMPING] < 0.0 or plant.given[RIGHT, DAMPING] < 0.0
    if driven or not abs(rise) > rounding:  # nan where energies overflow before the state does
        return Outcome.GO_ON
    way_l, way_r = before.left + left_open(modes[0], before.u_l), before.right + left_open(modes[1], before.u_r)
    rounding += jump(plant, state.y, LEFT, way_l, t) + jump(plant, state.y, RIGHT, way_r, t)
    if rise > rounding:
        return Outcome.ENERGY_RISES
    fall = -rise - rounding
    if fall <= 0.0 or may_be_damped(plant, fall, size, t) or fall <= losses(plant, before, modes, size, t):
        return Outcome.GO_ON
    return Outcome.ENERGY_FALLS

"""Powers and times of the begin of a contact: with which power of t each pair moves, and when which force shows."""

from __future__ import annotations

import math

from grasp_ros.exact.bits import power_of_two, power_of_two_root
from grasp_ros.exact.jit import kernel
from grasp_ros.exact.kinematics import approach, is_resting, reduced_mass
from grasp_ros.exact.records import Array, Plant, Settings, State
from grasp_ros.exact.rest import DOUBT, HIGHEST, NEVER, UNDECIDED, difference, leaning, own_motion, time_of_impulse
from grasp_ros.exact.start_series import ALIKE, NONE, POWERS
from grasp_ros.physics.layout import DISSIPATION, HERTZIAN, LEFT, RIGHT, U_L, Body, Pair

HELD = 60.0  # binary orders by which the impulse that a pair leaves out is below that of its motion


@kernel
def power_of(plant: Plant, state: State, side: Body) -> int:
    """a of a pair in contact, u = s^a U; -a of one that parts from rest; otherwise NONE."""
    y, mode = state.y, state.mode[side]
    if mode not in (Pair.CONTACT, Pair.OPEN):
        return NONE
    if y[U_L + side] != 0.0 or approach(y, side) != 0.0:
        if mode == Pair.OPEN:
            return NONE
        return 0 if y[U_L + side] > 0.0 else POWERS
    order, value = leaning(plant, state, side)
    if order in (NEVER, UNDECIDED):
        return NONE
    return int(POWERS * order) if value > 0.0 else -int(POWERS * order)


@kernel
def time_scale(plant: Plant, state: State, settings: Settings) -> float:
    """A power of two near the time T, in s, within which a contact shows: the force has turned or damped its pair."""
    y = state.y
    scale = 1.0 / settings.rate if settings.rate > 0.0 else math.inf
    for side in (LEFT, RIGHT):
        if state.mode[side] != Pair.CONTACT:
            continue
        u, d = y[U_L + side], approach(y, side)
        per_hertz, loss = reduced_mass(plant.bodies, side) / plant.pairs[side, HERTZIAN], plant.pairs[side, DISSIPATION]
        if u > 0.0:
            scale = min(scale, power_of_two_root(per_hertz / math.sqrt(u), 2))
            if d != 0.0:
                scale = min(scale, power_of_two_root(u / abs(d), 1))
            if loss > 0.0:
                scale = min(scale, power_of_two_root(per_hertz / (loss * u * math.sqrt(u)), 1))
        elif d > 0.0:
            scale = min(scale, time_of_impulse(per_hertz, loss, 1.0, d))
        else:
            order, value = leaning(plant, state, side)
            if value < math.inf:
                scale = min(scale, time_of_impulse(per_hertz, loss, order, value / math.gamma(order + 1.0)))
    return scale


@kernel
def own_derivative(plant: Plant, y: Array, side: Body, order: int) -> tuple[float, float]:
    """`rest.difference`, and u' of order 1, which is known without a sum."""
    return (approach(y, side), 0.0) if order == 1 else difference(plant, y, side, order)


@kernel
def silent_time(plant: Plant, y: Array, side: Body) -> float:
    """Time in s for which a pair that begins moves as if without force, by each derivative; 0 if it is too deep."""
    per_hertz, loss = reduced_mass(plant.bodies, side) / plant.pairs[side, HERTZIAN], plant.pairs[side, DISSIPATION]
    time, way = math.inf, 0.0
    for order in range(1, HIGHEST + 1):
        value, size = own_derivative(plant, y, side, order)
        if abs(value) > DOUBT * size:
            first = time_of_impulse(per_hertz, loss, float(order), abs(value) / math.gamma(order + 1.0))
            time = min(time, first * power_of_two(-math.ceil(HELD / (0.5 * order + 2.0))))
    if y[U_L + side] == 0.0:
        return time
    for order in range(1, HIGHEST + 1):
        value, _ = own_derivative(plant, y, side, order)
        way = max(way, abs(value) / math.gamma(order + 1.0) * time**order)
    return time if y[U_L + side] <= way else 0.0


@kernel
def holding_time(plant: Plant, state: State, settings: Settings) -> float:
    """Time in s for which all pairs in contact move as if without force, a part of `time_of_impulse`; 0 if not at all.

    Which force shows first may decide about the other pair long before any of them changes a velocity.
    """
    if plant.coulomb > 0.0:
        return 0.0
    longest = math.inf
    for side in (LEFT, RIGHT):
        if state.mode[side] == Pair.CONTACT:
            order, value = own_motion(plant, state.y, side)
            if order < NEVER and value > 0.0:
                longest = min(longest, silent_time(plant, state.y, side))
            elif order < NEVER or not is_resting(state.y, side):
                return 0.0
    if longest == math.inf:
        return 0.0
    return min(longest, 1.0 / settings.rate) if settings.rate > 0.0 else longest


@kernel
def own_power(plant: Plant, state: State, side: Body) -> int:
    """`power_of` a pair that moves as if without force."""
    if state.mode[side] not in (Pair.CONTACT, Pair.OPEN):
        return NONE
    order = own_motion(plant, state.y, side).order
    return -int(POWERS * order) if order < NEVER else ALIKE

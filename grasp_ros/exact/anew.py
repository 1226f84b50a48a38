"""Contacts so young that rounding has taken what moves them begin anew, from u = 0."""

from __future__ import annotations

from grasp_ros.exact.impact import elastic_force
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, reduced_mass
from grasp_ros.exact.records import Plant, State
from grasp_ros.exact.rest import DOUBT, difference, impact_beside
from grasp_ros.exact.sums import meet
from grasp_ros.physics.layout import EPS, HERTZIAN, LEFT, RIGHT, U_L, X_O, Body, Pair


@kernel
def is_lost(plant: Plant, state: State, side: Body) -> bool:
    """Whether u, u' and what moves a pair in contact by itself are rounding of the motion of its bodies."""
    u = state.y[U_L + side]
    if state.mode[side] != Pair.CONTACT or approach(state.y, side) != 0.0 or not 0.0 < u <= EPS * abs(state.y[X_O]):
        return False
    a, size = difference(plant, state.y, side, 2)
    force = elastic_force(plant.pairs[side, HERTZIAN], u)
    return abs(a) + force / reduced_mass(plant.bodies, side) <= DOUBT * size


@inlined
def is_left_alone(plant: Plant, state: State, side: Body) -> bool:
    """Whether the other pair has no force on the object, nor is about to have one."""
    push, pace = impact_beside(plant, state, side)
    return push == 0.0 and pace == 0.0


@inlined
def begin_anew(plant: Plant, state: State) -> None:
    """Put contacts that are lost back to u = 0, unless another one pushes them that is not.

    Their u' would stay lost, while roundings of the accelerations, step after step, take u away.
    """
    left, right = is_lost(plant, state, LEFT), is_lost(plant, state, RIGHT)
    anew_l = left and (right or is_left_alone(plant, state, LEFT))
    anew_r = right and (left or is_left_alone(plant, state, RIGHT))
    if anew_l:
        meet(state, LEFT)
    if anew_r:
        meet(state, RIGHT)

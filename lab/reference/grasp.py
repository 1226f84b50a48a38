"""The paper's grasp as a record, and its equations of motion written down once more: what results are held against."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.control import ControlLaw, is_due
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of
from grasp_ros.physics.model import Arm, Array, Contact, impact_force, penetration
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene import PAPER, Scene

NOTHING = np.zeros(3)


class Grasp(NamedTuple):
    """Left arm, object and right arm on one line."""

    left: Arm
    right: Arm
    left_contact: Contact
    right_contact: Contact
    object_mass: float  # m_o, kg


def grasp_of(scene: Scene) -> Grasp:
    """The paper's grasp, with its gains, in a scene that is nothing else."""
    system = scene.system
    if scene.values.keys() != PAPER or any(law.row[2:4].any() for law in system.laws.values()):
        raise Refused(f"{scene.name}: not the paper's grasp")
    left, right = (Contact(*pair) for pair in system.pairs.tolist())
    return Grasp(system.arm(LEFT), system.arm(RIGHT), left, right, float(system.bodies[OBJECT, Of.MASS]))


def system_of(grasp: Grasp, state: Array) -> System:
    """The arrays of a grasp that begins in a state (6,)."""
    system = System(state=np.asarray(state, dtype=float))
    for side, arm in ((LEFT, grasp.left), (RIGHT, grasp.right)):
        system.bodies[side, : Of.FORCE] = arm.mass, arm.stiffness, arm.damping
        system.laws[side] = ControlLaw(arm.position_gain, arm.velocity_gain)
    system.bodies[OBJECT, Of.MASS] = grasp.object_mass
    system.pairs[:] = grasp.left_contact, grasp.right_contact
    return system


def commands(system: System, tick: int, state: Array, last: Array = NOTHING) -> Array:
    """Commands at a tick with a state (6,), (3,) in N by body: answers, or the last ones; 0 without a controller."""
    forces = last.copy()
    for side, law in system.laws.items():
        if is_due(law.row, tick):
            forces[side] = law.command(tick, *state[COLUMN[side] : COLUMN[side] + 2].tolist())
    return forces


def feedback(arm: Arm, x: float, v: float) -> float:
    """Input force of the linear state feedback in N, (4), (5)."""
    return -arm.position_gain * x - arm.velocity_gain * v


def impact_forces(grasp: Grasp, state: Array) -> tuple[Array, Array]:
    """fw_l and fw_r in N of states (..., 6)."""
    u_l, d_l, u_r, d_r = penetration(state)
    return impact_force(grasp.left_contact, u_l, d_l), impact_force(grasp.right_contact, u_r, d_r)


def acceleration(grasp: Grasp, state: Array) -> tuple[Array, Array, Array]:
    """x_l'', x_o'', x_r'' in m/s^2 of states (..., 6) under continuous feedback: (1) to (5)."""
    x_l, v_l, _, _, x_r, v_r = np.moveaxis(np.asarray(state), -1, 0)
    fw_l, fw_r = impact_forces(grasp, state)
    left, right = grasp.left, grasp.right
    f_l = -left.stiffness * x_l - left.damping * v_l + feedback(left, x_l, v_l)
    f_r = -right.stiffness * x_r - right.damping * v_r + feedback(right, x_r, v_r)
    return (f_l - fw_l) / left.mass, (fw_l - fw_r) / grasp.object_mass, (f_r + fw_r) / right.mass

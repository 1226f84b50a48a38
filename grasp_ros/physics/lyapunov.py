"""The paper's Lyapunov function: its parts V_l, V_o, V_r of (29), the deformation of (35), and what its level bounds.

With a pair open its terms are absent, so that (16), (21) and (28) are one function in the conditions of contact. V is
twice the energy.

How far a level of V_c lets the bodies go proves that a motion has settled for good: V_c >= K x^2 bounds an arm,
V_c >= (4/5) H u^(5/2) a deformation, and the arms enclose the object, (35) to (37). Where V_c never rises, under
continuous feedback to 0, that bounds all that follows.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.energy import elastic_level, mechanical_levels, pairs_of
from grasp_ros.physics.impact_law import STORED
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of
from grasp_ros.physics.model import Array, in_contact
from grasp_ros.physics.system import BODIES, System


class Parts(NamedTuple):
    """V by parts, each (...,) in J: V = V_l + V_o + V_r + contact_l + contact_r, (16), (21), (28)."""

    V_l: Array  # (k_l + Kp_l) x_l^2 + m_l x_l'^2, (29), (30)
    V_o: Array  # m_o x_o'^2, (29), (33)
    V_r: Array  # (29), (32)
    contact_l: Array  # a H_l u_l^(5/2) while (10) holds, else 0
    contact_r: Array  # b H_r u_r^(5/2)


@np.errstate(over="ignore", invalid="ignore")
def parts(system: System, state: Array, feedback: bool = True) -> Parts:
    """V of states (..., 6) by parts, 0 for what is not there; without `feedback` that of the plant alone."""
    state = np.asarray(state, dtype=float)
    zero: Array = np.zeros(np.shape(state)[:-1])
    bodies, present = system.closed_loop if feedback else system.bodies, system.present
    levels = [np.add(*mechanical_levels(bodies, body, state)) if body in present else zero for body in BODIES]
    touching = [zero, zero]
    for side, contact, u, d in pairs_of(system, state):
        touching[side] = np.where(in_contact(contact, u, d), elastic_level(contact, u), 0.0)
    return Parts(*levels, *touching)


def deformation(system: System, state: Array) -> Array:
    """Local deformation (..., 2) of both pairs in m: u where it is positive; 0 for a pair that cannot push."""
    state = np.asarray(state, dtype=float)
    found = np.zeros((*np.shape(state)[:-1], 2))
    for side, _, u, _ in pairs_of(system, state):
        found[..., side] = np.maximum(u, 0.0)
    return found


def largest_deformation(system: System, state: Array) -> Array:
    """Epsilon of (35), (36) along a motion (n, 6): the largest deformation so far, (n, 2) in m."""
    return np.asarray(np.maximum.accumulate(deformation(system, state), axis=0))


def reach(bodies: Any, pairs: Any, V_c: Any) -> Any:
    """Largest displacements of left arm, object and right arm, and largest deformations of both pairs, in m.

    An arm that is not driven to 0, an object that the arms do not enclose or that a force pushes, and a pair that
    cannot push have no bound: infinite. What is not there stays at 0. `bodies` (3, 4) have the feedback in them,
    `pairs` are (2, 2), see `layout`; `V_c` is in J. `observe.settling` compiles the same source for its kernels.
    """
    left = middle = right = 0.0
    if bodies[LEFT, Of.MASS] > 0.0:
        driven = bodies[LEFT, Of.STIFFNESS] > 0.0 and bodies[LEFT, Of.FORCE] == 0.0
        left = np.sqrt(V_c / bodies[LEFT, Of.STIFFNESS]) if driven else np.inf
    if bodies[RIGHT, Of.MASS] > 0.0:
        driven = bodies[RIGHT, Of.STIFFNESS] > 0.0 and bodies[RIGHT, Of.FORCE] == 0.0
        right = np.sqrt(V_c / bodies[RIGHT, Of.STIFFNESS]) if driven else np.inf
    hertzian_l, hertzian_r = pairs[LEFT, Law.HERTZIAN], pairs[RIGHT, Law.HERTZIAN]
    u_l = (0.5 * STORED * V_c / hertzian_l) ** (1.0 / STORED) if hertzian_l > 0.0 else np.inf
    u_r = (0.5 * STORED * V_c / hertzian_r) ** (1.0 / STORED) if hertzian_r > 0.0 else np.inf
    if bodies[OBJECT, Of.MASS] > 0.0:
        arms = bodies[LEFT, Of.MASS] > 0.0 and bodies[RIGHT, Of.MASS] > 0.0
        middle = max(left + u_l, right + u_r) if arms and bodies[OBJECT, Of.FORCE] == 0.0 else np.inf
    return left, middle, right, u_l, u_r

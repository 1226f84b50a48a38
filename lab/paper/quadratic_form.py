"""The paper's V (11) as x' P(x) x, with P(x) of (12), in the order of every state here, that of (13)."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of
from grasp_ros.physics.model import Array, Contact, in_contact, penetration
from grasp_ros.physics.reach import reach
from grasp_ros.physics.system import COLUMN, System

A = 0.8  # a = b of (19), (24)


def contact_stiffness(contact: Contact, u: Array, u_rate: Array) -> Array:
    """Delta k of (14), (15) in N/m: a H u^(1/2) while (10) holds, else 0."""
    return np.where(in_contact(contact, u, u_rate), A * contact.hertzian * np.sqrt(np.maximum(u, 0.0)), 0.0)


def matrix(system: System, state: Array) -> Array:
    """P(x) of (12) for states (..., 6): symmetric, (..., 6, 6), in N/m and kg.

    It is the paper's grasp: two arms, an object and both contacts, regulated to 0.
    """
    state = np.asarray(state, dtype=float)
    bodies = system.closed_loop
    P = np.zeros((*np.shape(state)[:-1], 6, 6))
    for body in (LEFT, OBJECT, RIGHT):
        x = COLUMN[body]
        P[..., x, x] = bodies[body, Of.STIFFNESS]
        P[..., x + 1, x + 1] = bodies[body, Of.MASS]
    u_l, d_l, u_r, d_r = penetration(state)
    for side, u, d in ((LEFT, u_l, d_l), (RIGHT, u_r, d_r)):
        extra = contact_stiffness(Contact(*system.pairs[side]), u, d)
        arm, between = COLUMN[side], COLUMN[OBJECT]
        P[..., arm, arm] += extra
        P[..., between, between] += extra
        P[..., arm, between] -= extra
        P[..., between, arm] -= extra
    return P


def quadratic_form(system: System, state: Array) -> Array:
    """x' P(x) x in J, (11), by the matrix."""
    return np.asarray(np.einsum("...i,...ij,...j->...", state, matrix(system, state), state))


def deformation_bound(system: System, V_c: float) -> Array:
    """What no deformation can exceed at a level of V_c in J, (2,) in m; see `reach`."""
    return np.array(reach(system.closed_loop, system.pairs, V_c)[3:])

"""The paper's Lyapunov function in its parts: P(x) of (12), V_l, V_o, V_r of (29), and the deformation of (35).

V (11) is x' P(x) x with the state in the order of (13), which is the order of every state here. With a pair open its
terms are absent, so that (16), (21) and (28) are one function in the conditions of contact. V is twice the energy.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.energy import elastic_level, mechanical_level, pairs_of
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of
from grasp_ros.physics.model import Array, Contact, in_contact, penetration
from grasp_ros.physics.reach import reach
from grasp_ros.physics.system import COLUMN, System

A = 0.8  # a = b of (19), (24)


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
    bodies = {
        body: mechanical_level(system, body, state, feedback) if body in system.present else zero
        for body in (LEFT, OBJECT, RIGHT)
    }
    touching: dict[int, Array] = {LEFT: zero, RIGHT: zero}
    for side, u, d in pairs_of(system, state):
        held = in_contact(Contact(*system.pairs[side]), u, d)
        touching[side] = np.where(held, elastic_level(system, side, u), 0.0)
    return Parts(bodies[LEFT], bodies[OBJECT], bodies[RIGHT], touching[LEFT], touching[RIGHT])


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


def deformation(system: System, state: Array) -> Array:
    """Local deformation (..., 2) of both pairs in m: u where it is positive; 0 for a pair that cannot push."""
    state = np.asarray(state, dtype=float)
    found = np.zeros((*np.shape(state)[:-1], 2))
    for side, u, _ in pairs_of(system, state):
        found[..., side] = np.maximum(u, 0.0)
    return found


def largest_deformation(system: System, state: Array) -> Array:
    """Epsilon of (35), (36) along a motion (n, 6): the largest deformation so far, (n, 2) in m."""
    return np.asarray(np.maximum.accumulate(deformation(system, state), axis=0))


def deformation_bound(system: System, V_c: float) -> Array:
    """What no deformation can exceed at a level of V_c in J, (2,) in m; see `reach`."""
    return np.array(reach(system.closed_loop, system.pairs, V_c)[3:])


def displacement_bound(system: System, V_c: float) -> Array:
    """What no displacement can exceed at a level of V_c in J: left, object, right, (3,) in m; see `reach`."""
    return np.array(reach(system.closed_loop, system.pairs, V_c)[:3])

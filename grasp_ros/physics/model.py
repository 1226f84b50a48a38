"""The grasp of Fukuda, Shoji and Inaba (1990): an arm, a contact, penetrations and impact forces.

Everything here is written with the paper's letters; every function works on scalars and on NumPy arrays.
The integrators in this package do not call it, so that tests can hold their results against it.
`lab.reference.grasp` has the equations of motion.

The impact law, (6), (7), is that of Hunt and Crossley, see `impact_law`.

References
----------
T. Fukuda, Y. Shoji, M. Inaba: Stable Position/Force Control of Robotic Manipulator with Consideration of
Collision Phenomena. IFAC 11th World Congress, Tallinn 1990. Equation numbers below are the paper's.
"""

from __future__ import annotations

from enum import IntFlag
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.impact_law import damping_factor, elastic_force

Array = NDArray[np.float64]


class Arm(NamedTuple):
    """One manipulator with its linear state feedback, (1), (2), (4), (5)."""

    mass: float  # m, kg
    stiffness: float  # k, N/m
    damping: float  # c, N s/m
    position_gain: float  # Kp, N/m
    velocity_gain: float  # Kv, N s/m


class Contact(NamedTuple):
    """One pair of arm and object, with the Hunt-Crossley law (6), (7)."""

    hertzian: float  # H, N/m^1.5
    dissipation: float  # p, s/m


class Mode(IntFlag):
    """Which pairs are in contact in the sense of (10)."""

    NONE = 0
    LEFT = 1
    RIGHT = 2
    BOTH = 3


def in_contact(contact: Contact, u: Array, u_rate: Array) -> NDArray[np.bool_]:
    """Condition (10): penetration, and not separating faster than 1/p."""
    return np.asarray((u >= 0.0) & (damping_factor(contact.dissipation, u_rate) >= 0.0))


def hertzian_force(contact: Contact, u: Array) -> Array:
    """The elastic part H u^(3/2) of the impact force in N; 0 without penetration."""
    return np.asarray(elastic_force(contact.hertzian, np.maximum(u, 0.0)))


def impact_force(contact: Contact, u: Array, u_rate: Array) -> Array:
    """Impact force fw >= 0 in N, of u in m and u' in m/s: the Hunt-Crossley law (6), (7), cut off by (10)."""
    force = damping_factor(contact.dissipation, u_rate) * hertzian_force(contact, u)
    return np.where(in_contact(contact, u, u_rate), force, 0.0)


def penetration(state: Array) -> tuple[Array, Array, Array, Array]:
    """u_l, u_l', u_r, u_r' of states (..., 6): (8)."""
    x_l, v_l, x_o, v_o, x_r, v_r = np.moveaxis(np.asarray(state), -1, 0)
    return x_l - x_o, v_l - v_o, x_o - x_r, v_o - v_r

"""The energy of a system: the paper's V, its continuous repair V_c, V', and the energy balance of held commands.

A linear term of a body brings its energy by itself: stiffness k and constant force f, of the arm or of the feedback,
are the potential k (x - f/k)^2. V_c is known up to a constant where a body has a force but no spring.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics import given
from grasp_ros.physics.impact_law import stored_energy
from grasp_ros.physics.layout import EPS, OBJECT, Of
from grasp_ros.physics.model import Array, Contact, hertzian_force, in_contact, penetration
from grasp_ros.physics.system import A_SYSTEM, COLUMN, System

ROUNDING = 1e-12  # part of the energy that the roundings of some hundred steps may add in one control period

PLANT_AND_FEEDBACK, PLANT_ALONE = "plant and feedback", "the plant alone"  # what V and V_c are the energy of


class Energy(NamedTuple):
    """The paper's V (16), its continuous repair V_c, the rate V' (18) and the contact mode."""

    V: Array  # twice the energy without the clamped pairs, J
    V_c: Array  # twice the energy, J
    V_rate: Array  # W
    mode: NDArray[np.int64]  # Mode


_OVERFLOW = np.errstate(over="ignore", invalid="ignore")  # the energy of a state of 1e200 is infinite, not an error


@_OVERFLOW
def energy(system: System, state: Array, external: Array | None = None, *, feedback: bool = True) -> Energy:
    """V, V_c, V' and the contact mode of states (..., 6) under continuous feedback.

    V drops the elastic term of a pair that separates faster than 1/p while u > 0 and takes it up again later, so it
    can jump; V_c keeps the term whenever u >= 0 and never increases but by the work of external forces. In such a
    pair V' has the term 2 H u^(3/2) u', which is the rate of V_c.

    Parameters
    ----------
    system : System
    state : array (..., 6), m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r; columns of bodies that are not there are not read.
    external : array (3,) or (..., 3), N, optional
        External forces by body; only V' depends on them.
    feedback : bool
        False: of the plant alone, without the terms of the controllers.
    """
    state = given.rows("state", state, 6)
    external = None if external is None else given.rows("external", external, 3)
    given.check_rows(state=state, external=external)
    bodies = given.instance("system", system, System, A_SYSTEM).closed_loop if feedback else system.bodies
    kinetic, potential, loss = np.zeros((3, *state.shape[:-1]))
    for body in system.present:
        moving, held = mechanical_levels(bodies, body, state)
        kinetic, potential = kinetic + moving, potential + held
        v = state[..., COLUMN[body] + 1]
        loss = loss + bodies[body, Of.DAMPING] * v * v
        if body == OBJECT and system.coulomb > 0.0:
            loss = loss + system.coulomb * np.abs(v)
        if external is not None and np.any(push := external[..., body]):
            loss = loss - push * v
    V = V_c = kinetic + potential
    V_rate = -2.0 * loss
    mode = np.zeros(np.shape(V), dtype=np.int64)
    for side, contact, u, d in pairs_of(system, state):
        force, stored = hertzian_force(contact, u), elastic_level(contact, u)
        touching = in_contact(contact, u, d)
        V_c = V_c + stored
        V = V + np.where(touching, stored, 0.0)
        V_rate = V_rate + np.where(touching, -2.0 * contact.dissipation * force * d * d, 2.0 * force * d)
        mode = mode | np.where(touching, 1 << side, 0)
    return Energy(V, V_c, V_rate, mode)


class EnergyBalance(NamedTuple):
    """Energy balance of one control period, in J of V."""

    rise: Array  # of twice the energy of the plant by itself
    work: Array  # twice the work of the forces that were held
    rounding: Array  # what rounding may add

    @property
    @_OVERFLOW
    def residual(self) -> Array:
        """Rise less work: minus what was dissipated, so it is never positive but for rounding."""
        return self.rise - self.work

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """Whether the residual is positive beyond rounding, or not a number."""
        return np.logical_not(self.residual <= self.rounding)


@_OVERFLOW
def energy_balance(system: System, before: Array, after: Array, forces: Array) -> EnergyBalance:
    """Energy balance between states (..., 6) under held forces (..., 3) in N, by body.

    Along any motion E(after) - E(before) = sum f (x_after - x_before) - dissipation, with E from the plant's own k,
    its constant forces and the contacts. It holds for any delay, saturation or jitter of the commands, because the
    work of a held force needs no more than both ends.
    """
    before, after = given.rows("before", before, 6), given.rows("after", after, 6)
    forces, levels = given.rows("forces", forces, 3), []
    given.check_rows(before=before, after=after, forces=forces)
    given.instance("system", system, System, A_SYSTEM)
    rounding, work = np.zeros((2, *before.shape[:-1]))
    for state in (before, after):
        level, size = np.zeros((2, *state.shape[:-1]))
        for body in system.present:
            x, v = state[..., COLUMN[body]], state[..., COLUMN[body] + 1]
            mass, stiffness, _, force = system.bodies[body]
            own, own_size = body_energy(mass, stiffness, force, x, v, _distance(system, body, state))
            level, size = level + own, size + own_size
        for side, contact, u, _ in pairs_of(system, state):
            level = level + elastic_level(contact, u)
            rounding = rounding + 8.0 * EPS * hertzian_force(contact, u) * _distance(system, side, state)
        levels.append(level)
        rounding = rounding + ROUNDING * size
    for body in system.present:
        work = work + 2.0 * forces[..., body] * (after[..., COLUMN[body]] - before[..., COLUMN[body]])
        rounding = rounding + ROUNDING * np.abs(forces[..., body]) * _distance(system, body, after)
    return EnergyBalance(levels[1] - levels[0], work, rounding)


def body_energy(mass: Any, stiffness: Any, force: Any, x: Any, v: Any, distance: Any) -> Any:
    """m v^2 + k x^2 - 2 f x in J of V, which is twice the energy, and the sum of the sizes of its terms, of roundings.

    k (x - f/k)^2 differs by the constant f^2/k only, which may be far larger. `distance` in m is the scale of the
    rounding of x: |x| + |x_o| for an arm in contact, whose position follows from that of the object, also where x = 0.
    Of floats or arrays: `exact.driver.energy_check` compiles the same source for every segment.
    """
    kinetic = mass * v * v
    size = kinetic + (stiffness * (abs(x) + EPS * distance) + 2.0 * abs(force)) * distance
    return kinetic + stiffness * x * x - 2.0 * force * x, size


def mechanical_levels(bodies: Array, body: int, state: Array) -> tuple[Array, Array]:
    """Twice the kinetic energy and the potential of the linear terms of one body, in J; V_l, V_o or V_r of (29)."""
    x, v = state[..., COLUMN[body]], state[..., COLUMN[body] + 1]
    stiffness, force = bodies[body, Of.STIFFNESS], bodies[body, Of.FORCE]
    potential: Array = np.zeros(np.shape(state)[:-1])
    if stiffness > 0.0:
        potential = stiffness * (x - force / stiffness) * (x - force / stiffness)
    elif force != 0.0:
        potential = -2.0 * force * x
    return bodies[body, Of.MASS] * v * v, potential


def elastic_level(contact: Contact, u: Array) -> Array:
    """Twice the elastic energy of a pair, (19): a = b = 4/5; 0 without penetration."""
    return np.asarray(2.0 * stored_energy(contact.hertzian, np.maximum(u, 0.0)))


def _distance(system: System, body: int, state: Array) -> Array:
    """Scale of the rounding of a body's position, m; with the object's for an arm, which may follow from it."""
    distance: Array = np.abs(state[..., COLUMN[body]])
    return distance + np.abs(state[..., COLUMN[OBJECT]]) if body != OBJECT and OBJECT in system.present else distance


def pairs_of(system: System, state: Array) -> list[tuple[int, Contact, Array, Array]]:
    """Side, impact law, u in m and u' in m/s of every pair that can push, from states (..., 6)."""
    u = penetration(state)
    return [(side, Contact(*system.pairs[side]), u[2 * side], u[2 * side + 1]) for side in system.contacts]

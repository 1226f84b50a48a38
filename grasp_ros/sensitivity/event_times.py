"""Derivatives of the times of events: where a function g of the motion passes 0, dt = -dg / g'."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.impact_law import damping_factor, elastic_force, elastic_slope
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Entry, Law, Of, Transition
from grasp_ros.physics.model import Array, Contact, impact_force
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.sensitivity.directions import Directions, closing

SIGN: dict[int, float] = {LEFT: 1.0, RIGHT: -1.0}


class Moments(NamedTuple):
    """The times of e events, with n directions."""

    state: Array  # (e, 6)
    rates: Array  # (e, 6, n) its derivatives
    forces: Array  # (e, 3, 1 + n) constant forces that act on the bodies, and their derivatives


class _Events:
    """Events of one kind: what their function g and its rate follow from."""

    def __init__(self, bodies: Array, pairs: Array, changes: Directions, moments: Moments) -> None:
        self._bodies, self._pairs, self._changes, self._moments = bodies, pairs, changes, moments
        self._forces, self._drives = moments.forces[:, :, 0], moments.forces[:, :, 1:]

    def _impact(self, side: int) -> tuple[Array, Array, Array, Array]:
        """u, u', the impact force of a pair, and 1 + p u'; no force where condition (10) does not hold."""
        contact, (u, rate) = Contact(*self._pairs[side]), closing(side, self._moments.state)
        return np.maximum(u, 0.0), rate, impact_force(contact, u, rate), damping_factor(contact.dissipation, rate)

    def acceleration(self, body: int) -> Array:
        """Acceleration (e,) of a body, m/s^2."""
        mass, stiffness, damping, _ = self._bodies[body]
        x, v = self._moments.state[:, COLUMN[body] : COLUMN[body] + 2].T
        push = self._forces[:, body] - stiffness * x - damping * v
        for side in (LEFT, RIGHT) if body == OBJECT else (body,):
            push += SIGN[side] * (1.0 if body == OBJECT else -1.0) * self._impact(side)[2]
        return np.asarray(push / mass)

    def pair(self, side: int) -> tuple[Array, Array]:
        """Change (e, n) of u, and u'."""
        return closing(side, self._moments.rates)[0], closing(side, self._moments.state)[1]

    def surface(self, side: int) -> tuple[Array, Array]:
        """Change of u' + 1/p, and its rate."""
        rate = SIGN[side] * (self.acceleration(side) - self.acceleration(OBJECT))
        moved, loss = closing(side, self._moments.rates)[1], self._pairs[side, Law.DISSIPATION]
        return moved - self._changes.pairs[side, Law.DISSIPATION] / loss**2, rate

    def stop(self, _: int) -> tuple[Array, Array]:
        """Change of the object's velocity, and its acceleration before it stops."""
        return self._moments.rates[:, COLUMN[OBJECT] + 1], self.acceleration(OBJECT)

    def slip(self, _: int) -> tuple[Array, Array]:
        """Change of what pushes a stuck object beyond its friction, and its rate."""
        change, rate = self._drives[:, OBJECT].copy(), np.zeros(len(self._drives))
        for side in (LEFT, RIGHT):
            u, speed, force, factor = self._impact(side)
            sign, (hertzian, loss), (d_hertzian, d_loss) = SIGN[side], self._pairs[side], self._changes.pairs[side]
            if not hertzian:
                continue
            elastic = np.where(force == 0.0, 0.0, elastic_force(hertzian, u))
            slope, drag = np.where(force == 0.0, 0.0, elastic_slope(hertzian, u) * factor), loss * elastic
            deeper, faster = closing(side, self._moments.rates)
            change += sign * (slope[:, None] * deeper + drag[:, None] * faster
                              + np.outer(force / hertzian, d_hertzian) + np.outer(speed * elastic, d_loss))
            rate += sign * slope * speed + drag * self.acceleration(side)  # the object stands still
        return change - np.sign(rate)[:, None] * self._changes.coulomb, rate


FUNCTIONS = {
    Transition.TOUCH: _Events.pair, Transition.RELEASE: _Events.pair, Transition.CLAMP: _Events.surface,
    Transition.REENTRY: _Events.surface, Transition.STICK: _Events.stop, Transition.SLIP: _Events.slip,
}


def event_rates(scene: Scene, changes: Directions, sampled: bool, events: Array, moments: Moments) -> Array:
    """Derivatives (e, n) of the times of events, in s by the unit of a direction.

    Parameters
    ----------
    scene : Scene
    changes : Directions
    sampled : bool
        Whether commands are held.
    events : array (e, 5)
        See `layout.Entry`.
    moments : Moments
    """
    system = scene.system
    bodies = np.array(system.bodies if sampled else system.closed_loop)
    bodies[bodies[:, Of.MASS] == 0.0, Of.MASS] = 1.0  # of what is not there
    found: Array = np.zeros((len(events), moments.rates.shape[2]))
    time, side, kind = events[:, Entry.TIME], events[:, Entry.BODY], events[:, Entry.KIND]
    moves = time > 0.0
    if sampled or scene.system.external:
        moves &= ~((kind == Transition.SLIP) & _are_ticks(scene, time))
    with np.errstate(divide="ignore", invalid="ignore"):
        for body, what in {*zip(side[moves].tolist(), kind[moves].tolist(), strict=True)}:
            rows = moves & (side == body) & (kind == what)
            these = _Events(bodies, system.pairs, changes, Moments(*(part[rows] for part in moments)))
            change, rate = FUNCTIONS[what](these, int(body))
            found[rows] = -change / rate[:, None]
    return found


def _are_ticks(scene: Scene, times: Array) -> Any:
    """Where inputs may change at times (e,)."""
    ticks = times * NANOSECONDS / scene.period_ns
    return abs(ticks - np.round(ticks)) <= 8.0 * EPS * ticks

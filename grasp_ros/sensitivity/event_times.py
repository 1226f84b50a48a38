"""Derivatives of the times of events: where a function g of the motion passes 0, dt = -dg / g'."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.impact_law import damping_factor, elastic_force, elastic_slope
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Entry, Law, Of, Transition
from grasp_ros.physics.model import Array, impact_force_of
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.sensitivity.directions import Directions, closing

SIGN: dict[int, float] = {LEFT: 1.0, RIGHT: -1.0}


class Moments(NamedTuple):
    """The times of e events, with n directions."""

    state: Array  # (e, 6)
    rates: Array  # (e, 6, n) its derivatives
    forces: Array  # (e, 3, n + 1) derivatives of the constant forces that act on the bodies, and these


class _Event:
    """One event: what its function g and its rate follow from."""

    def __init__(self, bodies: Array, pairs: Array, changes: Directions, moment: Moments, closings: Array,
                 changed: Array) -> None:
        self._bodies, self._pairs, self._changes = bodies, pairs, changes
        self._y, self._dy = moment.state, moment.rates
        self._forces, self._drives = moment.forces[:, -1], moment.forces[:, :-1]
        self._closings, self._changed = closings, changed  # (2, 2) u and u' by side, and (2, 2, n) their derivatives

    def _impact(self, side: int) -> tuple[float, float, float, float]:
        """u, u', the impact force of a pair, and 1 + p u'; no force where condition (10) does not hold."""
        hertzian, loss = self._pairs[side]
        u, rate = self._closings[side].tolist()
        return u, rate, float(impact_force_of(hertzian, loss, u, rate)), float(damping_factor(loss, rate))

    def acceleration(self, body: int) -> float:
        """Acceleration of a body, m/s^2."""
        mass, stiffness, damping, _ = self._bodies[body]
        x, v = self._y[COLUMN[body] : COLUMN[body] + 2]
        push = self._forces[body] - stiffness * x - damping * v
        for side in (LEFT, RIGHT) if body == OBJECT else (body,):
            push += SIGN[side] * (1.0 if body == OBJECT else -1.0) * self._impact(side)[2]
        return float(push / mass)

    def pair(self, side: int) -> tuple[Array, float]:
        """Change of u, and u'."""
        return self._changed[side, 0], float(self._closings[side, 1])

    def surface(self, side: int) -> tuple[Array, float]:
        """Change of u' + 1/p, and its rate."""
        rate = SIGN[side] * (self.acceleration(side) - self.acceleration(OBJECT))
        moved = self._changed[side, 1]
        return moved - self._changes.pairs[side, Law.DISSIPATION] / self._pairs[side, Law.DISSIPATION] ** 2, rate

    def stop(self) -> tuple[Array, float]:
        """Change of the object's velocity, and its acceleration before it stops."""
        return self._dy[COLUMN[OBJECT] + 1], self.acceleration(OBJECT)

    def slip(self) -> tuple[Array, float]:
        """Change of what pushes a stuck object beyond its friction, and its rate."""
        change, rate = np.array(self._drives[OBJECT]), 0.0
        for side in (LEFT, RIGHT):
            u, speed, force, factor = self._impact(side)
            if force == 0.0:
                continue
            (hertzian, loss), (d_hertzian, d_loss) = self._pairs[side], self._changes.pairs[side]
            slope, drag = elastic_slope(hertzian, u) * factor, loss * elastic_force(hertzian, u)
            deeper, faster = self._changed[side]
            change += SIGN[side] * (slope * deeper + drag * faster + force / hertzian * d_hertzian
                                    + speed * elastic_force(hertzian, u) * d_loss)
            rate += SIGN[side] * slope * speed + drag * self.acceleration(side)  # the object stands still
        return change - np.sign(rate) * self._changes.coulomb, rate


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
    closings, changed = (np.array([closing(side, values) for side in (LEFT, RIGHT)])
                         for values in (moments.state, moments.rates))
    found: Array = np.zeros((len(events), moments.rates.shape[2]))
    for row, event in enumerate(events):
        side, kind = int(event[Entry.BODY]), int(event[Entry.KIND])
        if event[Entry.TIME] == 0.0 or (kind == Transition.SLIP and _is_tick(scene, sampled, event[Entry.TIME])):
            continue
        at = _Event(bodies, system.pairs, changes, Moments(*(part[row] for part in moments)), closings[:, :, row],
                    changed[:, :, row])
        if kind in (Transition.TOUCH, Transition.RELEASE):
            change, rate = at.pair(side)
        elif kind in (Transition.CLAMP, Transition.REENTRY):
            change, rate = at.surface(side)
        else:
            change, rate = at.stop() if kind == Transition.STICK else at.slip()
        with np.errstate(divide="ignore", invalid="ignore"):
            found[row] = -change / rate
    return found


def _is_tick(scene: Scene, sampled: bool, time: float) -> bool:
    """Whether inputs change at a time."""
    if not (sampled or scene.system.external):
        return False
    ticks = time * NANOSECONDS / scene.period_ns
    return bool(abs(ticks - round(ticks)) <= 8.0 * EPS * ticks)

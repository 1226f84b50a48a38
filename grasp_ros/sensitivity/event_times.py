"""Derivatives of the times of events: where a function g of the motion passes 0, dt = -dg / g'."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.impact_law import damping_factor, elastic_force, elastic_slope
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Entry, Law, Of, Transition
from grasp_ros.physics.model import Array, Contact, impact_force
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.sensitivity.directions import Directions, closing

SIDES = ((LEFT, 1.0), (RIGHT, -1.0))  # with the sign of the impact on the object


class Moments(NamedTuple):
    """The times of e events, with n directions."""

    state: Array  # (e, 6)
    rates: Array  # (e, 6, n) its derivatives
    forces: Array  # (e, 3, 2 + n) of each body: mass, infinite while it sticks; constant force, and its derivatives


def event_rates(scene: Scene, changes: Directions, sampled: bool, events: Array, moments: Moments) -> Array:
    """Derivatives (e, n) of the times of events (e, 5), see `layout.Entry`, in s by the unit of a direction.

    `sampled`: commands are held.
    """
    bodies, pairs = scene.system.bodies if sampled else scene.system.closed_loop, scene.system.pairs
    body, kind, moved = events[:, Entry.BODY], events[:, Entry.KIND], moments.rates
    gained, made = accelerations(bodies, pairs, moments), events[:, Entry.TIME] <= 0.0
    if sampled or scene.system.external:
        ticks = events[:, Entry.TIME] * NANOSECONDS / scene.period_ns  # where inputs may change
        made |= (kind == Transition.SLIP) & (abs(ticks - np.round(ticks)) <= 8.0 * EPS * ticks)
    change, rate = np.zeros((len(events), moved.shape[2])), np.ones(len(events))
    stops = kind == Transition.STICK
    change[stops], rate[stops] = moved[stops, COLUMN[OBJECT] + 1], gained[OBJECT, stops]
    slips = (kind == Transition.SLIP) & ~made
    if slips.any():
        pushed, faster = _excess(pairs, changes, moments, gained)
        change[slips], rate[slips] = pushed[slips], faster[slips]
    for side, sign in SIDES:
        ours = body == side
        touches = np.flatnonzero(ours & ((kind == Transition.TOUCH) | (kind == Transition.RELEASE)))
        change[touches], rate[touches] = closing(side, moved[touches])[0], closing(side, moments.state[touches])[1]
        clamps = np.flatnonzero(ours & ((kind == Transition.CLAMP) | (kind == Transition.REENTRY)))
        if len(clamps):  # u' + 1/p
            loss, speed = pairs[side, Law.DISSIPATION], closing(side, moved[clamps])[1]
            change[clamps] = speed - changes.pairs[side, Law.DISSIPATION] / loss**2
            rate[clamps] = sign * (gained[side] - gained[OBJECT])[clamps]
    change[made], rate[made] = 0.0, -1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(-change / rate[:, None])


def accelerations(bodies: Array, pairs: Array, moments: Moments) -> Array:
    """Accelerations (3, e) of the bodies, m/s^2."""
    push = moments.forces[:, :, 1].T.copy()
    for body, column in COLUMN.items():
        x, v = moments.state[:, column : column + 2].T
        push[body] -= bodies[body, Of.STIFFNESS] * x + bodies[body, Of.DAMPING] * v
    for side, sign in SIDES:
        force = sign * impact_force(Contact(*pairs[side]), *closing(side, moments.state))
        push[side] -= force
        push[OBJECT] += force
    return np.asarray(push / moments.forces[:, :, 0].T)


def _excess(pairs: Array, changes: Directions, moments: Moments, gained: Array) -> tuple[Array, Array]:
    """Change (e, n) of what pushes a stuck object beyond its friction, and its rate (e,)."""
    change, rate = moments.forces[:, OBJECT, 2:].copy(), np.zeros(len(moments.state))
    for side, sign in SIDES:
        (hertzian, loss), (d_hertzian, d_loss) = pairs[side], changes.pairs[side]
        u, speed = closing(side, moments.state)
        factor = np.where(u > 0.0, np.maximum(damping_factor(loss, speed), 0.0), 0.0)
        elastic = np.where(factor > 0.0, elastic_force(1.0, np.maximum(u, 0.0)), 0.0)
        slope, drag = elastic_slope(hertzian, np.maximum(u, 0.0)) * factor, loss * hertzian * elastic
        deeper, faster = closing(side, moments.rates)
        change += sign * (slope[:, None] * deeper + drag[:, None] * faster
                          + np.outer(factor * elastic, d_hertzian) + np.outer(hertzian * speed * elastic, d_loss))
        rate += sign * slope * speed + drag * gained[side]  # the object stands still
    return change - np.sign(rate)[:, None] * changes.coulomb, rate

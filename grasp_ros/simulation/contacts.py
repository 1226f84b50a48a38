"""The contacts of one side as a table: when, how fast in and out, and what each did."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import text
from grasp_ros.physics.impact_law import elastic_slope
from grasp_ros.physics.layout import EPS, Body, Entry, Transition
from grasp_ros.physics.lyapunov import deformation
from grasp_ros.physics.model import Array, hertzian_force, impact_force
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation.repeat import breaks_of, reached
from grasp_ros.simulation.smooth import MOST_HALVINGS, Quantity, expand

if TYPE_CHECKING:  # it imports this file
    from grasp_ros.simulation.trajectory import Trajectory

UNITS = {
    "begin": "s", "end": "s", "speed_in": "m/s", "speed_out": "m/s", "restitution": "1", "peak_force": "N",
    "impulse": "N s", "loss": "J", "deepest": "m",
}
ROUNDINGS = 8.0 * EPS  # of a position, in the difference of two


def side_of(name: str) -> Body:
    """A side by its name."""
    if text("side", name) not in SIDES:
        raise Refused(f"side {name!r} is not allowed; allowed: {' or '.join(SIDES)}")
    return SIDES[name]


def check_located(run: Trajectory) -> None:
    """Refuse a run by a method that does not look for contacts: without events there were none, otherwise."""
    if not METHODS[run.method].events:
        known = ", ".join(name for name, method in METHODS.items() if method.events)
        raise Refused(f"{run.scene.name}: {run.method} does not look for contacts; allowed: a run by {known}")


def intervals(run: Trajectory, side: Body) -> Array:
    """Begin and end of every stretch with u > 0 of one side, (n, 4): s, and u' at both, m/s.

    u' is NaN at a begin or an end that is that of the run.
    """
    check_located(run)
    touch, release = Transition.TOUCH, Transition.RELEASE
    own = run.event_table[run.event_table[:, Entry.BODY] == side]
    own = own[np.isin(own[:, Entry.KIND], (touch, release))]
    begins, ends = (own[own[:, Entry.KIND] == kind][:, [Entry.TIME, Entry.RATE]].tolist() for kind in (touch, release))
    closed = deformation(run.scene.system, run.scene.initial_state)[side] > 0.0
    if own[0, Entry.KIND] == release if len(own) else closed:
        begins.insert(0, [0.0, np.nan])
    if len(begins) > len(ends):
        ends.append([reached(run), np.nan])
    rows = [(a[0], b[0], a[1], b[1]) for a, b in zip(begins, ends, strict=True)]
    return np.reshape(rows, (-1, 4))


def contact_table(run: Trajectory, side: Body) -> np.ndarray:
    """The contacts of one side, see `trajectory.Trajectory.contacts`."""
    found, breaks = intervals(run, side), breaks_of(run)
    found = found[found[:, 1] > found[:, 0]]
    rows = np.zeros(len(found), dtype=[(name, "f8") for name in UNITS])
    rows["begin"], rows["end"], rows["speed_in"], rows["speed_out"] = *found.T[:3], -found[:, 3]
    rows["restitution"] = np.nan  # of what does not come in
    np.divide(rows["speed_out"], rows["speed_in"], out=rows["restitution"], where=rows["speed_in"] > 0.0)
    if not len(found):
        return rows
    begins, ends = breaks[:-1], breaks[1:]
    group = np.searchsorted(found[:, 0], begins, side="right") - 1
    within = (group >= 0) & (ends <= found[group, 1])
    pieces = expand(run.at, _quantities_of(run.scene.system, side), begins[within], ends[within], group[within],
                    MOST_HALVINGS)  # an impact of microseconds may begin a contact of minutes
    rows["impulse"], rows["loss"] = (pieces.integral(column, len(found)) for column in (0, 1))
    rows["peak_force"], rows["deepest"] = (pieces.largest(column, len(found)) for column in (0, 2))
    return rows


def _quantities_of(system: System, side: int) -> Quantity:
    """Force in N, power lost in W, and penetration in m of one pair."""
    def quantities(_: Array, state: Array) -> tuple[Array, Array]:
        state = np.nan_to_num(state)
        contact, u, d = next((law, u, d) for other, law, u, d in pairs_of(system, state) if other == side)
        u = np.maximum(u, 0.0)
        force, elastic = impact_force(contact, u, d), hertzian_force(contact, u)
        rounding = ROUNDINGS * np.abs(state[:, 0::2]).max(axis=1)
        slope = elastic_slope(contact.hertzian, u + rounding)
        noise = np.stack([slope * rounding * (1.0 + contact.dissipation * np.abs(d)),
                          slope * rounding * contact.dissipation * d * d, rounding], axis=1)
        return np.stack([force, (force - elastic) * d, u], axis=1), noise

    return quantities

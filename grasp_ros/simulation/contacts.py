"""The contacts of one side as a table: when, how fast in and out, and what each did."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.impact_law import elastic_slope
from grasp_ros.physics.layout import EPS, Entry, Transition
from grasp_ros.physics.model import Array, Contact, hertzian_force, impact_force
from grasp_ros.physics.system import System
from grasp_ros.simulation.smooth import Quantity, States, expand

UNITS = {
    "begin": "s", "end": "s", "speed_in": "m/s", "speed_out": "m/s", "restitution": "1", "peak_force": "N",
    "impulse": "N s", "loss": "J", "deepest": "m",
}
ROUNDINGS = 8.0 * EPS  # of a position, in the difference of two


def intervals(event_table: Array, side: int, end: float) -> Array:
    """Begin and end of every stretch with u > 0 of one side up to a time, (n, 4): s, and u' at both, m/s.

    u' is NaN at a begin or an end that is that of the run.
    """
    own = event_table[event_table[:, Entry.BODY] == side]
    begins, ends = (own[own[:, Entry.KIND] == kind][:, [Entry.TIME, Entry.RATE]].tolist()
                    for kind in (Transition.TOUCH, Transition.RELEASE))
    if ends and (not begins or ends[0][0] < begins[0][0]):
        begins.insert(0, [0.0, np.nan])  # it began in contact
    if len(begins) > len(ends):
        ends.append([end, np.nan])
    rows = [(a[0], b[0], a[1], b[1]) for a, b in zip(begins, ends, strict=True)]
    return np.reshape(rows, (-1, 4))


def contact_table(system: System, event_table: Array, side: int, breaks: Array, states: States) -> np.ndarray:
    """The contacts of one side, see `trajectory.Trajectory.contacts`.

    `breaks` (k,) in s are begin and end of the run, and between them all times at which the motion is not smooth.
    """
    found = intervals(event_table, side, float(breaks[-1]))
    found = found[found[:, 1] > found[:, 0]]
    rows = np.zeros(len(found), dtype=[(name, "f8") for name in UNITS])
    rows["begin"], rows["end"], rows["speed_in"], rows["speed_out"] = *found.T[:3], -found[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        rows["restitution"] = rows["speed_out"] / rows["speed_in"]
    if not len(found):
        return rows
    begins, ends = breaks[:-1], breaks[1:]
    group = np.searchsorted(found[:, 0], begins, side="right") - 1
    within = (group >= 0) & (ends <= found[group, 1])
    pieces = expand(states, _quantities_of(system, side), begins[within], ends[within], group[within])
    for name, column in (("impulse", 0), ("loss", 1)):
        rows[name] = pieces.integral(column, len(found))
    for name, column in (("peak_force", 0), ("deepest", 2)):
        rows[name] = pieces.largest(column, len(found))
    return rows


def _quantities_of(system: System, side: int) -> Quantity:
    """Force in N, power lost in W, and penetration in m of one pair."""
    contact = Contact(*system.pairs[side].tolist())

    def quantities(_: Array, state: Array) -> tuple[Array, Array]:
        state = np.nan_to_num(state)
        [(u, d)] = [(u, d) for other, u, d in pairs_of(system, state) if other == side]
        u = np.maximum(u, 0.0)
        force, elastic = impact_force(contact, u, d), hertzian_force(contact, u)
        rounding = ROUNDINGS * np.abs(state[:, 0::2]).max(axis=1)
        slope = elastic_slope(contact.hertzian, u + rounding)
        noise = np.stack([slope * rounding * (1.0 + contact.dissipation * np.abs(d)),
                          slope * rounding * contact.dissipation * d * d, rounding], axis=1)
        return np.stack([force, (force - elastic) * d, u], axis=1), noise

    return quantities

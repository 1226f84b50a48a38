"""`grasp simulate --sensitivity`: derivatives of a run, printed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from grasp_ros.cli.report import Row
from grasp_ros.physics.layout import Body, Entry, Transition
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.sensitivity.sensitivities import Sensitivity

LAST = 4  # events that are shown


def describe_sensitivity(found: Sensitivity) -> Iterable[Row]:
    """Derivatives of the last state, of V_c there, and of the times of the last events, number by number."""
    for place, key in enumerate(found.keys):
        yield f"d / d {key}", f"at t = {found.t[-1]:.6g} s, by its unit"
        for body in found.scene.system.present:
            x, v = found.state_rates[-1, COLUMN[body] : COLUMN[body] + 2, place]
            yield f"  {NAMES[body]} position, velocity", f"{x:.12g} m, {v:.12g} m/s"
        yield "  V_c", f"{found.V_c_rates[-1, place]:.12g} J"
        for event, rate in zip(found.event_table[-LAST:], found.event_rates[-LAST:, place], strict=True):
            kind, body = Transition(int(event[Entry.KIND])), Body(int(event[Entry.BODY]))
            yield f"  {kind.name.lower()} {body.name.lower()} at {event[Entry.TIME]:.6g} s", f"{rate:.12g} s"
    if found.corner is not None:
        yield "one-sided derivatives differ", f"from t = {found.corner:.6g} s on: a stopped object could as well stay"


def last_rates(found: Sensitivity) -> dict[str, dict[str, Any]]:
    """Derivatives at the last time as data, number by number: of the state (6,), and of V_c."""
    return {
        key: {"t": found.t[-1], "state": found.state_rates[-1, :, place], "V_c": found.V_c_rates[-1, place]}
        for place, key in enumerate(found.keys)
    }

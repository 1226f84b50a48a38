"""Derivatives of a run: printed by `grasp simulate --sensitivity`, drawn by `grasp plot --sensitivity`."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from grasp_ros.cli.report import Row
from grasp_ros.physics.layout import Body, Entry, Transition
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.simulation import plots
from grasp_ros.simulation.canvas import Axes
from grasp_ros.simulation.tables import Motion

if TYPE_CHECKING:
    from grasp_ros.simulation.differentiate import Sensitivity

LAST = 4  # events that are shown
WIDE = 100.0  # a derivative that grows by more has a logarithmic axis


def describe_sensitivity(found: Sensitivity) -> Iterable[Row]:
    """Derivatives of the last state, of V_c there, and of the times of the last events, number by number."""
    for key, own in last_rates(found).items():
        yield f"d / d {key}", f"at t = {own['t']:.6g} s, by its unit"
        for body in found.scene.system.present:
            x, v = own["state"][COLUMN[body] : COLUMN[body] + 2]
            yield f"  {NAMES[body]} position, velocity", f"{x:.12g} m, {v:.12g} m/s"
        yield "  V_c", f"{own['V_c']:.12g} J"
        for event in own["events"][-LAST:]:
            what = f"{event['kind'].lower()} {event['body'].lower()}"
            yield f"  {what} at {event['time_s']:.6g} s", f"{event['rate']:.12g} s"
    if found.corner is not None:
        yield "one-sided derivatives differ", f"from t = {found.corner:.6g} s on"


def last_rates(found: Sensitivity) -> dict[str, dict[str, Any]]:
    """Derivatives as data, number by number: at the last time of the state (6,) and V_c, and of the times of events."""
    level_rates = found.V_c_rates[-1]
    return {
        key: {"t": found.t[-1], "state": found.state_rates[-1, :, place], "V_c": level_rates[place],
              "corner": found.corner, "events": [
                  {"time_s": event[Entry.TIME], "kind": Transition(int(event[Entry.KIND])).name,
                   "body": Body(int(event[Entry.BODY])).name, "rate": rate}
                  for event, rate in zip(found.event_table, found.event_rates[:, place], strict=True)]}
        for place, key in enumerate(found.keys)
    }


def sensitivity_panels(found: Sensitivity) -> list[plots.Panel]:
    """A panel for each number: derivatives of the positions by it, over time."""
    return [plots.Panel(partial(_draw, found, place), "derivative, m", 2) for place in range(len(found.keys))]


def _draw(found: Sensitivity, place: int, axes: Axes, _: Motion) -> None:
    rates = found.state_rates[:, ::2, place]
    sizes = np.abs(rates[rates != 0.0])
    if len(sizes) and sizes.max() > WIDE * np.median(sizes):
        axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(np.median(sizes))))
        axes.locator_params(axis="y", numticks=7)
    for body in found.scene.system.present:
        axes.plot(found.t, rates[:, COLUMN[body] // 2], label=f"$dx_{NAMES[body][0]}$", color=plots.COLORS[body],
                  linewidth=1.0)
    if found.corner is not None:
        axes.axvline(found.corner, color="black", linewidth=0.8, linestyle=":", label="one-sided from here")
    axes.set_title(f"by {found.keys[place]}", loc="left", fontsize="small", parse_math=False)

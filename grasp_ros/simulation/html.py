"""What a notebook shows of a run: a few numbers, and a picture of the positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.html import table

if TYPE_CHECKING:  # it imports this file
    from grasp_ros.simulation.trajectory import Trajectory

COLORS: dict[int, str] = {LEFT: "#0072b2", OBJECT: "#777777", RIGHT: "#d55e00"}
WIDTH, HEIGHT, POINTS = 480, 120, 400  # px, and points of a line


def html_of_run(run: Trajectory) -> str:
    """A table of the run and its positions as an SVG."""
    touches = ", ".join(f"{NAMES[side]} {len(run.times(Transition.TOUCH, side))}" for side in (LEFT, RIGHT))
    rows = [
        ("scene", f"{run.scene.name}: {run.scene.title}"), ("status", run.stop or run.status.value),
        ("output times", f"{len(run.t)}, up to {run.t[-1] if len(run.t) else 0.0:g} s"), ("touches", touches),
        ("method", f"{run.method}, {run.setting:g}"),
    ]
    if len(run.t):
        first, last = run.energy.V_c[[0, -1]]
        rows.append((f"V_c of {run.energy_of}", f"{first:.6g} J at the begin, {last:.6g} J at the end"))
    if run.at_rest is not None:
        rows.append(("at rest", f"from {run.at_rest:.6g} s on"))
    picture = _picture(run) if run.status is Status.DONE and len(run.t) > 1 else ""
    return table(rows) + picture


def _picture(run: Trajectory) -> str:
    """Positions over time."""
    chosen = np.unique(np.linspace(0, len(run.t) - 1, POINTS).round().astype(int))
    shown = run.scene.system.present
    x = {body: run.state[chosen, COLUMN[body]] for body in shown}
    low, high = min(values.min() for values in x.values()), max(values.max() for values in x.values())
    across = (run.t[chosen] - run.t[0]) / (run.t[-1] - run.t[0] or 1.0) * WIDTH
    lines = []
    for body, values in x.items():
        up = HEIGHT * (1.0 - (values - low) / (high - low or 1.0))
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
        lines.append(f"<polyline points='{points}' fill='none' stroke='{COLORS[body]}'><title>x {NAMES[body]}</title>"
                     "</polyline>")
    return (f"<svg viewBox='0 -4 {WIDTH} {HEIGHT + 8}' width='{WIDTH}' height='{HEIGHT + 8}'>{''.join(lines)}</svg>"
            f"<div>positions, {low:.3g} to {high:.3g} m</div>")

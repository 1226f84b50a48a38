"""A figure of a fit: measured against fitted, and what is left over."""

from __future__ import annotations

import numpy as np

from grasp_ros.identification.result import Fit
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.simulation.canvas import Figure, style, subplots
from grasp_ros.simulation.plots import COLORS, legend_beside

PARTS = (("position, m", 0), ("velocity, m/s", 1))


def measured_and_fitted(found: Fit) -> Figure:
    """Dots are measured, lines fitted; below, residuals in standard deviations of the noise; touches are dotted."""
    seen = np.isfinite(found.noise)
    parts = [(label, part) for label, part in PARTS if seen[part::2].any()]
    with style({"font.size": 9.0}):
        figure, panels = subplots(len(parts) + 1, figsize=(9.0, 2.4 * (len(parts) + 1)), sharex=True)
        for axes, (label, part) in zip(panels, parts, strict=False):
            for body, column in ((body, first + part) for body, first in COLUMN.items() if seen[first + part]):
                axes.plot(found.t, found.measured[:, column], ".", color=COLORS[body], markersize=2.5, alpha=0.4)
                axes.plot(found.t, found.fitted[:, column], color=COLORS[body], linewidth=1.0, label=NAMES[body])
            axes.set_ylabel(label)
        for body, first in COLUMN.items():
            for column in (first, first + 1):
                rest = found.residuals[:, column] / found.noise[column]
                panels[-1].plot(found.t, rest, ".", color=COLORS[body], markersize=1.5)
        panels[-1].set_ylabel("residual / noise")
        panels[-1].set_xlabel("time, s")
        panels[0].set_title(f"{found.scene.name}: measured (dots) and fitted", fontsize="medium", parse_math=False)
        legend_beside(panels[0])
        for axes in panels:
            axes.grid(alpha=0.3)
            for contact in found.contacts[1:]:
                axes.axvline(contact.begin, color="black", linewidth=0.6, linestyle=":")
        figure.canvas.draw()
        return figure

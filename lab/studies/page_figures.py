"""The figures of the pages on effects and on the hard cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from grasp_ros.simulation import canvas
from grasp_ros.simulation.plots import LEFT_COLOR, OBJECT_COLOR, save

KEPT, BROKEN, NONE = "kept", "broken", "no result"
OUTCOMES = {KEPT: (LEFT_COLOR, "", "white"), BROKEN: ("#f2a65a", "////", "black"), NONE: ("#d8d8d8", "", "black")}


@canvas.style()
def effect_costs(rows: Sequence[tuple[str, float, float]], path: Path) -> None:
    """Draw what variants of a scene cost: name, us per control period, kB per simulated second."""
    names = [name for name, _, _ in rows]
    figure, panels = canvas.subplots(1, 2, sharey=True, figsize=(9.0, 0.3 * len(rows) + 1.2))
    for axes, column, label in zip(panels, (1, 2), ("us per control period, no ROS", "bag, kB per s"), strict=True):
        values = [float(row[column]) for row in rows]
        bars = axes.barh(names, values, color=[OBJECT_COLOR if name == names[0] else LEFT_COLOR for name in names])
        axes.bar_label(bars, [f"{value / values[0]:.2f}" for value in values], padding=3, fontsize="small")
        axes.axvline(values[0], color=OBJECT_COLOR, linewidth=0.8, linestyle="--")
        axes.set(xlim=(0.0, 1.15 * max(values)), xlabel=label)
    panels[0].invert_yaxis()
    figure.suptitle("cost of each effect; beside the bars: ratio to the bare scene", fontsize="medium")
    save(figure, path)


@canvas.style()
def hard_cases(rows: Mapping[str, Sequence[Counter[str] | None]], solvers: Sequence[str], path: Path) -> None:
    """Draw how many cases of each family each solver keeps, breaks, or has no result of; None: it was not asked."""
    size = (2.2 + 2.6 * len(solvers), 0.33 * len(rows) + 1.2)
    figure, panels = canvas.subplots(1, len(solvers), sharey=True, squeeze=False, figsize=size)
    for column, (axes, solver) in enumerate(zip(panels[0], solvers, strict=True)):
        for row, counts in enumerate(each[column] for each in rows.values()):
            _outcomes(axes, row, counts)
        axes.set_xlim(0.0, 1.0)
        axes.set_xticks([])
        axes.set_title(solver, fontsize="medium")
        axes.spines[:].set_visible(False)
        axes.tick_params(left=False)
    panels[0, 0].set_yticks(range(len(rows)), list(rows))
    panels[0, 0].set_ylim(len(rows) - 0.5, -0.5)
    handles = [Patch(facecolor=color, hatch=hatch, edgecolor="white", label=name)
               for name, (color, hatch, _) in OUTCOMES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False,
                  title="cases of each family: error against the promised bound", title_fontsize="small")
    save(figure, path)


def _outcomes(axes: Axes, row: int, counts: Counter[str] | None) -> None:
    """A bar with a part for each outcome, and its number."""
    if counts is None:
        axes.text(0.0, row, "not asked", va="center", fontsize="small", color="#555555")
        return
    left, whole = 0.0, counts.total()
    for name, (color, hatch, ink) in OUTCOMES.items():
        if counts[name]:
            width = counts[name] / whole
            axes.barh(row, width, left=left, height=0.8, color=color, hatch=hatch, edgecolor="white", linewidth=0.8)
            axes.text(left + 0.5 * width, row, str(counts[name]), ha="center", va="center", fontsize="small", color=ink,
                      bbox={"facecolor": color, "edgecolor": "none", "pad": 1.0})
            left += width

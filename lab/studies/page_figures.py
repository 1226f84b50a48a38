"""The figures of the pages on effects, on the certificate and on the hard cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import Patch

from grasp_ros.physics.model import penetration
from grasp_ros.simulation import canvas
from grasp_ros.simulation.plots import LEFT_COLOR, OBJECT_COLOR, RIGHT_COLOR, save
from grasp_ros.simulation.tables import Motion

KEPT, BROKEN, NONE = "kept", "broken", "no result"
OUTCOMES = {KEPT: (LEFT_COLOR, "", "white"), BROKEN: ("#f2a65a", "////", "black"), NONE: ("#d8d8d8", "", "black")}

@canvas.style()
def effect_costs(rows: Sequence[tuple[str, float, float]], path: Path) -> None:
    """Draw what variants of a scene cost: name, us per control period, kB per simulated second."""
    names = [name for name, _, _ in rows]
    figure, panels = canvas.subplots(1, 2, sharey=True, figsize=(9.0, 0.3 * len(rows) + 1.2), layout="constrained")
    for axes, column, label in zip(panels, (1, 2), ("us per control period, no ROS", "bag, kB per s"), strict=True):
        values = [float(row[column]) for row in rows]
        bars = axes.barh(names, values, color=[OBJECT_COLOR if name == names[0] else LEFT_COLOR for name in names])
        axes.bar_label(bars, [f"{value / values[0]:.2f}" for value in values], padding=3, fontsize="small")
        axes.axvline(values[0], color=OBJECT_COLOR, linewidth=0.8, linestyle="--")
        axes.set_xlim(0.0, 1.15 * max(values))
        axes.set_xlabel(label)
    panels[0].invert_yaxis()
    figure.suptitle("cost of each effect; beside the bars: ratio to the bare scene", fontsize="medium")
    save(figure, path)


@canvas.style()
def v_jumps(motions: Sequence[Motion], path: Path) -> None:
    """Draw V and V_c of motions whose V jumps, and u' beside -1/p."""
    figure, panels = canvas.subplots(2, len(motions), sharex="col", figsize=(11.0, 6.0), layout="constrained")
    for motion, (top, bottom) in zip(motions, panels.T, strict=True):
        level, pairs = motion.energy, motion.scene.system.pairs
        _, d_l, _, d_r = penetration(motion.state)
        top.plot(motion.t, level.V_c, color="black", linewidth=1.4, label="$V_c$")
        top.plot(motion.t, level.V, color="#cc79a7", linewidth=1.2, linestyle="--", label="$V$ of the paper")
        top.set_yscale("log")
        top.set_title(motion.scene.title, fontsize="medium")
        for d, p, label, color, style in (
            (d_l, pairs[0, 1], "$p\\,\\dot u_l$", LEFT_COLOR, "-"),
            (d_r, pairs[1, 1], "$p\\,\\dot u_r$", RIGHT_COLOR, "--"),
        ):
            bottom.plot(motion.t, p * d, color=color, linestyle=style, linewidth=1.2, label=label)
        bottom.axhline(-1.0, color="black", linewidth=0.8, label="$-1$: second half of (10)")
        bottom.set_ylim(-1.6, 0.6)
        bottom.set_xlabel("time, s")
        for axes in (top, bottom):
            axes.grid(alpha=0.3)
            axes.set_xlim(0.0, motion.t[-1])
    panels[0, 0].set_ylabel("twice the energy, J")
    panels[1, 0].set_ylabel("speed of deformation, in $1/p$")
    lines = [line for axes in panels[:, 0] for line in axes.get_lines()]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines), frameon=False)
    save(figure, path)


@canvas.style()
def hard_cases(rows: Mapping[str, Sequence[Counter[str] | None]], solvers: Sequence[str], path: Path) -> None:
    """Draw how many cases of each family each solver keeps, breaks, or has no result of; None: it was not asked."""
    size = (2.2 + 2.6 * len(solvers), 0.33 * len(rows) + 1.2)
    figure, panels = canvas.subplots(1, len(solvers), sharey=True, squeeze=False, figsize=size, layout="constrained")
    for place, (axes, solver) in enumerate(zip(panels[0], solvers, strict=True)):
        for row, counts in enumerate(each[place] for each in rows.values()):
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

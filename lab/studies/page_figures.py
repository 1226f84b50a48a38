"""The figures of the pages on effects, on the certificate and on the hard cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from grasp_ros.physics.model import penetration
from grasp_ros.simulation import canvas
from grasp_ros.simulation.plots import LEFT_COLOR, OBJECT_COLOR, RIGHT_COLOR, Motion, save


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
        bottom.axhline(-1.0, color="black", linewidth=0.8, label="$-1$: second surface of (10)")
        bottom.set_ylim(-1.6, 0.6)
        bottom.set_xlabel("time, s")
        for axes in (top, bottom):
            axes.grid(alpha=0.3)
            axes.legend(loc="upper right", fontsize="small")
    panels[0, 0].set_ylabel("J")
    panels[1, 0].set_ylabel("1")
    save(figure, path)


@canvas.style()
def hard_cases(
    rows: Sequence[tuple[str, float, float | None, Sequence[float | None]]], others: Sequence[str], path: Path
) -> None:
    """Draw the errors of hard cases: family, what is promised, ours, those of other methods; None: no result."""
    figure, axes = canvas.subplots(figsize=(11.0, 5.0), layout="constrained")
    floor = 1e-17  # where an exact 0 is drawn
    series = [("this package", LEFT_COLOR, "o", [own for _, _, own, _ in rows])]
    for place, name in enumerate(others):
        color, marker = ((RIGHT_COLOR, "x"), ("#cc79a7", "+"))[place % 2]
        series.append((name, color, marker, [found[place] if found else None for _, _, _, found in rows]))
    for label, color, marker, values in series:
        shown = [(place, max(value, floor)) for place, value in enumerate(values) if value is not None]
        if shown:
            axes.plot(*zip(*shown, strict=True), marker, color=color, markersize=4, label=label)
    axes.plot([max(row[1], floor) for row in rows], "_", color="black", markersize=6, label="promised")
    families = [row[0] for row in rows]
    begins = [place for place, family in enumerate(families) if place == 0 or families[place - 1] != family]
    for place in begins:
        axes.axvline(place - 0.5, color="black", linewidth=0.5, alpha=0.4)
    axes.set_xticks(begins, [families[place] for place in begins], rotation=45, ha="right", fontsize="small")
    axes.set_yscale("log")
    axes.set_ylim(floor / 3.0, 1e3)
    axes.set_ylabel("error by the case's oracle")
    axes.grid(axis="y", alpha=0.3)
    axes.legend(loc="upper right", ncols=3, fontsize="small")
    save(figure, path)

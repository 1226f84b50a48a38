"""The figures of the studies. A label says what the number is; a failure has a mark of its own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from grasp_ros.accuracy.measure import Record, by_method
from grasp_ros.methods.contract import STEP
from grasp_ros.physics.model import Arm
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.simulation import canvas
from grasp_ros.simulation.plots import save
from lab.studies.accuracy import frontier
from lab.studies.drift import Drift
from lab.studies.loop import FIRST_S, Limit, Point, simulated_growth
from lab.studies.predictability import LEVELS, Prediction
from lab.studies.records import by_scene

COLORS = {  # by the beginning of a method's name; distinguishable for colour-blind readers
    "exact": "#000000", "paper": "#d55e00", "rk45": "#56b4e9", "rk4": "#e69f00", "discrete": "#8c6d1f",
    "dop853": "#0072b2", "radau": "#cc79a7", "lsoda": "#7a5195", "odeint": "#7a5195", "cvode": "#999999",
    "heyoka": "#009e73",
}
GRID = {"axes.grid": True, "grid.alpha": 0.25}
HEIGHT, WIDTH = 3.1, 4.3  # inches, of a panel
DPI = 130


def style(method: str) -> dict[str, Any]:
    """Solid where events are located or need not be, dashed where they are left to the right-hand side."""
    bold = method in ("exact", "paper")
    located = bold or method.endswith("_events") or method.startswith(("heyoka", "discrete"))
    mark = {"o": method.endswith("_events") or bold, "s": method == "odeint" or method.startswith("heyoka_")}
    return {
        "color": next(value for name, value in COLORS.items() if method.startswith(name)),
        "linestyle": "-" if located else (0, (4, 2)), "linewidth": 2.2 if bold else 0.9,
        "marker": next((m for m, is_so in mark.items() if is_so), "^"), "markersize": 3.5 if bold else 2.5,
        "zorder": 4 if bold else 2,
    }


@canvas.style(GRID)
def work_precision(records: Sequence[Record], metric: str, path: Path) -> None:
    """Error against time, one panel a scene, with the frontier that no method passes."""
    scenes = by_scene(records)
    columns, rows = min(len(scenes) + 1, 3), -(-(len(scenes) + 1) // 3)
    figure, grid = canvas.subplots(
        rows, columns, figsize=(WIDTH * columns, HEIGHT * rows), squeeze=False)
    for axes, (name, here) in zip(grid.flat, scenes.items(), strict=False):
        for method, group in by_method(here).items():
            good = [record for record in group if record.good]
            axes.plot(*_points(good), **style(method))
            wrong = [record for record in good if record.missed or record.status != "done"]
            axes.plot(*_points(wrong), "x", color="#cc0000", markersize=5, markeredgewidth=1.1, zorder=6)
        axes.step(
            *_points(frontier(here)), where="post", color="#f0e442", linewidth=7.0, alpha=0.6, zorder=1,
            solid_joinstyle="round",
        )
        failed = sorted({record.method for record in here if not record.good})
        axes.set_title(name, fontsize="medium")
        if failed:
            axes.text(
                0.98, 0.98, "no result at some setting:\n" + "\n".join(failed), transform=axes.transAxes, ha="right",
                va="top", fontsize=6, color="#cc0000",
            )
        axes.set(xscale="log", yscale="log", ylim=(1e-14, 1e2), xlabel="fastest warm run, s")
    for axes in grid.flat[len(scenes) :]:
        axes.axis("off")
    _method_legend(grid.flat[len(scenes)], list(by_method(records)))
    figure.supylabel("error: " + metric.replace(", against", ",\nagainst"), fontsize="small")
    save(figure, path, DPI)


def _points(records: Sequence[Record]) -> tuple[list[float], list[float]]:
    """Time and error; an error of zero is drawn at the lower edge."""
    return [record.time for record in records], [max(record.error or 0.0, 1e-15) for record in records]


def _method_legend(axes: Axes, methods: list[str]) -> None:
    handles = [Line2D([], [], label=method, **style(method)) for method in methods]
    handles += [
        Line2D([], [], color="#f0e442", linewidth=7.0, alpha=0.6, label="best of all: the frontier"),
        Line2D([], [], linestyle="", marker="x", color="#cc0000", label="touches missed or invented,\nor stopped"),
    ]
    axes.legend(handles=handles, loc="center", ncols=2, fontsize=7, frameon=False, handlelength=3.0)


@canvas.style(GRID)
def contacts_missed(records: Sequence[Record], path: Path) -> None:
    """By how much the count of touches is wrong, against tolerance (above) and step (below)."""
    scenes = by_scene(records)
    figure, grid = canvas.subplots(
        2, len(scenes), figsize=(2.6 * len(scenes), 5.2), sharey=True, sharex="row", squeeze=False
    )
    for column, (name, own) in enumerate(scenes.items()):
        here = [record for record in own if record.found is not None]
        total = sum(here[0].there_are) if here else 0
        grid[0, column].set_title(f"{name}\n{total} touches there are", fontsize="small")
        for method, group in by_method(here).items():
            axes = grid[int(group[0].knob == STEP), column]
            axes.plot([r.setting for r in group], [r.missed for r in group], **style(method), label=method)
    for row, knob in enumerate(("tolerance or accuracy", "step, s")):
        for axes in grid[row]:
            axes.set(xscale="log", xlabel=knob)
            axes.set_yscale("symlog", linthresh=1.0)
            axes.set_ylim(-0.3, 200)
            axes.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
        if not grid[row, 0].xaxis_inverted():
            grid[row, 0].invert_xaxis()
        grid[row, 0].set_ylabel("touches missed\nor invented")
        lines = {line.get_label(): line for axes in grid[row] for line in axes.get_lines()}
        figure.legend(
            lines.values(), lines.keys(), fontsize=7, loc=("outside right upper", "outside right lower")[row],
            frameon=False,
        )
    save(figure, path, DPI)


@canvas.style(GRID)
def energy_drift(drifts: Sequence[Drift], path: Path) -> None:
    """Relative energy drift against time."""
    figure, axes = canvas.subplots(figsize=(8.5, 4.8))
    for row in sorted(drifts, key=lambda row: -row.worst):
        label = f"{row.method}, {row.setting}: {row.worst:.0e}, {row.seconds:.2g} s"
        if not row.t:
            axes.plot([], [], " ", label=f"{row.method}, {row.setting}: {row.status}")
            continue
        size = np.maximum(np.maximum.accumulate(np.abs(row.drift)), 1e-17)
        axes.plot(row.t[1:], size[1:], **{**style(row.method), "marker": ""}, label=label)
    axes.axhline(1e-11, color="#888888", linewidth=0.8, linestyle=":")
    axes.text(1.1, 1.2e-11, "target 1e-11", fontsize=7, color="#666666")
    axes.set(
        xscale="log", yscale="log", xlabel="simulated time, s", ylim=(1e-16, 1e2),
        ylabel="largest $|V_c/V_c(0) - 1|$ so far", title="case 2, perfectly elastic: energy must stay",
    )
    axes.legend(fontsize=7, title="method, setting: worst drift, wall time", title_fontsize=7, loc="center left",
                bbox_to_anchor=(1.0, 0.5))
    save(figure, path, DPI)


@canvas.style(GRID)
def control_period(points: Sequence[Point], name: str, path: Path) -> None:
    """Deviation and price of the sampled loop against the control period."""
    figure, (left, right) = canvas.subplots(1, 2, figsize=(9.5, 4.0))
    period = [point.period_ms for point in points]
    left.plot(period, [point.deviation for point in points], "o-", color="#0072b2")
    deviation = "largest deviation of a position\nfrom continuous feedback, m"
    left.set(ylabel=deviation, title=f"{name}: what a short period gives")
    for label, values, line in (
        ("one process", [point.one_process for point in points], {"color": "#0072b2", "marker": "o"}),
        ("four processes, with bag and monitor", [point.four_processes for point in points],
         {"color": "#d55e00", "marker": "s"}),
        ("bare rclpy: the same messages and nothing else", [point.baseline for point in points],
         {"color": "#888888", "marker": "^", "linestyle": "--"}),
    ):
        there = [(p, value) for p, value in zip(period, values, strict=True) if value is not None]
        if there:
            right.plot(*zip(*there, strict=True), label=label, **line)
    right.axhline(1.0, color="black", linewidth=0.8, linestyle=":")
    right.text(period[0], 1.15, "real time", fontsize=7)
    right.set(ylabel="wall seconds per simulated second", title="what it takes")
    right.legend(fontsize=7)
    for axes in (left, right):
        axes.set(xscale="log", yscale="log", xlabel="control period, ms")
        axes.invert_xaxis()
        axes.set_xticks([20, 10, 5, 2, 1, 0.5, 0.2, 0.1], ["20", "10", "5", "2", "1", "0.5", "0.2", "0.1"])
        axes.minorticks_off()
    save(figure, path, DPI)


@canvas.style(GRID)
def prediction(predictions: Sequence[Prediction], path: Path) -> None:
    """How two roundings grow."""
    figure, axes = canvas.subplots(figsize=(8.0, 4.4))
    shades = ("#0072b2", "#e69f00", "#d55e00", "#009e73", "#cc79a7", "#000000")
    for row, shade in zip(predictions, cycle(shades), strict=False):
        there = row.distance > 0.0
        axes.plot(row.t[there], row.distance[there], label=row.scene, color=shade, linewidth=1.5)
    for level in LEVELS:
        axes.axhline(level, color="#888888", linewidth=0.7, linestyle=":")
        axes.text(1.01, level, f"{level:.0e}", transform=axes.get_yaxis_transform(), fontsize=8, va="center")
    axes.set(
        yscale="log", xlabel="simulated time, s", ylim=(1e-17, 10.0),
        ylabel="largest distance of motions\nthat begin two roundings apart, m or m/s",
        title="how far ahead double precision can see: an error is for sale until its line is crossed",
    )
    axes.legend(fontsize=8, loc="lower right")
    save(figure, path, DPI)


@canvas.style(GRID)
def stability(arm: Arm, limits: Sequence[Limit], path: Path) -> None:
    """Spectral radius of the sampled loop of an arm against the period, by delay, and growth in the simulation."""
    figure, axes = canvas.subplots(figsize=(7.5, 4.0))
    finite = [limit for limit in limits if math.isfinite(limit.period)]
    last = 1.3 * max((limit.period for limit in finite), default=FIRST_S)
    periods, simulated = np.linspace(last / 300.0, last, 300), []
    for limit, shade in zip(finite, ("#0072b2", "#d55e00"), strict=False):
        text = f"delay of {limit.delay} periods: stable to {1e3 * limit.period:.4g} ms"
        axes.plot(1e3 * periods, spectral_radius(arm, periods, limit.delay), color=shade, label=text)
        axes.plot([1e3 * limit.period], [1.0], "o", color=shade)
        simulated += [*limit.checks, *((h, simulated_growth(arm, h, limit.delay, 800)) for h in periods[30::45])]
    axes.plot([1e3 * h for h, _ in simulated], [growth for _, growth in simulated], "x", color="black",
              label="simulated")
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(
        xlabel="control period, ms", ylabel="growth per period: spectral radius",
        title="the sampled loop of a free arm: below 1 it is stable",
    )
    axes.legend(fontsize=8)
    save(figure, path, DPI)

"""Pictures of maps and samples."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros.maps.plan import Axis, Plan
from grasp_ros.scene.effects.base import UNITS, ending_of
from grasp_ros.simulation import canvas
from grasp_ros.simulation.canvas import Axes, LogNorm, Normalize, colormaps
from grasp_ros.simulation.plots import save

BINS, FEWEST_BINS, RUNS_IN_A_BIN = 60, 10, 10
SCATTERED, DOT, MOST_COLUMNS = 20_000, 2.0, 4
LETTERS = 40  # in a line below a narrow axis
COLORS = "viridis"
MISSING = "#c8c8c8"  # what was refused, stopped, or never settles
LOG_FROM = 1e3  # ratio of values from which on colours are those of their logarithms


@canvas.style()
def draw(data: Any, plan: Plan, outcome: str, path: Path) -> None:
    """Draw one outcome: a heat map over two axes, a curve over one, a histogram and scatter of a sample."""
    values = np.asarray(data[outcome].values)
    label = canvas.label(outcome, data[outcome].attrs["units"])
    if plan.sample:
        _sample(data, plan, values, label, path)
        return
    figure, axes = canvas.subplots(figsize=(8.0, 6.0))
    figure.suptitle(plan.scene.title, fontsize="medium")
    if len(plan.axes) == 1:
        x = plan.axes[0]
        missing = x.values[~np.isfinite(values)]
        axes.plot(x.values, values, ".", markersize=_dot(len(values)))
        axes.plot(missing, np.zeros(len(missing)), "|", color=MISSING, transform=axes.get_xaxis_transform())
        axes.set(xlabel=label_of(x.name), xscale=_scale(x), ylabel=label, xlim=edges(x)[[0, -1]])
        _say_if_none(axes, values)
    else:
        heat(axes, plan, values, label)
    save(figure, path)


def _say_if_none(axes: Axes, values: np.ndarray) -> None:
    if not np.isfinite(values).any():
        axes.text(0.5, 0.5, "no finite value", transform=axes.transAxes, ha="center")


def heat(axes: Axes, plan: Plan, values: np.ndarray, label: str) -> None:
    """A heat map over two axes: one pixel for each run."""
    shown = np.ma.masked_invalid(values)
    colors = colormaps[COLORS].with_extremes(bad=MISSING)
    y, x = plan.axes
    far = shown.count() and shown.min() > 0.0 and shown.max() > LOG_FROM * shown.min()
    norm = LogNorm() if far else Normalize()
    mesh = axes.pcolormesh(edges(x), edges(y), shown, cmap=colors, norm=norm, rasterized=True)
    if shown.count():
        grey = "; grey: not finite" if shown.count() < shown.size else ""
        axes.figure.colorbar(mesh, ax=axes, label=label + grey)
    _say_if_none(axes, values)
    axes.set(xlabel=label_of(x.name), xscale=_scale(x), ylabel=label_of(y.name), yscale=_scale(y))


def edges(axis: Axis) -> np.ndarray:
    """Between which the pixels lie (n + 1,): halfway between the values, and as far beyond the first and the last."""
    return axis.at((np.arange(axis.points + 1) - 0.5) / (axis.points - 1))


def _dot(count: int) -> float:
    """Size of a dot: larger where there are few."""
    return max(DOT, min(4.0 * DOT, 100.0 * DOT / max(count, 1)))


def _scale(axis: Axis) -> str:
    return "log" if axis.log else "linear"


def _sample(data: Any, plan: Plan, values: np.ndarray, label: str, path: Path) -> None:
    """The histogram, and the outcome over the numbers with which it goes most."""
    finite = np.isfinite(values)
    strongest = [name for name, _ in correlations(data, plan, values)][: MOST_COLUMNS - 1]
    figure, columns = canvas.subplots(1, len(strongest) + 1, figsize=(3.6 * (len(strongest) + 1), 3.8), squeeze=False)
    figure.suptitle(f"{plan.scene.title}: {plan.sample} runs", fontsize="medium")
    first, *others = columns[0]
    first.hist(values[finite], bins=min(BINS, max(FEWEST_BINS, finite.sum() // RUNS_IN_A_BIN)), color="#0072b2")
    first.set_xlabel(textwrap.fill(label, LETTERS))
    first.set_ylabel("runs")
    _say_if_none(first, values)
    shown = np.flatnonzero(finite)[:SCATTERED]
    for axes, name in zip(others, strongest, strict=True):
        axes.plot(data[name].values[shown], values[shown], ".", markersize=_dot(len(shown)), color="#333333",
                  alpha=max(0.3, min(1.0, 30.0 / max(len(shown), 1))))
        axes.set_xlabel(textwrap.fill(label_of(name), LETTERS), fontsize="small")
        axes.set_ylabel(label, fontsize="small")
        axes.set_xscale(_scale(next(axis for axis in plan.axes if axis.name == name)))
    save(figure, path)


def label_of(name: str) -> str:
    """Keys joined by + as the label of an axis: without the endings that are their unit, and the unit."""
    keys = name.split("+")
    ending = ending_of(keys[0])
    text = " = ".join(key.removesuffix(ending) for key in keys)
    return f"{text}, {UNITS[ending]}" if ending else text


def correlations(data: Any, plan: Plan, values: np.ndarray) -> list[tuple[str, float]]:
    """Rank correlation (Spearman) of an outcome with each number of a sample, the strongest first."""
    from scipy import stats

    finite = np.isfinite(values)
    spread = finite.sum() > 1 and np.ptp(values[finite]) > 0.0
    found = [(axis.name, float(stats.spearmanr(data[axis.name].values[finite], values[finite]).statistic)
              if spread else 0.0) for axis in plan.axes]
    return sorted(found, key=lambda entry: -abs(entry[1]))

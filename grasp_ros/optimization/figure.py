"""Pictures of a design."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from grasp_ros.optimization.search import Design, DesignProblem
from grasp_ros.simulation import canvas
from grasp_ros.simulation.canvas import Figure

POINTS = 401
LOG_FROM = 20.0  # ratio of outcomes from which on their scale is logarithmic
CHOSEN = "#d55e00"


@canvas.style()
def around(problem: DesignProblem, choice: Design) -> Figure:
    """The first outcome along each free number, with the others as they were chosen; grey where a bound is broken."""
    count, name = len(problem.axes), problem.minimise[0]
    figure, row = canvas.subplots(1, count, figsize=(4.2 * count + 1.0, 3.6), squeeze=False, sharey=True)
    for axis, axes in zip(problem.axes, row[0], strict=True):
        values, found = problem.along(axis, choice.numbers, POINTS)
        good = found.excess == 0.0
        axes.plot(values, found.outcomes[name], color="0.8", linewidth=1.0)
        axes.plot(values, np.where(good, found.outcomes[name], np.nan), linewidth=1.2)
        axes.plot(choice.numbers[axis.keys[0]], choice.outcomes[name], "o", color=CHOSEN)
        axes.set_xlabel("\n".join(axis.keys), fontsize="small")
        axes.set_xscale("log" if axis.log else "linear")
    row[0][0].set_ylabel(canvas.label(name, problem.units[name]))
    figure.suptitle(problem.scene.title, fontsize="medium")
    return figure


@canvas.style()
def tradeoff(problem: DesignProblem, choices: Sequence[Design]) -> Figure:
    """Two outcomes of choices none of which is better in both."""
    figure, axes = canvas.subplots(figsize=(6.4, 4.8))
    first, second = problem.minimise
    x, y = ([own.outcomes[name] for own in choices] for name in (first, second))
    axes.plot(x, y, "o-", color=CHOSEN, drawstyle="steps-post", linewidth=0.8)
    scales = ["log" if max(values) > LOG_FROM * min(values) > 0.0 else "linear" for values in (x, y)]
    xlabel, ylabel = (canvas.label(name, problem.units[name]) for name in (first, second))
    axes.set(xlabel=xlabel, ylabel=ylabel, xscale=scales[0], yscale=scales[1])
    axes.set_title(problem.scene.title, fontsize="medium")
    axes.grid(alpha=0.3)
    return figure

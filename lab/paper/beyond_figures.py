"""Figures of what the paper could not show, and of the sweeps behind the verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator

from grasp_ros.physics.layout import Law
from grasp_ros.physics.model import penetration
from grasp_ros.scene import Scene
from grasp_ros.simulation import canvas, simulate
from grasp_ros.simulation.plots import LEFT_COLOR, OBJECT_COLOR, RIGHT_COLOR, V_COLOR, shade_contacts
from lab.paper.arms import STEPS, Damped, Stiffer
from lab.paper.beyond import MOVED, SMALLEST, Chaos, Edge, Gap, Tail
from lab.paper.compare import wholly
from lab.paper.figures import PAGE, STYLE
from lab.paper.scatter import Median

WIDE = (PAGE, 3.0)
AGAINST = "#e6e6e6"
STATED, OTHER, NEITHER = "interval as stated", "interval on the other side", "neither"
POINTS = {  # colour, mark, inside of the mark
    STATED: (LEFT_COLOR, "o", LEFT_COLOR), OTHER: (RIGHT_COLOR, "X", RIGHT_COLOR), NEITHER: ("black", "o", "white"),
}


@canvas.style(STYLE)
def gap(found: Gap) -> Drawing:
    """V and V_c of two scenes, and u' in units of -1/p."""
    figure, panels = canvas.subplots(
        2, len(found.runs), sharex="col", sharey="row", figsize=(PAGE, 3.9)
    )
    for run, (top, bottom) in zip(found.runs, panels.T, strict=True):
        level = run.energy
        top.plot(run.t, level.V_c, color="black", label="$V_c$")
        top.plot(run.t, level.V, color=V_COLOR, linestyle="--", label="$V$ as printed")
        top.set_yscale("log")
        top.set_title(run.scene.title, fontsize="small")
        _, d_l, _, d_r = penetration(run.state)
        for d, row, letter, color, dash in ((d_l, 0, "l", LEFT_COLOR, "-"), (d_r, 1, "r", RIGHT_COLOR, "--")):
            p = run.scene.system.pairs[row, Law.DISSIPATION]
            bottom.plot(run.t, p * d, color=color, linestyle=dash, label=f"$p\\,\\dot u_{letter}$")
        bottom.axhline(-1.0, color="black", linewidth=0.8, label="-1: second half of (10)")
        bottom.set(ylim=(-1.6, 0.6), xlabel="time, s")
        for axes in (top, bottom):
            shade_contacts(axes, run)
            axes.set_xlim(0.0, run.t[-1])
    panels[0, 0].set_ylabel("twice the energy, J")
    panels[1, 0].set_ylabel("$p\\,\\dot u$")
    panels[0, -1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    panels[1, -1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


@canvas.style(STYLE)
def tail(found: Tail) -> Drawing:
    """V_c beside its law, and the number of contacts."""
    figure, (left, right) = canvas.subplots(1, 2, figsize=WIDE)
    left.loglog(found.t, found.V_c, color="black", label="$V_c$ of No. 1")
    later = found.law < found.V_c[0]
    left.loglog(found.t[later], found.law[later], color=RIGHT_COLOR, linestyle="--",
                label=r"$\frac{4}{5} H (\kappa t)^{-5/2}$")
    left.set_ylabel("twice the energy, J")
    right.loglog(found.t, np.maximum(found.contacts, 1.0), color="black", label="touches so far")
    end = found.t > found.t[-1] / 100.0
    scale = found.contacts[-1] / found.t[-1] ** 0.75
    right.loglog(found.t[end], scale * found.t[end] ** 0.75, color=RIGHT_COLOR, linestyle="--", label="$t^{3/4}$")
    right.set_ylabel("touches")
    for axes in (left, right):
        axes.set_xlabel("time, s")
        axes.legend(frameon=False, loc="lower left" if axes is left else "upper left")
    return figure


@canvas.style(STYLE)
def chaos(found: Chaos) -> Drawing:
    """Growth of a perturbation, and the logarithm of the stretching behind the exponent."""
    figure, (left, right) = canvas.subplots(1, 2, figsize=WIDE)
    t, distance = found.apart
    left.semilogy(t, distance, color="black", linewidth=0.8)
    left.set(xlabel="time, s", ylabel=r"distance of two motions, in $\sqrt{V(0)}$")
    right.plot(found.t, found.growth, color="black", label="two motions, scaled back")
    right.plot(
        found.t, found.exponent * found.t, color=RIGHT_COLOR, linestyle="--", label=f"{found.exponent:.3f} t / s"
    )
    right.set(xlabel="time, s", ylabel="sum of log stretching")
    right.legend(frameon=False, loc="upper left")
    return figure


@canvas.style(STYLE)
def stiffer(rows: Sequence[Stiffer]) -> Drawing:
    """Settling time over the stiffness, and what makes it."""
    figure, panels = canvas.subplots(2, 2, sharex=True, figsize=(PAGE, 4.2))
    k = [row.k for row in rows]
    _bars(panels[0, 0], k, [row.settling for row in rows], "o-", "black", "with the object")
    _bars(panels[0, 0], k, [row.alone for row in rows], "s--", LEFT_COLOR, "arms alone")
    panels[0, 0].legend(frameon=False, loc="upper left")
    for axes, values, label in (
        (panels[0, 0], None, "settling time, s"),
        (panels[0, 1], [row.rate for row in rows], "touches per s"),
        (panels[1, 0], [row.speed for row in rows], "speed of approach, m/s (rms)"),
        (panels[1, 1], [100.0 * row.share for row in rows], "lost to impacts, %"),
    ):
        if values is not None:
            axes.plot(k, values, "o-", color="black")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        axes.set_xscale("log")
    for axes in panels[1]:
        axes.set_xlabel("stiffness k of both arms, N/m")
    return figure


@canvas.style(STYLE)
def damped(rows: Sequence[Damped]) -> Drawing:
    """Settling times with and without the object, over the damping of the arms."""
    figure, axes = canvas.subplots(figsize=(0.75 * PAGE, 3.0))
    lossy = [row for row in rows if row.C > 0.0]
    C = [row.C for row in lossy]
    _bars(axes, C, [row.together for row in lossy], "o-", "black", "with the object")
    _bars(axes, C, [row.alone for row in lossy], "s--", LEFT_COLOR, "arms alone")
    axes.set(xscale="log", yscale="log")
    for row in rows:
        if row.C == 0.0 and np.isfinite(row.together.middle):
            axes.axhline(
                row.together.middle, color=OBJECT_COLOR, linewidth=0.8, linestyle=":",
                label="with the object, C = 0",
            )
    axes.set(xlabel="damping C = c + Kv of both arms, N s/m", ylabel="settling time, s")
    axes.legend(frameon=False)
    return figure


@canvas.style(STYLE)
def stepped(cases: Mapping[int, Scene], numbers: Sequence[int] = (1, 2)) -> Drawing:
    """The paper's own method at plausible steps beside the exact motion: the object, and V_c."""
    figure, panels = canvas.subplots(2, len(numbers), sharex=True, figsize=(PAGE, 4.0))
    for number, (top, bottom) in zip(numbers, panels.T, strict=True):
        scene = cases[number]
        runs = [("exact", "black", "-", 2.2, simulate(scene))]
        runs += [
            (f"paper's method, {1e3 * step:g} ms", color, dash, 0.8, simulate(scene, method="paper", setting=step))
            for step, color, dash in zip(STEPS, (LEFT_COLOR, RIGHT_COLOR), ("-", "--"), strict=True)
        ]
        for label, color, dash, width, run in runs:
            pale = 0.3 if width > 1.0 else 1.0  # the exact one broad and pale below, so that both are seen
            top.plot(run.t, run.state[:, 2], dash, color=color, linewidth=width, alpha=pale, label=label)
            bottom.plot(run.t, run.energy.V_c, dash, color=color, linewidth=width, alpha=pale)
        top.set_title(scene.title, fontsize="small")
        if number != 2:
            bottom.set_yscale("log")
        bottom.set_xlabel("time, s")
        for axes in (top, bottom):
            axes.set_xlim(0.0, scene.duration)
    panels[0, 0].set_ylabel("$x_o$, m")
    panels[1, 0].set_ylabel("$V_c$, J")
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


@canvas.style(STYLE)
def edge(rows: Sequence[Edge]) -> Drawing:
    """How an offset grows beside symmetric starts, and the settling times from there."""
    colors = ("black", RIGHT_COLOR, LEFT_COLOR, "#009e73", V_COLOR)
    figure, (left, right) = canvas.subplots(1, 2, figsize=WIDE, width_ratios=(1.5, 1.0))
    for row, color, mark in zip(rows, colors, "osD^v", strict=True):
        left.semilogy(row.t, row.apart, color=color, linewidth=0.7, label=f"No. {row.case}")
        if np.isfinite(row.settling).all():
            right.plot(range(len(MOVED)), row.settling, mark + "-", color=color, markersize=3)
    left.set(ylim=(1e-11, 2.0), xlabel="time, s", ylabel=f"asymmetry, m, from {SMALLEST:g} m")
    right.set_yscale("log")
    right.set_xticks(range(len(MOVED)), [f"{offset:g}" for offset in MOVED])
    right.set(xlabel="offset of $x_l(0)$, m", ylabel="settling time, s")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=len(rows), frameon=False)
    return figure


def _bars(axes: Axes, x: Sequence[float], medians: Sequence[Median], mark: str, color: str, label: str) -> None:
    """Medians with their intervals; an infinite bound leaves the picture."""
    middle = np.array([found.middle for found in medians])
    ends = [[found.middle - found.low, found.high - found.middle] for found in medians]
    axes.errorbar(x, middle, np.nan_to_num(np.transpose(ends), posinf=1e9), fmt=mark, color=color, label=label,
                  markersize=2.5, capsize=2.0, elinewidth=0.8)


class Curve(NamedTuple):
    """One sweep: the ratio of a measure to that of the standard case."""

    title: str
    label: str  # of the parameter
    measure: str
    printed: float  # value of the paper's case
    higher: bool
    points: Sequence[tuple[float, Median]]


@canvas.style(STYLE)
def sweeps(curves: Sequence[Curve]) -> Drawing:
    """Ratios over parameters, with the side on which the statement says that they are."""
    rows = -(-len(curves) // 3)
    figure, panels = canvas.subplots(rows, 3, figsize=(PAGE, 1.75 * rows))
    for axes, each in zip(panels.ravel(), curves, strict=False):
        _sweep(axes, each)
    for axes in panels.ravel()[len(curves) :]:
        axes.set_axis_off()
    handles: list[Artist] = [
        Line2D([], [], color=color, marker=mark, markersize=5, markerfacecolor=face, label=label)
        for label, (color, mark, face) in POINTS.items()
    ]
    handles.append(Patch(color=AGAINST, label="not as stated"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure


def _sweep(axes: Axes, each: Curve) -> None:
    x, found = zip(*each.points, strict=True)
    y = [point.middle for point in found]
    axes.axhspan(*((1e-9, 1.0) if each.higher else (1.0, 1e9)), color=AGAINST, linewidth=0)
    axes.axhline(1.0, color="black", linewidth=0.7)
    axes.axvline(each.printed, color="black", linewidth=0.7, linestyle=":")
    finite = np.clip(y, 1e-3, 1e3)
    axes.loglog(x, finite, "-", color="black", linewidth=0.6)
    for value, point in each.points:
        side = STATED if wholly(point, each.higher) else OTHER if wholly(point, not each.higher) else NEITHER
        color, mark, face = POINTS[side]
        middle, low, high = np.clip([point.middle, point.low, point.high], 1e-3, 1e3)
        axes.errorbar(value, middle, [[middle - low], [high - middle]], fmt=mark, color=color, markersize=4.5,
                      markerfacecolor=face, capsize=3.0, elinewidth=1.3, capthick=1.3, zorder=3)
    axes.set_ylim(min(0.8 * finite.min(), 0.5), max(1.25 * finite.max(), 2.0))
    axes.set_title(each.title, fontsize="small", loc="left")
    axes.set(xlabel=each.label, ylabel=each.measure)
    wide = finite.max() / finite.min() > 100.0 or max(x) / min(x) > 100.0
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if max(x) / min(x) > 50.0 else (1.0, 2.0, 5.0)))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0,) if wide and finite.max() > 50.0 else (1.0, 2.0, 5.0)))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.minorticks_off()
    axes.grid(visible=False)

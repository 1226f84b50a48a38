"""The figures of the study: the paper's eleven, large and on one sheet, and those of what it lacks."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from grasp_ros.observe.observer import watch
from grasp_ros.observe.record import Seen, Wanted
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation import Trajectory, canvas, plots, simulate
from grasp_ros.simulation.chunk import SETTLED
from grasp_ros.simulation.losses import Losses, losses
from grasp_ros.simulation.plots import LEFT_COLOR, OBJECT_COLOR, RIGHT_COLOR, legend_beside, shade_contacts
from grasp_ros.simulation.quantities import contact_intervals, settling_times
from grasp_ros.simulation.repeat import integrator_of
from lab.paper.cases import FIGURES, STANDARD, Cases, Figure, start_of, started
from lab.paper.prints import PAPER_DISPLACEMENT, PAPER_INPUT

CAUSES = (("dampers", "#56b4e9"), ("feedback", "#e69f00"), ("impacts", "#009e73"), ("friction", "#999999"))
TAKEN = [int(cause) for cause in (Seen.DAMPERS, Seen.FEEDBACK, Seen.IMPACTS, Seen.FRICTION)]  # as in `Losses`
PALE = 0.35  # of the standard case behind a changed one
CONTACT_POINTS = 400
IN_CONTACT = 60  # output times in each contact, so that no peak is cut
PAGE = 170.0 / 25.4  # in, the width of a page in print
STYLE = {  # letters and lines there
    "font.size": 7.0, "axes.titlepad": 3.0, "axes.labelpad": 2.0, "axes.linewidth": 0.6, "lines.linewidth": 0.9,
    "axes.grid": True, "grid.alpha": 0.25,
}


def _fine(scene: Scene) -> Trajectory:
    """A motion at the scene's output times and at many in every contact."""
    run = simulate(scene)
    spans = np.concatenate([contact_intervals(run, side) for side in SIDES]).tolist()
    inside = [np.linspace(begin, end, IN_CONTACT) for begin, end in spans]
    return simulate(scene, grid=np.unique(np.concatenate([run.t, *inside])))


@canvas.style(STYLE)
def sheet(cases: Cases) -> Drawing:
    """All eleven in the layout of the paper: displacements above, inputs below."""
    figure: Drawing = canvas.figure(figsize=(PAGE, 8.9), layout="constrained")
    cells: Any = figure.subfigures(4, 3, wspace=0.02, hspace=0.02)
    cells = cells.ravel()
    for cell, each in zip(cells, FIGURES, strict=False):
        top, bottom = cell.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        run = _fine(cases[each.case])
        _on_its_axis(plots.displacements, top, run)
        _on_its_axis(plots.inputs, bottom, run)
        for axes in (top, bottom):
            shade_contacts(axes, run)
            axes.set_xlim(0.0, run.scene.duration)
        top.set_title(_math(f"Fig. {each.number}  {each.change or 'standard'}"), fontsize="small", loc="left")
        top.set_ylabel("displacement, m")
        bottom.set(ylabel="input, N", xlabel="time, s")
    for cell in cells[len(FIGURES) :]:
        _key(cell.subplots())
    return figure


def _on_its_axis(draw: Callable[[Axes, Trajectory], None], axes: Axes, run: Trajectory) -> None:
    """Draw a panel, displacements and inputs on the paper's axis, which is widened where a motion leaves it."""
    draw(axes, run)
    for line in axes.lines:  # in the paper's letters
        name = str(line.get_label()).replace("input", "f").replace("impact", "fw")
        line.set_label(re.sub(r"(-?\w+)_(\w)\w*", r"$\1_\2$", name))
    found = {plots.displacements: (PAPER_DISPLACEMENT, run.state[:, 0::2]), plots.inputs: (PAPER_INPUT, run.command)}
    if draw not in found:
        return
    edges, values = found[draw]
    low, high = min(edges[0], 1.05 * values.min()), max(edges[1], 1.05 * values.max())
    axes.set_ylim(low, high)
    if draw is plots.inputs and any(low <= 2.0 * edge <= high for edge in edges):  # it goes on beyond the paper's axis
        for edge in edges:
            axes.axhline(edge, color="black", linewidth=0.6, linestyle=":")
        axes.text(0.99, edges[0], "the paper's axis ends", transform=axes.get_yaxis_transform(), ha="right", va="top",
                  fontsize="x-small")


def _key(axes: Axes) -> None:
    """The legend of the sheet, in the cell that is left."""
    for label, color in (
        ("$x_l$, $f_l$, left contact", LEFT_COLOR),
        ("$x_o$", OBJECT_COLOR),
        ("$x_r$, $f_r$, right contact", RIGHT_COLOR),
    ):
        axes.plot([], [], color=color, label=label)
    axes.legend(loc="center", frameon=False)
    axes.set_axis_off()


@canvas.style(STYLE)
def large(each: Figure, cases: Cases) -> Drawing:
    """One case: the paper's two panels, and below them what it does not draw; one contact and the losses beside.

    The standard case from the same start is pale behind it.
    """
    own = _fine(cases[each.case])
    beside = None if each.case == STANDARD else simulate(started(cases[STANDARD], start_of(own.scene)))
    figure: Drawing = canvas.figure(figsize=(PAGE, 6.9), layout="constrained")
    halves: Any = figure.subfigures(1, 2, width_ratios=(3.1, 1.0))
    wide, narrow = halves
    left = wide.subplots(5, 1, sharex=True, height_ratios=(3, 2, 2, 2, 2))
    for axes, panel in zip(left, plots.PANELS.values(), strict=False):
        draw = partial(_on_its_axis, panel.draw)
        if beside is not None:
            _behind(axes, draw, beside)
        draw(axes, own)
        axes.set_ylabel(panel.label)
    _losses(left[4], own)
    for run, alpha, label in ((own, 1.0, f"settled, {SETTLED:.0%}"), (beside, PALE, "_")):
        if run is not None and (settled := float(settling_times(run).max())) <= run.scene.duration:
            left[0].axvline(settled, color="black", linestyle="-.", alpha=alpha, label=label)
    for axes in left:
        shade_contacts(axes, own)
        axes.set_xlim(0.0, own.scene.duration)
        legend_beside(axes)
    left[-1].set_xlabel("time, s")
    if beside is not None:
        left[0].set_title("pale: No. 1 from the same start", fontsize="small", loc="right")
    left[0].set_title(_math(each.title), fontsize="medium", loc="left")
    force, depth, bars = narrow.subplots(3, 1)
    _one_contact((force, depth), own)
    _bars(bars, own)
    wide.align_ylabels(left)
    return figure


def _math(text: str) -> str:
    """Letters with an index as formulas."""
    return re.sub(r"\b([A-Za-z]+)_([lro])\b", r"$\1_\2$", text)


def _behind(axes: Axes, draw: Callable[[Axes, Trajectory], None], run: Trajectory) -> None:
    """Draw another run pale and without labels."""
    before = len(axes.lines)
    draw(axes, run)
    for line in axes.lines[before:]:
        line.set(alpha=PALE, linewidth=0.8, label="_")


def running_losses(run: Trajectory) -> tuple[Array, Losses]:
    """Energy lost so far by each cause under continuous feedback: times (n,) in s, and arrays (n,) in J.

    The times are those of outputs and events, and the run's begin and end.
    """
    times = np.unique(np.concatenate([run.t, run.event_table[:, 0], [0.0, run.scene.duration]]))
    integrator = integrator_of(run)
    run_observer = watch(integrator, Wanted.LOSSES, SETTLED)
    lost = np.zeros((len(TAKEN), len(times)))
    for k, length in enumerate(np.diff(times).tolist(), 1):
        integrator.advance(length)
        lost[:, k] = run_observer.seen[TAKEN]
    return times, Losses(*lost)


def _losses(axes: Axes, run: Trajectory) -> None:
    """Energy lost so far by each cause, one above the other, in percent of V_c(0)."""
    t, lost = running_losses(run)
    whole = 0.5 * float(run.energy.V_c[0])
    shown = [
        (name, color, getattr(lost, name) / whole * 100.0) for name, color in CAUSES if getattr(lost, name)[-1] > 0.0
    ]
    if shown:
        names, colors, values = zip(*shown, strict=True)
        axes.stackplot(t, *values, labels=names, colors=colors, alpha=0.85, linewidth=0)
    else:
        axes.text(0.5, 0.5, "nothing is lost", ha="center", va="center", transform=axes.transAxes)
    axes.set(ylim=(0.0, 105.0), ylabel="lost, % of $V_c(0)$")


def _one_contact(panels: Sequence[Axes], run: Trajectory) -> None:
    """The contact with the fastest approach, from the dense output: force over time, and over the deformation."""
    span = _hardest(run)
    if span is None:
        for axes in panels:
            axes.set_axis_off()
        return
    margin = 0.15 * (span[1] - span[0])
    grid = np.linspace(max(span[0] - margin, 0.0), min(span[1] + margin, run.scene.duration), CONTACT_POINTS)
    fine = simulate(run.scene, grid=grid)
    force, depth = fine.impacts, fine.state[:, [0, 2]] - fine.state[:, [2, 4]]
    for side, color in enumerate((LEFT_COLOR, RIGHT_COLOR)):
        style = "-" if side == 0 else "--"  # of a symmetric case both are seen
        panels[0].plot((fine.t - span[0]) * 1e3, force[:, side], color=color, linestyle=style)
        pressed = depth[:, side] > 0.0
        panels[1].plot(depth[pressed, side] * 1e3, force[pressed, side], color=color, linestyle=style)
    panels[0].set(xlabel=f"ms after {span[0]:.3f} s", ylabel="impact force, N")
    panels[0].set_title("one contact", fontsize="small")
    panels[1].set(xlabel="deformation u, mm", ylabel="impact force, N")


def _hardest(run: Trajectory) -> tuple[float, float] | None:
    """Begin and end of the contact, of either side, with the fastest approach."""
    table = run.event_table[run.event_table[:, 2] == 0]
    if not len(table):
        return None
    time, side = table[int(np.argmax(table[:, 4])), :2]
    spans = contact_intervals(run, [*SIDES][int(side)])
    begin, end = spans[int(np.argmin(np.abs(spans[:, 0] - time)))].tolist()
    return begin, end


def _bars(axes: Axes, run: Trajectory) -> None:
    """What the energy was lost to, in percent of what was lost."""
    lost = losses(run)
    whole = float(lost.total) or 1.0
    shown = [(name, color, 100.0 * float(getattr(lost, name)) / whole) for name, color in CAUSES]
    shown = [each for each in shown if each[2] > 1e-6]
    axes.set_title("% of what was lost", fontsize="small")
    axes.grid(visible=False)
    if not shown:
        axes.text(0.5, 0.5, "nothing is lost", ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    shown.reverse()
    bars = axes.barh(
        [name for name, _, _ in shown], [part for _, _, part in shown], color=[color for _, color, _ in shown]
    )
    axes.bar_label(bars, fmt="%.1f", padding=2, fontsize="small")
    axes.set_xlim(0.0, 135.0)
    axes.set_xticks([0, 50, 100])

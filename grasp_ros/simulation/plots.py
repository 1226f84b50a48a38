"""Figures in the layout of the paper: displacements and inputs, below them impact forces and V, contacts shaded."""

from __future__ import annotations

import os
import textwrap
from base64 import b64encode
from collections.abc import Callable, Sequence
from contextlib import suppress
from html import escape
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.energy import PLANT_ALONE
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import ascending, instance, names, number, rows
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import BODIES, COLUMN, NAMES
from grasp_ros.scene.files import format_of, replacing
from grasp_ros.simulation import canvas
from grasp_ros.simulation.canvas import Axes, Figure
from grasp_ros.simulation.quantities import contact_intervals
from grasp_ros.simulation.tables import A_MOTION, Motion
from grasp_ros.simulation.trajectory import Trajectory

LEFT_COLOR, OBJECT_COLOR, RIGHT_COLOR = "#0072b2", "#333333", "#d55e00"  # distinguishable for colour-blind readers
COLORS: dict[int, str] = {LEFT: LEFT_COLOR, OBJECT: OBJECT_COLOR, RIGHT: RIGHT_COLOR}
V_COLOR = "#cc79a7"
LONGEST_TITLE = 200  # characters
WIDTH_MM = 230.0  # of a figure with one motion
NARROWEST_MM, WIDEST_MM = 60.0, 1000.0
MM = 25.4
SHARE, LEAST_SHARE = 10, 4  # of all panels together, and of the lowest figure
ONE_COLUMN_MM = 130.0  # narrower motions get smaller letters
LETTERS, SMALL_LETTERS = 9.0, 6.5  # pt


class Panel(NamedTuple):
    """One row of a figure."""

    draw: Callable[[Axes, Motion], None]
    label: str  # of the axis
    share: int  # of the height
    shown: Callable[[Motion], object] = bool  # falsy where there is nothing to draw


def draw(
    motions: Motion | Sequence[Motion], path: str | os.PathLike[str], captions: str | Sequence[str] | None = None, *,
    width_mm: float | None = None, span: tuple[float, float] | None = None,
) -> None:
    """Draw a motion, or several side by side with common axes, into an image file.

    Parameters
    ----------
    motions : Motion, or sequence of Motion
    path : Path or str
        The ending decides the format.
    captions : str, or sequence of str, optional
        Second lines of the titles. Default: the feedback of the scenes, in words, and why a run stopped.
    width_mm : float, optional
        Default: 230 mm, or 150 mm for each of several motions.
    span : (float, float), s, optional
        First and last time. Default: the whole motions.

    Raises
    ------
    Refused
        If a motion is empty, the width or the span is not allowed, matplotlib does not know the format, or the file
        cannot be written.
    """
    several = motions if isinstance(motions, Sequence) else [motions]
    save(compose(several, captions, width_mm=width_mm, span=span), path)


def compose(
    motions: Sequence[Motion], captions: str | Sequence[str] | None = None, *, width_mm: float | None = None,
    span: tuple[float, float] | None = None, panels: Sequence[Panel] | None = None,
) -> Figure:
    """The figure that `draw` writes; its panels are by default those of PANELS that are not empty."""
    for motion in motions:
        if not len(instance("motion", motion, Motion, A_MOTION).t) or motion.t[0] == motion.t[-1]:
            raise Refused("nothing to draw: the motion has fewer than two output times")
    captions = names("captions", [*map(_caption, motions)] if captions is None else captions)
    if not 0 < len(motions) == len(captions):
        raise Refused(f"captions: {len(captions)} for {len(motions)} motions; allowed: motions, a caption each")
    span = shown(motions, span)
    usual = WIDTH_MM if len(motions) == 1 else 150.0 * len(motions)
    width = usual if width_mm is None else number("width_mm", width_mm)
    if width_mm is not None and not NARROWEST_MM <= width <= WIDEST_MM:
        raise Refused(f"width_mm: {width!r} is not allowed; allowed: {NARROWEST_MM:g} to {WIDEST_MM:g} mm")
    column_mm = width / len(motions)
    small = column_mm < ONE_COLUMN_MM
    size = SMALL_LETTERS if small else LETTERS
    letters = int(0.8 * column_mm / (size * 0.2))  # in a line that does not reach a neighbour's; one is 0.2 mm/pt wide
    asked = PANELS.values() if panels is None else panels
    panels = [panel for panel in asked if any(map(panel.shown, motions))]
    if not panels:
        raise Refused("nothing to draw: no force acts in these panels")
    shares = [panel.share for panel in panels]
    height = (0.6 if small else 0.9) * WIDTH_MM * max(sum(shares), LEAST_SHARE) / SHARE
    with canvas.style({"font.size": size}):
        figure, grid = canvas.subplots(
            len(panels), len(motions), sharex="col", sharey="row", squeeze=False, height_ratios=shares,
            figsize=(width / MM, height / MM),
        )
        for column, (motion, caption) in enumerate(zip(motions, captions, strict=True)):
            title = textwrap.shorten(motion.scene.title, LONGEST_TITLE, placeholder=" ...")
            title = "\n".join(textwrap.fill(text, letters) for text in (title, caption))
            grid[0, column].set_title(title, fontsize="medium", parse_math=False)  # a $ of a title is a $
            for panel, axes in zip(panels, grid[:, column], strict=True):
                axes.set_xlim(*(motion.t[[0, -1]] if span is None else span))
                panel.draw(axes, motion)
                shade_contacts(axes, motion)
                axes.grid(alpha=0.3)
                if column == 0:
                    axes.set_ylabel(panel.label)
            grid[-1, column].set_xlabel("time, s")
        for row in grid:
            legend_beside(*row)
        figure.align_ylabels(grid[:, 0])
        figure.canvas.draw()  # the layout, with the letters of this context
        return figure


def _sampled(motion: Motion) -> bool:
    """Whether commands are held, as in every recording."""
    return getattr(motion, "sampled", True)


def _caption(motion: Motion) -> str:
    """How the arms are controlled and, of a run that stopped, why it did."""
    words, status = motion.scene.feedback_in_words(_sampled(motion)), getattr(motion, "status", Status.DONE)
    return words if status is Status.DONE else f"{words}; {status.value}"


def end_of(motion: Motion) -> float:
    """The end of its scene in s, or of a recording whose time goes on behind a reset."""
    return float(max(motion.scene.duration, *motion.t[-1:]))


def shown(motions: Sequence[Motion], span: tuple[float, float] | None) -> tuple[float, float] | None:
    """The first and the last time in s that are wanted, where some motion is; None: all."""
    if span is None:
        return None
    first, last = ascending("span", rows("span", span, 2), max(map(end_of, motions)), strictly=True).tolist()
    if not any(motion.t[0] < last and first < motion.t[-1] for motion in motions):
        begin, end = min(motion.t[0] for motion in motions), max(motion.t[-1] for motion in motions)
        raise Refused(f"nothing to draw from {first:g} to {last:g} s: the motion is from {begin:g} to {end:g} s")
    return first, last


def legend_beside(*row: Axes) -> None:
    """A legend of all axes in a row, to the right of them, where it hides nothing."""
    every = [own.get_legend_handles_labels() for own in row]
    lines = {label: line for own in every for line, label in zip(*own, strict=True)}
    if lines:
        row[-1].legend(lines.values(), lines.keys(), loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0,
                       fontsize="small", frameon=False)


def plot(axes: Axes, motion: Motion, values: Array, **style: Any) -> None:
    """Plot values (n,) over time, up to one output time beyond the limits of the time axis, so that y fits the rest."""
    first, last = (-np.inf, np.inf) if axes.get_autoscalex_on() else axes.get_xlim()
    begin, end = max(int(np.searchsorted(motion.t, first, "right")) - 1, 0), int(np.searchsorted(motion.t, last)) + 1
    if motion.t[-1] < first or last < motion.t[0]:  # it has ended before, say, beside a longer one
        end = begin
    axes.plot(motion.t[begin:end], values[begin:end], **style)


def displacements(axes: Axes, motion: Motion) -> None:
    """Positions, by their columns of the table, as all that follow."""
    for body in motion.scene.system.present:
        plot(axes, motion, motion.state[:, COLUMN[body]], label=f"x_{NAMES[body]}", color=COLORS[body], linewidth=1.2)


def driven(motion: Motion) -> list[int]:
    """Bodies on which a controller or a force from outside acts."""
    forces = np.nan_to_num(motion.inputs)  # nan: from the end on nothing acts
    return [body for body in BODIES if forces[:, body].any() or body in motion.scene.system.laws]


def inputs(axes: Axes, motion: Motion) -> None:
    """Forces of controllers and from outside; what is held from tick to tick as steps."""
    forces, style = motion.inputs, "steps-post" if _sampled(motion) else "default"
    for body in driven(motion):
        plot(axes, motion, forces[:, body], label=f"input_{NAMES[body]}", color=COLORS[body], linewidth=1.0,
             drawstyle=style)


def impacts(axes: Axes, motion: Motion) -> None:
    """Impact forces as they act on the object: of the left contact upwards, of the right one downwards."""
    for side in motion.scene.system.contacts:
        sign, text = (1.0, "") if side == LEFT else (-1.0, "-")
        plot(axes, motion, sign * motion.impacts[:, side], label=f"{text}impact_{NAMES[side]}", color=COLORS[side],
             linewidth=0.9)


def energies(axes: Axes, motion: Motion) -> None:
    """V_c, and the paper's V where it is another one; of the plant alone where nobody knows that of a controller."""
    level, known = motion.energy, motion.energy_of != PLANT_ALONE
    plot(axes, motion, level.V_c, color="black", linewidth=1.2, label="V_c" if known else f"V_c of {PLANT_ALONE}")
    if known and not np.array_equal(level.V, level.V_c, equal_nan=True):
        plot(axes, motion, level.V, color=V_COLOR, linewidth=1.0, linestyle="--", label="V of the paper")
    # One scale for all motions that share the axis: logarithmic where V_c falls far and stays above 0.
    lines = [line for own in axes.get_shared_y_axes().get_siblings(axes) for line in own.get_lines()]
    levels = np.concatenate([line.get_ydata() for line in lines if str(line.get_label()).startswith("V_c")])
    low, high = (levels.min(), levels.max()) if len(levels) else (np.nan, np.nan)
    axes.autoscale(axis="y")
    axes.set_yscale("log" if 0.0 < low < 0.3 * high else "linear")
    if low >= 0.0 and axes.get_yscale() == "linear":
        axes.set_ylim(0.0, max(axes.get_ylim()[1], 1.1 * high or 1.0))


def contact_spans(motion: Motion, side: int) -> list[tuple[float, float]]:
    """Begin and length of the contacts of one side in s: from the events, or as the output times show them."""
    if isinstance(motion, Trajectory) and METHODS[motion.method].events:
        return [(a, b - a) for a, b in contact_intervals(motion, NAMES[side]).tolist()]
    edges = np.flatnonzero(np.diff(motion.impacts[:, side] > 0.0, prepend=False, append=False))
    begins, ends = motion.t[edges.reshape(-1, 2).clip(max=len(motion.t) - 1)].T
    return [*zip(begins.tolist(), (ends - begins).tolist(), strict=True)]


def shade_contacts(axes: Axes, motion: Motion) -> None:
    """Shade the contacts of both sides over the whole height."""
    for side in (LEFT, RIGHT):
        axes.broken_barh(contact_spans(motion, side), (0.0, 1.0), transform=axes.get_xaxis_transform(),
                         color=COLORS[side], alpha=0.13, linewidth=0, zorder=0)


def save(figure: Figure, path: str | os.PathLike[str], dpi: int = 150) -> None:
    """Write a figure into a file."""
    ending = format_of(path, canvas.formats())
    with replacing(path) as file:
        write(figure, file, ending, dpi)


def write(figure: Figure, file: BinaryIO, ending: str, dpi: int = 150) -> None:
    """Write a figure into an open file."""
    try:
        with canvas.style():
            figure.savefig(file, format=ending[1:], dpi=dpi)
    except RuntimeError as error:  # a .pgf where there is no TeX
        raise Refused(f"{ending}: {error}") from None


def html_of(run: Trajectory) -> str:
    """How a run ended, and its figure if there is anything to draw."""
    found = f"<p>{escape(f'{run.scene.name}: {run.stop or run.status.value}')}</p>"
    with suppress(Refused):
        picture = BytesIO()
        write(compose([run]), picture, ".png", dpi=80)
        found += f"<img src='data:image/png;base64,{b64encode(picture.getvalue()).decode()}'>"
    return found


PANELS = {
    "displacement": Panel(displacements, "displacement, m", 3), "input": Panel(inputs, "input, N", 2, driven),
    "impact": Panel(impacts, "impact force, N", 2, lambda motion: motion.scene.system.contacts),
    "energy": Panel(energies, "twice the energy, J", 3),
}

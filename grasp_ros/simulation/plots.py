"""Figures in the layout of the paper: displacements, inputs, and below them V with the contacts."""

from __future__ import annotations

from pathlib import Path
from textwrap import shorten
from typing import Protocol

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from grasp_ros.physics.energy import PLANT_ALONE, Energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array, Mode
from grasp_ros.scene import PAPER, Scene
from grasp_ros.scene.files import replacing

LEFT_COLOR, OBJECT_COLOR, RIGHT_COLOR = "#0072b2", "#333333", "#d55e00"  # distinguishable for colour-blind readers
LONGEST_TITLE = 200  # characters
PAPER_DISPLACEMENT = (-1.0, 1.0)  # m, the axes of Figs. 2 to 12
PAPER_INPUT = (-10.0, 10.0)  # N


class Motion(Protocol):
    """What can be drawn: a trajectory or a recording."""

    @property
    def scene(self) -> Scene:
        """The scene."""

    @property
    def t(self) -> Array:
        """Times (n,) in s."""

    @property
    def state(self) -> Array:
        """States (n, 6) in m and m/s."""

    @property
    def command(self) -> Array:
        """Input forces (n, 2) in N."""

    @property
    def energy_of(self) -> str:
        """Whose energy that is."""

    @property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode."""


def draw(motion: Motion, path: Path, caption: str) -> None:
    """Draw a motion into an image file.

    Parameters
    ----------
    motion : Motion
    path : Path
        The ending decides the format.
    caption : str
        Second line of the title.

    Raises
    ------
    Refused
        If the motion is empty, matplotlib does not know the format, or the file cannot be written.
    """
    if not len(motion.t):
        raise Refused("nothing to draw: the motion has no output times")
    figure, (top, middle, bottom) = plt.subplots(
        3, 1, sharex=True, figsize=(9.0, 9.0), height_ratios=(3, 2, 3), layout="constrained"
    )
    title = shorten(motion.scene.title, LONGEST_TITLE, placeholder=" ...")
    figure.suptitle(f"{title}\n{caption}", fontsize="medium", parse_math=False)  # a $ of a title is a $
    for column, label, color in ((0, "$x_l$", LEFT_COLOR), (2, "$x_o$", OBJECT_COLOR), (4, "$x_r$", RIGHT_COLOR)):
        if not np.isnan(motion.state[:, column]).all():
            top.plot(motion.t, motion.state[:, column], label=label, color=color, linewidth=1.2)
    for side, label, color in ((LEFT, "$f_l$", LEFT_COLOR), (RIGHT, "$f_r$", RIGHT_COLOR)):
        if side in motion.scene.system.laws or motion.command[:, side].any():
            middle.plot(motion.t, motion.command[:, side], label=label, color=color, linewidth=1.0)
    top.set_ylabel("displacement, m")
    middle.set_ylabel("input, N")
    if motion.scene.values.keys() == PAPER:
        _limits(top, PAPER_DISPLACEMENT, motion.state[:, 0::2])
        _limits(middle, PAPER_INPUT, motion.command)
    _draw_energy(bottom, motion)
    bottom.set_xlabel("time, s")
    bottom.set_xlim(motion.t[0], motion.t[-1])
    for axes in (top, middle, bottom):
        axes.grid(alpha=0.3)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper right", ncols=3, fontsize="small")
    save(figure, path)


def save(figure: Figure, path: Path, dpi: int = 150) -> None:
    """Write a figure into a file, and close it.

    Raises
    ------
    Refused
        If the path has no ending, matplotlib does not know the format, or the file cannot be written.
    """
    known, ending = figure.canvas.get_supported_filetypes(), path.suffix.removeprefix(".").lower()
    try:
        if not ending:
            raise Refused(f"{path}: no ending; allowed: one of {', '.join(sorted(known))}")
        if ending not in known:
            raise Refused(f"{path}: {ending} is not allowed; allowed: {', '.join(sorted(known))}")
        with replacing(path) as file:
            figure.savefig(file, format=ending, dpi=dpi)
    except RuntimeError as error:  # a .pgf where there is no TeX
        raise Refused(f"{path}: {error}") from None
    finally:
        plt.close(figure)


def _limits(axes: Axes, paper: tuple[float, float], values: Array) -> None:
    """The paper's axes, widened where the motion leaves them."""
    axes.set_ylim(min(paper[0], 1.05 * values.min()), max(paper[1], 1.05 * values.max()))


def _draw_energy(axes: Axes, motion: Motion) -> None:
    level = motion.energy
    known = motion.energy_of != PLANT_ALONE
    axes.plot(motion.t, level.V_c, color="black", linewidth=1.2, label="$V_c$" if known else f"of {PLANT_ALONE}")
    if known:
        axes.plot(motion.t, level.V, color="#cc79a7", linewidth=1.0, linestyle="--", label="$V$ of the paper")
    if 0.0 < level.V_c.min() < 0.3 * level.V_c.max():
        axes.set_yscale("log")
    elif level.V_c.min() >= 0.0:
        axes.set_ylim(0.0, 1.3 * level.V_c.max() or 1.0)
    axes.set_ylabel("twice the energy, J")
    for flag, low, label, color in (
        (Mode.LEFT, 0.0, "left contact", LEFT_COLOR),
        (Mode.RIGHT, 0.04, "right contact", RIGHT_COLOR),
    ):
        touching = (level.mode & int(flag)) != 0
        axes.fill_between(
            motion.t, low, low + 0.04, where=touching, step="post", color=color, alpha=0.8, linewidth=0,
            transform=axes.get_xaxis_transform(), label=label,
        )

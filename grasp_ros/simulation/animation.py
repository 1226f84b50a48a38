"""A motion that moves: arms and object on their line, with springs, contacts and the recent past."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation
from matplotlib.patches import Rectangle

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene.files import format_of, replaced
from grasp_ros.simulation import canvas
from grasp_ros.simulation.canvas import Figure
from grasp_ros.simulation.plots import COLORS, MM, shown
from grasp_ros.simulation.tables import Motion

FRONTS: dict[int, float] = {LEFT: 1.5, OBJECT: 0.5, RIGHT: -0.5}  # lengths from the begin of a body to its position
FORMATS = (".gif", ".html")
RATE = 25  # pictures in a second
MOST_PICTURES = 2000
WIDTH_MM, HEIGHT_MM, DPI = 150.0, 75.0, 96
THICK = 0.06  # of a body, relative to the range of the motion
PRESSED = "#f0e442"  # an object that is touched
COILS = np.array([0.0, 0.0, *([1.0, -1.0] * 5), 0.0, 0.0])


def animate(motion: Motion, path: Path, *, speed: float = 1.0, span: tuple[float, float] | None = None,
            width_mm: float | None = None) -> None:
    """Write a motion as a moving picture: .gif, or .html with its pictures inside.

    Between its output times states are interpolated linearly. `speed` is in seconds of the motion in a second, `span`
    its first and last time in s; by default it is the whole motion, 150 mm wide.
    """
    if not len(motion.t):
        raise Refused("nothing to draw: the motion has no output times")
    if not 0.0 < speed < np.inf:
        raise Refused(f"speed: {speed!r} is not allowed; allowed: a number > 0")
    first, last = shown([motion], span) or (float(motion.t[0]), float(motion.t[-1]))
    count = int((last - first) / speed * RATE) + 1
    if count > MOST_PICTURES:
        raise Refused(f"speed: {speed!r} makes {count} pictures; allowed: at most {MOST_PICTURES}, by a higher speed"
                      " or a shorter time")
    times = np.minimum(first + np.arange(count) * speed / RATE, last)
    ending = format_of(path, FORMATS)
    with replaced(path) as part, canvas.style():
        figure, update = _stage(motion, times, WIDTH_MM if width_mm is None else width_mm)
        animation = FuncAnimation(figure, update, frames=len(times), interval=1e3 / RATE, blit=False)
        if ending == ".html":
            part.write_text(animation.to_jshtml(fps=RATE), encoding="utf-8")
        else:
            animation.save(part, writer="pillow", fps=RATE, dpi=DPI)


def _stage(motion: Motion, times: Array, width_mm: float) -> tuple[Figure, Any]:
    """The figure, and what draws its picture k."""
    positions = {body: np.interp(times, motion.t, motion.state[:, COLUMN[body]])
                 for body in motion.scene.system.present}
    first = np.searchsorted(motion.t, times, side="right").clip(1) - 1  # output time of each picture
    touched = np.logical_or.reduceat((motion.impacts > 0.0).any(axis=1), first)
    figure, (line, past) = canvas.subplots(2, 1, figsize=(width_mm / MM, width_mm / MM * HEIGHT_MM / WIDTH_MM),
                                           height_ratios=(2, 3))
    low, high = (float(pick(list(positions.values()))) for pick in (np.min, np.max))
    reach = max(high - low, 1e-12)
    line.set(xlim=(low - 0.25 * reach, high + 0.25 * reach), ylim=(-1.0, 1.0), xticks=[], yticks=[])
    for border in ("left", "right", "top"):
        line.spines[border].set_visible(False)
    bodies: dict[int, Rectangle] = {}
    coils: dict[int, Any] = {}
    for body in positions:  # they are put in their place later
        height = 1.2 if body == OBJECT else 0.8
        bodies[body] = Rectangle((0.0, -height / 2.0), THICK * reach, height, facecolor=COLORS[body], edgecolor="black")
        line.add_patch(bodies[body])
        if body != OBJECT:
            (coils[body],) = line.plot(np.zeros(len(COILS)), 0.25 * COILS, color=COLORS[body], linewidth=0.9)
    line.set_title(motion.scene.title, fontsize="small", parse_math=False)
    for body, x in positions.items():
        past.plot(times, x, color=COLORS[body], linewidth=1.0)
    past.set(xlim=(times[0], max(times[-1], times[0] + 1e-12)), xlabel="time, s", ylabel="position, m")
    past.grid(alpha=0.3)
    now = past.axvline(times[0], color="black", linewidth=0.8)

    def update(k: int) -> Sequence[Any]:
        for body, x in positions.items():
            bodies[body].set_x(x[k] - FRONTS[body] * THICK * reach)
            if body in coils:
                wall = line.get_xlim()[0 if body == LEFT else 1]
                back = x[k] - FRONTS[body] * THICK * reach + (0.0 if body == LEFT else THICK * reach)
                coils[body].set_xdata(np.linspace(wall, back, len(COILS)))
        if OBJECT in bodies:
            bodies[OBJECT].set_facecolor(PRESSED if touched[k] else COLORS[OBJECT])
        now.set_xdata([times[k], times[k]])
        return ()

    update(0)
    figure.canvas.draw()
    figure.set_layout_engine("none")  # it has its layout, which takes longer than a picture
    return figure, update

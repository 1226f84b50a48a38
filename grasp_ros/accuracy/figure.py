"""Error against time."""

from __future__ import annotations

from collections.abc import Sequence

from grasp_ros.accuracy.measure import Advice, Record, Truth, by_method
from grasp_ros.scene import Scene
from grasp_ros.simulation import canvas
from grasp_ros.simulation.canvas import Figure, colormaps

COLORS, MARKS = "tab20", "osD^v<>Pp*hX8"
CHOSEN = "#d55e00"


def error_against_time(scene: Scene, truth: Truth, records: Sequence[Record], advice: Advice | None,
                       error: float | None, budget: float | None = None) -> Figure:
    """A figure of all sound records, with the limit of what can be known, what is wanted, and the choice."""
    with canvas.style():
        figure, axes = canvas.subplots(figsize=(8.0, 5.2))
        colors = colormaps[COLORS]
        for i, (name, group) in enumerate(by_method(record for record in records if record.sound).items()):
            axes.loglog([record.error for record in group], [1e3 * record.time for record in group], label=name,
                        color=colors(i % 20), marker=MARKS[i % len(MARKS)], markersize=5, linewidth=1.0)
        axes.axvspan(axes.get_xlim()[0], truth.uncertainty, color="0.9", zorder=0)
        axes.axvline(truth.uncertainty, color="0.5", linewidth=0.8, label="not known better\nin double precision")
        if error is not None:
            axes.axvline(error, color=CHOSEN, linewidth=0.8, linestyle="--")
        if budget is not None:
            axes.axhline(1e3 * budget, color=CHOSEN, linewidth=0.8, linestyle="--")
        if advice is not None and advice.choice is not None:
            choice = advice.choice
            axes.plot(choice.error, 1e3 * choice.time, "o", markersize=13,
                      fillstyle="none", color=CHOSEN, label=f"take {choice.method}, {choice.knob} {choice.setting:g}")
        axes.set_xlabel("largest error of all states and output times, m and m/s")
        axes.set_ylabel("time of a run, ms")
        axes.set_title(scene.title, fontsize="medium", parse_math=False)
        axes.grid(alpha=0.3)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize="small", frameon=False)
    return figure

"""docs/maps.md: the three studies of `maps` with their pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from grasp_ros.maps import figures
from grasp_ros.maps.plan import Plan
from grasp_ros.scene.files import writing
from grasp_ros.simulation import canvas
from grasp_ros.simulation.plots import save
from lab.studies import maps, pages

STRONGEST = 4
SHARES_S = (10.0, 20.0, 50.0)
OUTCOMES = ("touches_left", "touches_right", "peak_input_left", "peak_input_right", "peak_impact_left",
            "peak_impact_right")
DPI = 130
STABLE, UNSTABLE, FREE = "#fff5e8", "#e8853a", "#004a75"
LIMIT = 2.0  # pt, of the line
GAIN, LOSS = "Kp of both arms, N/m", "p of both contacts, s/m"


def run(docs: Path | None, directory: Path, quick: bool) -> None:
    """Compute what is not there yet, and write the page with its pictures."""
    docs = docs or directory
    folder = docs / "maps"
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        directory.mkdir(parents=True, exist_ok=True)
    settled = maps.settling(directory, 24 if quick else maps.PIXELS)
    limits = maps.limits(*((6, 5) if quick else ()))
    plan, data, seconds = maps.robustness(directory, 64 if quick else maps.SAMPLE)
    _draw_settling(settled, folder / "settling.png")
    _draw_limits(limits, folder / "limits.png")
    figures.draw(data, plan, "settling_time", folder / "robustness.png")
    pages.write(docs, "maps", maps=maps, found=settled, map=_map(settled), loops=limits.loops, plan=plan,
                sample=_sample(plan, data), seconds=seconds)


def _map(found: maps.Settling) -> dict[str, Any]:
    """How much of the map settles by when."""
    times = found.data["settling_time"].values
    quarter = len(times) // 4
    gain, finer = (plan.axes[1].values for plan in (found.plan, found.zoom))
    return {
        "pixels": times.size, "settled": np.isfinite(times).mean(),
        "shares": [((times <= limit).mean(), limit) for limit in SHARES_S],
        "least": np.isfinite(times[:quarter]).mean(), "most": np.isfinite(times[-quarter:]).mean(),
        "finer": np.diff(gain[:2])[0] / np.diff(finer[:2])[0],
    }


def _sample(plan: Plan, data: Any) -> dict[str, Any]:
    """How many grasps settle, when, and by which numbers."""
    values = data["settling_time"].values
    settling, rows = values[np.isfinite(values)], []
    for name in OUTCOMES:
        column = data[name]
        found = np.quantile(column.values[np.isfinite(column.values)], (0.0, 0.05, 0.5, 0.95, 1.0))
        rows.append((canvas.label(name, column.attrs["units"]), *(f"{number:.4g}" for number in found)))
    return {
        "done": int((data["status"].values == 0).sum()), "settled": len(settling) / len(values),
        "times": np.quantile(settling, (0.05, 0.5, 0.95, 1.0)),
        "strong": figures.correlations(data, plan, values)[:STRONGEST], "rows": rows,
    }


@canvas.style()
def _draw_settling(found: maps.Settling, path: Path) -> None:
    """The map, and a window of it, whose place the map shows."""
    figure, both = canvas.subplots(1, 2, figsize=(13.0, 5.6))
    title = f"case 3: seconds until it has settled for good; grey: not within {found.within:g} s"
    figure.suptitle(title, fontsize="medium")
    for axes, plan, data in zip(both, (found.plan, found.zoom), (found.data, found.zoomed), strict=True):
        figures.heat(axes, plan, data["settling_time"].values, "settling time, s")
        axes.set(xlabel=GAIN, ylabel=LOSS)
    y, x = found.zoom.axes
    both[0].add_patch(Rectangle((x.low, y.low), x.high - x.low, y.high - y.low, fill=False, color="#d55e00"))
    both[1].set_title("the window in which neighbours differ most", fontsize="small")
    save(figure, path, DPI)


@canvas.style()
def _draw_limits(found: maps.Limits, path: Path) -> None:
    """Unstable runs of the four loops over period and gain, with the exact limit of a free arm."""
    colors = ListedColormap([STABLE, UNSTABLE])
    figure, all_axes = canvas.subplots(2, 2, figsize=(10.0, 7.5), sharex=True, sharey=True)
    for axes, loop in zip(all_axes.flat, found.loops, strict=True):
        axes.pcolormesh(1e3 * found.periods, found.gains, loop.unstable, cmap=colors, vmin=0, vmax=1)
        axes.contour(1e3 * found.periods, found.gains, found.radius[loop.delay], [1.0], colors=FREE, linewidths=LIMIT)
        axes.set_title(loop.name, fontsize="small")
    for axes in all_axes[-1]:
        axes.set_xlabel("control period, ms")
    for axes in all_axes[:, 0]:
        axes.set_ylabel(GAIN)
    figure.suptitle("case 1 with held commands", fontsize="medium")
    handles = [Patch(facecolor=UNSTABLE, label="unstable"), Patch(facecolor=STABLE, edgecolor="grey", label="stable"),
               Line2D([], [], color=FREE, linewidth=LIMIT, label="exact limit of a free arm")]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    save(figure, path, DPI)

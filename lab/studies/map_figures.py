"""Pictures of the studies of maps."""

from __future__ import annotations

from pathlib import Path

from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from grasp_ros.maps.figures import heat
from grasp_ros.simulation import canvas
from grasp_ros.simulation.plots import save
from lab.studies.maps import Limits, Settling

DPI = 130
STABLE, UNSTABLE, FREE = "#fff5e8", "#e8853a", "#004a75"
LIMIT = 2.0  # pt, of the line
GAIN, LOSS = "Kp of both arms, N/m", "p of both contacts, s/m"


@canvas.style()
def settling(found: Settling, path: Path) -> None:
    """The map, and a window of it, whose place the map shows."""
    figure, both = canvas.subplots(1, 2, figsize=(13.0, 5.6))
    title = f"case 3: seconds until it has settled for good; grey: not within {found.within:g} s"
    figure.suptitle(title, fontsize="medium")
    for axes, plan, data in zip(both, (found.plan, found.zoom), (found.data, found.zoomed), strict=True):
        heat(axes, plan, data["settling_time"].values, "settling time, s")
        axes.set(xlabel=GAIN, ylabel=LOSS)
    y, x = found.zoom.axes
    both[0].add_patch(Rectangle((x.low, y.low), x.high - x.low, y.high - y.low, fill=False, color="#d55e00"))
    both[1].set_title("the window in which neighbours differ most", fontsize="small")
    save(figure, path, DPI)


@canvas.style()
def limits(found: Limits, path: Path) -> None:
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

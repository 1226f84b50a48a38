"""docs/maps.md: the three studies of `maps` with their pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros.maps import figures
from grasp_ros.maps.plan import Plan
from grasp_ros.scene.files import writing
from grasp_ros.simulation import canvas
from lab.studies import map_figures, maps, pages

STRONGEST = 4
SHARES_S = (10.0, 20.0, 50.0)
OUTCOMES = ("touches_left", "touches_right", "peak_input_left", "peak_input_right", "peak_impact_left",
            "peak_impact_right")


def run(docs: Path | None, directory: Path, quick: bool) -> None:
    """Compute what is not there yet, and write the page with its pictures.

    Raises
    ------
    Refused
        If a directory cannot be written.
    """
    docs = docs or directory
    folder = docs / "maps"
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        directory.mkdir(parents=True, exist_ok=True)
    settled = maps.settling(directory, 24 if quick else maps.PIXELS)
    limits = maps.limits(*((6, 5) if quick else ()))
    plan, data, seconds = maps.robustness(directory, 64 if quick else maps.SAMPLE)
    map_figures.settling(settled, folder / "settling.png")
    map_figures.limits(limits, folder / "limits.png")
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

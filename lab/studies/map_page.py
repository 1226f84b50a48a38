"""docs/maps.md: the three studies of `maps` with their pictures, and conclusions whose numbers are computed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros.maps import figures
from grasp_ros.maps.plan import Plan
from grasp_ros.scene.files import writing
from grasp_ros.scene.versions import versions
from lab.studies import document, map_figures, maps
from lab.studies.document import prose, table

COMMAND = "python -m lab maps"
STRONGEST = 4


def write(docs: Path, directory: Path, quick: bool, pixels: int = maps.PIXELS) -> Path:
    """Compute what is not there yet, and write the page with its pictures; returns it.

    Raises
    ------
    Refused
        If a directory cannot be written.
    """
    place = docs / "maps"
    with writing(place):
        place.mkdir(parents=True, exist_ok=True)
        directory.mkdir(parents=True, exist_ok=True)
    settled = maps.settling(directory, 24 if quick else pixels)
    limits = maps.limits(*((6, 5) if quick else ()))
    plan, data, seconds = maps.robustness(directory, 64 if quick else maps.SAMPLE)
    map_figures.settling(settled, place / "settling.png")
    map_figures.limits(limits, place / "limits.png")
    figures.draw(data, plan, "settling_time", place / "robustness.png")
    page = docs / "maps.md"
    text = [_head(), _settling(settled), _limits(limits), _robustness(plan, data, seconds)]
    document.write(page, "\n\n".join(text) + "\n")
    return page


def _head() -> str:
    found = ", ".join(f"{name} {version}" for name, version in versions().items())
    return "# Maps\n\n" + prose(
        f"Written by `{COMMAND}`; every number is computed. {found}. A pixel or a row is a run of its own, whose"
        " outcomes come from closed forms and Taylor polynomials; settled means that no mass leaves the bound, a part"
        " of the largest initial displacement, any more: V_c proves it, for which a run goes on past its horizon."
        " `grasp map` does the same for any scene.")


def _settling(found: maps.Settling) -> str:
    times = found.data["settling_time"].values
    within, quarter = found.within, len(times) // 4
    least, most = np.isfinite(times[:quarter]).mean(), np.isfinite(times[-quarter:]).mean()
    shares = ", ".join(f"{100.0 * (times <= limit).mean():.1f} % within {limit:g} s" for limit in (10.0, 20.0, 50.0))
    y, x = found.zoom.axes
    finer = np.diff(found.plan.axes[1].values[:2])[0] / np.diff(x.values[:2])[0]
    text = (
        f"Case 3 has neither dampers nor velocity feedback: only impacts take energy. Of {times.size} pairs of gain"
        f" and dissipation {100.0 * np.isfinite(times).mean():.1f} % settle for good within {within:g} s to"
        f" {100.0 * maps.SETTLED:g} % of the largest initial displacement ({shares}): {100.0 * least:.1f} % in the"
        f" quarter with the least dissipation, {100.0 * most:.1f} % in that with the most. Of the pixels"
        f" {100.0 * found.jumps[0]:.1f} % have a neighbour whose time differs by more than {100.0 * maps.JUMP:g} %, and"
        f" in the window, Kp {x.low:.4g} to {x.high:.4g} N/m and p {y.low:.4g} to {y.high:.4g} s/m,"
        f" {100.0 * found.jumps[1]:.1f} %, though its pixels are {finer:.2g} times as fine in Kp:"
        f" {_smooth(found)} An accuracy of 1e-16 instead of {maps.MAP_ACCURACY:g} moves {100.0 * found.changed:.2g} %"
        f" of its pixels by as much. The {times.size} runs took {found.seconds:.0f} s on this machine.")
    head = "## When the grasp of case 3 settles"
    return f"{head}\n\n![settling time over gain and dissipation](maps/settling.png)\n\n{prose(text)}"


def _smooth(found: maps.Settling) -> str:
    """What the shares of jumps at two sizes of pixels say."""
    if found.jumps[1] > 0.5 * found.jumps[0]:
        return "there a small change of a number decides when the grasp settles, and finer pixels do not help."
    return "finer pixels resolve the jumps, the settling time is smooth between them."


def _limits(found: maps.Limits) -> str:
    rows = [(loop.name, f"{100.0 * loop.unstable.mean():.1f} %", f"{loop.shift:.3f}") for loop in found.loops]
    plain, late = found.loops[0], found.loops[1]
    text = (
        f"Case 1 with held commands, for {maps.TICKS} control periods each: unstable is a run in which a mass goes"
        f" further than {maps.GROWN:g} times the largest initial displacement. The line is the exact limit of a free"
        " arm, where the spectral radius of its loop is 1. With contacts the first unstable period lies at"
        f" {plain.shift:.2f} times that of the free arm without delay, and at {late.shift:.2f} times with one sample of"
        f" delay; noise of {1e3 * maps.NOISE['position_noise_m']:g} mm and"
        f" {1e3 * maps.NOISE['velocity_noise_m_per_s']:g} mm/s makes that {found.loops[2].shift:.2f} and"
        f" {found.loops[3].shift:.2f}. {_meaning(plain.shift, late.shift)}")
    heads = ("loop", "unstable runs", "first unstable period, over that of the free arm")
    return ("## Control period, delay and noise\n\n![unstable runs over period and gain](maps/limits.png)\n\n"
            f"{prose(text)}\n\n{table(heads, rows)}")


def _meaning(plain: float, late: float) -> str:
    """What the two ratios say."""
    if plain > 1.0 and late > 1.0:
        return "Contacts take energy that the hold brings: the limit of a free arm is on the safe side."
    return "The limit of a free arm is not on the safe side: contacts bring the loop to its limit sooner."


def _robustness(plan: Plan, data: Any, seconds: float) -> str:
    values = data["settling_time"].values
    inside = np.isfinite(values)
    done = int((data["status"].values == 0).sum())
    strong = figures.correlations(data, plan, values)[:STRONGEST]
    words = ", ".join(f"`{name}` ({rank:+.2f})" for name, rank in strong)
    within = plan.setup.horizons * plan.scene.duration
    low, middle, high = np.quantile(values[inside], (0.05, 0.5, 0.95))
    text = (
        f"{len(values)} scenes with each of the {len(plan.axes)} numbers of case 1 off by up to {100.0 * maps.OFF:g} %,"
        f" independently (a Sobol sequence): {done} runs reach their end, and {100.0 * inside.mean():.2f} % settle"
        f" within {within:g} s to {100.0 * plan.setup.settled:g} % of the largest initial displacement. Half of them"
        f" need less than {middle:.3g} s, 90 % between {low:.3g} and {high:.3g} s, and the slowest"
        f" {values[inside].max():.3g} s. The settling time goes with {words} (rank correlations). They took"
        f" {seconds:.0f} s on this machine.")
    rows = []
    for name in ("touches_left", "touches_right", "peak_input_left", "peak_input_right", "peak_impact_left",
                 "peak_impact_right"):
        column = data[name]
        found = np.quantile(column.values[np.isfinite(column.values)], (0.0, 0.05, 0.5, 0.95, 1.0))
        rows.append((f"{name.replace('_', ' ')}, {column.attrs['units']}", *(f"{number:.4g}" for number in found)))
    heads = ("outcome", "least", "5 %", "median", "95 %", "largest")
    return ("## Robustness of the standard grasp\n\n![settling time of 100,000 scenes](maps/robustness.png)\n\n"
            f"{prose(text)}\n\n{table(heads, rows)}").replace("100,000 scenes", f"{len(values)} scenes")

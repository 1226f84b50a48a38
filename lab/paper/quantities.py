"""The table of quantities: one column for each case."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics.model import penetration
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation import ensemble, simulate
from grasp_ros.simulation.losses import losses
from grasp_ros.simulation.quantities import contact_intervals, settled_distance, settling_times
from lab.paper.cases import OFFSETS, Cases, moved, start_of
from lab.paper.measures import seconds

PEAKS = ("peak_input", "peak_impact")


def quantities(cases: Cases) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heads, No. 1 to 11, and a row for each quantity."""
    columns = [_column(scene) for scene in cases.values()]
    rows = [(head, *(column[head] for column in columns)) for head in columns[0]]
    return ("", *(f"No. {number}" for number in cases)), rows


def _column(scene: Scene) -> dict[str, str]:
    run = simulate(scene)
    level, lost = run.energy.V_c, losses(run)
    spans = [contact_intervals(run, side) for side in SIDES]
    ended = [span[span[:, 1] < run.t[-1]] for span in spans]
    lengths = np.concatenate([span[:, 1] - span[:, 0] for span in ended]) * 1e3
    u_l, _, u_r, _ = penetration(run.state[-1])
    slope = float(np.polyfit(run.t, np.log(level), 1)[0])
    whole = float(level[0])
    x_l, x_r, _ = start_of(scene)
    left, middle, right = _times(scene)
    peaks = ensemble(scene, {}, PEAKS, threads=1).columns  # from the polynomials of the motion and not from a grid
    largest = {peak: max(float(peaks[f"{peak}_{side}"][0]) for side in SIDES) for peak in PEAKS}
    return {
        "start x_l, x_r, m": f"{x_l:g}, {x_r:g}",
        "settled within, mm": f"{1e3 * settled_distance(scene):g}",
        "settled: left, s": left,
        "object, s": middle,
        "right, s": right,
        "contacts left, right": f"{len(spans[0])}, {len(spans[1])}",
        "contact time, ms": f"{lengths.min():.0f} to {lengths.max():.0f}",
        "largest input, N": f"{largest['peak_input']:.2f}",
        "largest impact force, N": f"{largest['peak_impact']:.2f}",
        "V_c at 0 and 20 s, J": f"{whole:.3g}, {_plain(float(level[-1]))}",
        "lost to dampers, % of V_c(0)": f"{200.0 * float(lost.dampers) / whole:.1f}",
        "to feedback, % of V_c(0)": f"{200.0 * float(lost.feedback) / whole:.1f}",
        "to impacts, % of V_c(0)": f"{200.0 * float(lost.impacts) / whole:.1f}",
        "left at 20 s, % of V_c(0)": f"{100.0 * float(level[-1]) / whole:.1f}",
        "decay rate of V_c, 1/s": f"{round(-slope, 3) + 0.0:.3f}",
        "holding force at 20 s, N": f"{run.impacts[-1].min():.2g}",
        "gaps at 20 s, mm": f"{_plain(max(-1e3 * float(u_l), 0.0))}, {_plain(max(-1e3 * float(u_r), 0.0))}",
    }


def _times(scene: Scene) -> list[str]:
    """Settling times of the masses, as far as they have digits."""
    found = [settling_times(simulate(moved(scene, offset), grid=np.zeros(0))) for offset in OFFSETS]
    return [seconds(times.tolist()).removesuffix(" s") for times in np.transpose(found)]


def _plain(value: float) -> str:
    """Three digits where they are enough to read it, else two and a power of ten."""
    return f"{value:.3g}" if value == 0.0 or 0.01 <= value < 1e3 else f"{value:.1e}"

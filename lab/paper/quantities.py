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

HEADS = (
    "start x_l, x_r, m",
    "settled within, mm",
    "settled: left, s",
    "object, s",
    "right, s",
    "contacts left, right",
    "contact time, ms",
    "largest input, N",
    "largest impact force, N",
    "V_c at 0 and 20 s, J",
    "lost to dampers, % of V_c(0)",
    "to feedback, % of V_c(0)",
    "to impacts, % of V_c(0)",
    "left at 20 s, % of V_c(0)",
    "decay rate of V_c, 1/s",
    "holding force at 20 s, N",
    "gaps at 20 s, mm",
)

PEAKS = ("peak_input", "peak_impact")


def quantities(cases: Cases) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heads, No. 1 to 11, and a row for each quantity."""
    columns = [_column(scene) for scene in cases.values()]
    rows = [(head, *(column[row] for column in columns)) for row, head in enumerate(HEADS)]
    return ("", *(f"No. {number}" for number in cases)), rows


def _column(scene: Scene) -> list[str]:
    run = simulate(scene)
    level, lost = run.energy.V_c, losses(run)
    spans = [contact_intervals(run, side) for side in SIDES]
    ended = [span[span[:, 1] < run.t[-1]] for span in spans]
    lengths = np.concatenate([span[:, 1] - span[:, 0] for span in ended]) * 1e3
    u_l, _, u_r, _ = penetration(run.state[-1])
    slope = float(np.polyfit(run.t, np.log(level), 1)[0])
    whole = float(level[0])
    x_l, x_r, _ = start_of(scene)
    return [
        f"{x_l:g}, {x_r:g}",
        f"{1e3 * settled_distance(scene):g}",
        *_times(scene),
        f"{len(spans[0])}, {len(spans[1])}",
        f"{lengths.min():.0f} to {lengths.max():.0f}",
        *_peaks(scene),
        f"{whole:.3g}, {_plain(float(level[-1]))}",
        *(f"{200.0 * float(part) / whole:.1f}" for part in (lost.dampers, lost.feedback, lost.impacts)),
        f"{100.0 * float(level[-1]) / whole:.1f}",
        f"{round(-slope, 3) + 0.0:.3f}",
        f"{run.impacts[-1].min():.2g}",
        f"{_plain(max(-1e3 * float(u_l), 0.0))}, {_plain(max(-1e3 * float(u_r), 0.0))}",
    ]


def _times(scene: Scene) -> list[str]:
    """Settling times of the masses, as far as they have digits."""
    found = [settling_times(simulate(moved(scene, offset), grid=np.zeros(0))) for offset in OFFSETS]
    return [seconds(times.tolist()).removesuffix(" s") for times in np.transpose(found)]


def _peaks(scene: Scene) -> list[str]:
    """Largest input and impact force of either side, from the polynomials of the motion and not from a grid."""
    found = ensemble(scene, {}, PEAKS, threads=1).columns
    return [f"{max(float(found[f'{peak}_{side}'][0]) for side in ('left', 'right')):.2f}" for peak in PEAKS]


def _plain(value: float) -> str:
    """Three digits where they are enough to read it, else two and a power of ten."""
    return f"{value:.3g}" if value == 0.0 or 0.01 <= value < 1e3 else f"{value:.1e}"

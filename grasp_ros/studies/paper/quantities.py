"""The table of quantities: one column for each case."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import penetration
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from grasp_ros.simulation.quantities import contact_intervals, impact_forces_of, losses, settled_distance
from grasp_ros.studies.paper.cases import Cases, start_of
from grasp_ros.studies.paper.measures import measure

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
    "lost to dampers",
    "to feedback",
    "to impacts",
    "decay rate of V_c, 1/s",
    "holding force at 20 s, N",
    "gaps at 20 s, mm",
)


FINE = 20_001  # output times, for the largest forces


def quantities(cases: Cases) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heads, No. 1 to 11, and a row for each quantity."""
    columns = [_column(scene) for scene in cases.values()]
    rows = [(head, *(column[row] for column in columns)) for row, head in enumerate(HEADS)]
    return ("", *(f"No. {number}" for number in cases)), rows


def _column(scene: Scene) -> list[str]:
    run = simulate(scene, grid=np.linspace(0.0, scene.duration, FINE))
    found = measure(scene)
    level, lost = run.energy.V_c, losses(run)
    spans = [contact_intervals(run, side) for side in (LEFT, RIGHT)]
    ended = [span[span[:, 1] < run.t[-1]] for span in spans]
    lengths = np.concatenate([span[:, 1] - span[:, 0] for span in ended]) * 1e3
    forces = impact_forces_of(run)
    u_l, _, u_r, _ = penetration(run.state[-1])
    slope = float(np.polyfit(run.t, np.log(level), 1)[0])
    whole = float(level[0])
    x_l, x_r, _ = start_of(scene)
    return [
        f"{x_l:g}, {x_r:g}",
        f"{1e3 * settled_distance(scene):g}",
        *(_time(time) for time in (found.settling_l, found.settling_o, found.settling_r)),
        f"{len(spans[0])}, {len(spans[1])}",
        f"{lengths.min():.0f} to {lengths.max():.0f}",
        f"{np.abs(run.command).max():.2f}",
        f"{forces.max():.1f}",
        f"{whole:.3g}, {level[-1]:.2g}",
        *(f"{100.0 * float(part) / whole:.1f} %" for part in (lost.dampers, lost.feedback, lost.impacts)),
        f"{-slope + 0.0:.3f}",
        f"{forces[-1].min():.2g}",
        f"{max(-1e3 * float(u_l), 0.0):.2g}, {max(-1e3 * float(u_r), 0.0):.2g}",
    ]


def _time(seconds: float) -> str:
    return "never" if np.isinf(seconds) else f"{seconds:.2f}"

"""Numbers of the page: a column of quantities for each case, and what is uncertain in the source."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.energy import energy
from grasp_ros.physics.model import hertzian_force, penetration
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation import simulate
from grasp_ros.simulation.quantities import contact_intervals, settled_distance, settling_times, summary
from lab.paper.cases import (
    LITERAL,
    NEARLY,
    OFFSETS,
    PRINTED,
    READ_P,
    STANDARD,
    SYMMETRIC,
    Cases,
    moved,
    start_of,
    started,
    with_values,
)
from lab.paper.measures import measure, seconds, settlings
from lab.reference.grasp import grasp_of


def quantities(cases: Cases) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Heads, No. 1 to 11, and a row for each quantity."""
    columns = [_column(scene) for scene in cases.values()]
    rows = [(head, *(column[head] for column in columns)) for head in columns[0]]
    return ("", *(f"No. {number}" for number in cases)), rows


def _column(scene: Scene) -> dict[str, str]:
    run = simulate(scene)
    found = summary(run)
    (whole, last), largest, lost = found["V_c_J"], found["largest_N"], found["lost_J"]
    spans = [contact_intervals(run, side) for side in SIDES]
    ended = [span[span[:, 1] < run.t[-1]] for span in spans]
    lengths = np.concatenate([span[:, 1] - span[:, 0] for span in ended]) * 1e3
    u_l, _, u_r, _ = penetration(run.state[-1])
    slope = float(np.polyfit(run.t, np.log(run.energy.V_c), 1)[0])
    x_l, x_r, _ = start_of(scene)
    left, middle, right = _times(scene)
    return {
        "start x_l, x_r, m": f"{x_l:g}, {x_r:g}",
        "settled within, mm": f"{1e3 * settled_distance(scene):g}",
        "settled: left, s": left,
        "object, s": middle,
        "right, s": right,
        "contacts left, right": f"{len(spans[0])}, {len(spans[1])}",
        "contact time, ms": f"{lengths.min():.0f} to {lengths.max():.0f}",
        "largest input, N": f"{max(largest['input_left'], largest['input_right']):.2f}",
        "largest impact force, N": f"{max(largest['impact_left'], largest['impact_right']):.2f}",
        "V_c at 0 and 20 s, J": f"{whole:.3g}, {_plain(last)}",
        "lost to dampers, % of V_c(0)": f"{200.0 * lost['dampers'] / whole:.1f}",
        "to feedback, % of V_c(0)": f"{200.0 * lost['feedback'] / whole:.1f}",
        "to impacts, % of V_c(0)": f"{200.0 * lost['impacts'] / whole:.1f}",
        "left at 20 s, % of V_c(0)": f"{100.0 * last / whole:.1f}",
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


class Uncertainties(NamedTuple):
    """What follows from readings of the source."""

    input: float  # N, the largest of No. 9
    force: float  # N, on the left arm at x_l(0) without the minus
    literal: float  # J, V_c(0) there
    standard: float  # J, V_c(0) of No. 1
    times: dict[float, str]  # settling time by p, for readings of No. 4
    settled: str  # settling time of No. 1
    even: list[float]  # s, settling times of Nos. 1 and 11 from a symmetric start
    near: list[float]  # from beside it
    odd: list[float]  # from the printed one


def uncertainties(cases: Cases) -> Uncertainties:
    """All of them."""
    standard = cases[STANDARD]
    literal = started(standard, LITERAL)
    levels = [float(energy(scene.system, scene.initial_state).V_c) for scene in (literal, standard)]
    force = float(hertzian_force(grasp_of(standard).left_contact, np.array([LITERAL[0]]))[0])
    times = {p: seconds(settlings(with_values(standard, {"p": p}))) for p in sorted({*READ_P, 1.0})}
    even, near, odd = (
        [measure(started(cases[number], start), "settling") for number in (STANDARD, 11)]
        for start in (SYMMETRIC, NEARLY, PRINTED)
    )
    return Uncertainties(measure(cases[9], "input"), force, levels[0], levels[1], times, seconds(settlings(standard)),
                         even, near, odd)

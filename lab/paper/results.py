"""Numbers of the page: quantities of each case, what is uncertain in the source, tables of what the paper lacks.

The replay of a case has states of the run, from its dense output, as the page embeds them. Frames are 1/60 s apart, and
some tens more stand in every contact, so that slow motion through a contact shows states of the run and no
interpolation. All numbers have 32 bits; the run is evaluated at times that these hold.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.energy import energy
from grasp_ros.physics.model import Array, hertzian_force, penetration
from grasp_ros.physics.system import NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation import simulate
from grasp_ros.simulation.quantities import contact_intervals, settled_distance, settling_times, summary
from lab.paper.arms import Damped, Stepped, Stiffer
from lab.paper.beyond import MOVED, VISIBLE, WITHIN, Chaos, Edge, Gap, Tail
from lab.paper.cases import (
    FIGURES,
    LITERAL,
    NEARLY,
    OFFSETS,
    PRINTED,
    READ_P,
    STANDARD,
    SYMMETRIC,
    Cases,
    Figure,
    moved,
    start_of,
    started,
    value_of,
    with_values,
)
from lab.paper.measures import measure, seconds, settlings
from lab.reference.grasp import grasp_of

Table = list[dict[str, str]]
# of a replay
RATE = 60.0  # frames a second
IN_CONTACT = 40  # more frames in each contact
LONGEST = 0.5  # s; a contact that lasts longer needs no more frames
COLUMNS = ("t", "x_l", "x_o", "x_r", "f_l", "f_r", "fw_l", "fw_r", "V_c")


class Beyond(NamedTuple):
    """What was computed of it."""

    gap: Gap
    tail: Tail
    chaos: Chaos
    stiffer: Sequence[Stiffer]
    damped: Sequence[Damped]
    stepped: Sequence[Stepped]
    edge: Sequence[Edge]


def tables(found: Beyond) -> dict[str, Table]:
    """A table for each: cells by their heads."""
    return {"gap": _gap(found.gap), "tail": _tail(found.tail), "chaos": _chaos(found.chaos),
            "stiffer": _stiffer(found.stiffer), "damped": _damped(found.damped), "stepped": _stepped(found.stepped),
            "edge": _edge(found.edge)}


def _gap(found: Gap) -> Table:
    return [{"scene": name, "t, s": f"{jump.time:.6f}", "side": NAMES[jump.side], "u, mm": f"{1e3 * jump.u:.4f}",
             "V jumps up by, J": f"{jump.height:.6f}"} for name, jump in found.jumps]


def _tail(found: Tail) -> Table:
    decades = [int(np.argmin(np.abs(found.t - 10.0**power))) for power in range(2, 6)]
    return [{"t, s": f"{found.t[i]:.3g}", "V_c, J": f"{found.V_c[i]:.3e}",
             "V_c / law": f"{found.V_c[i] / found.law[i]:.4f}", "touches": f"{found.contacts[i]:.0f}"}
            for i in dict.fromkeys(decades)]


def _chaos(found: Chaos) -> Table:
    printed, symmetric = (f"x_l(0) = {start.x_l:g}, x_r(0) = {start.x_r:g} m" for start in (PRINTED, SYMMETRIC))
    heads = "start", "Lyapunov exponent, 1/s", "nearest return, sqrt(V(0))", "at, s"
    rows = (
        (printed, f"{found.exponent:.3f} +- {found.error:.3f}", f"{found.near:.2g}", f"{found.near_time:.0f}"),
        (f"{symmetric}, within symmetry", f"{found.symmetric:.3f}", f"{found.periodic:.1e}",
         f"{found.periodic_time:.1f}"),
        (f"{symmetric}, across it", f"{found.across:.3f}", "", f"over {WITHIN:g}"),
    )
    return [dict(zip(heads, row, strict=True)) for row in rows]


def _stiffer(rows: Sequence[Stiffer]) -> Table:
    return [{
        "k, N/m": f"{row.k:g}", "settling time, s": str(row.settling), "arms alone, s": str(row.alone),
        "touches per s": f"{row.rate:.2f}", "speed of approach, m/s": f"{row.speed:.2f}",
        "lost to impacts": f"{row.share:.0%}",
    } for row in rows]


def _damped(rows: Sequence[Damped]) -> Table:
    return [{
        "C, N s/m": f"{row.C:g}", "with the object, s": str(row.together),
        "alone, s": str(row.alone) if np.isfinite(row.alone.middle) else "never",
        "ratio": f"{row.together.middle / row.alone.middle:.2f}" if np.isfinite(row.alone.middle) else "",
        "starts with the object later": f"{row.later:.0%} +- {row.error:.0%}",
    } for row in rows]


def _stepped(rows: Sequence[Stepped]) -> Table:
    return [{
        "No.": str(row.case), "step, ms": f"{1e3 * row.step:g}", "largest error, m": f"{row.error:.2g}",
        "V_c at 20 s off by, V_c(0)": f"{row.drift:+.2g}", "touches found": f"{row.touches:.0%}",
        "first touch off by, s": f"{row.first:.1e}",
    } for row in rows]


def _edge(rows: Sequence[Edge]) -> Table:
    return [{
        f"case, from {SYMMETRIC.x_l:g}, {SYMMETRIC.x_r:g} m": f"No. {row.case}",
        "asymmetry without offset, m": f"{row.rest:g}",
        f"{1e3 * VISIBLE:g} mm after, s":
            f"{row.visible:.2f}" if np.isfinite(row.visible) else f"not in {row.t[-1]:g}",
        "mean growth, 1/s": f"{row.rate:.2f}" if np.isfinite(row.rate) else "",
        **{f"settled, {offset:g} m away, s": "never" if np.isinf(time) else f"{time:.2f}"
           for offset, time in zip(MOVED, row.settling, strict=True)},
    } for row in rows]


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


def frames(scene: Scene) -> Array:
    """States, forces and V_c of all frames, (n, 9); see COLUMNS."""
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    spans = np.concatenate([contact_intervals(run, side) for side in SIDES])
    inside = [np.linspace(a, b, IN_CONTACT + 2) for a, b in spans.tolist() if b - a < LONGEST]
    even = np.linspace(0.0, scene.duration, round(scene.duration * RATE) + 1)
    times = np.unique(np.concatenate([even, *inside]).astype(np.float32)).astype(float)
    run = simulate(scene, grid=times)
    return np.column_stack([run.t, run.state[:, 0::2], run.command, run.impacts, run.energy.V_c])


def replays(cases: Cases) -> list[dict[str, Any]]:
    """What the page embeds of all cases."""
    return [_replay(figure, cases[figure.case]) for figure in FIGURES]


def _replay(figure: Figure, scene: Scene) -> dict[str, Any]:
    table = frames(scene).astype("<f4")
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    return {
        "title": figure.title,
        "columns": list(COLUMNS),
        "rows": len(table),
        "data": base64.b64encode(table.tobytes(order="F")).decode("ascii"),
        "contacts": [contact_intervals(run, side).round(4).tolist() for side in SIDES],
        "masses": [value_of(scene, "m_l"), value_of(scene, "m_o"), value_of(scene, "m_r")],
        "damped": value_of(scene, "c") > 0.0,
    }

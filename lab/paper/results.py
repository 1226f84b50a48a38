"""What the paper lacks, in numbers: tables of the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.system import NAMES
from lab.paper.arms import Damped, Stepped, Stiffer
from lab.paper.beyond import MOVED, VISIBLE, WITHIN, Chaos, Edge, Gap, Tail
from lab.paper.cases import PRINTED, SYMMETRIC

Table = list[dict[str, str]]


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

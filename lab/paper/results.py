"""What the paper lacks, and what is doubtful in it, in sentences and tables whose numbers are computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.system import NAMES
from lab.paper.arms import MANY, STEPS, Damped, Stepped, Stiffer
from lab.paper.beyond import RETURN_SECONDS, SMALL, WITHIN, Chaos, Gap, Tail
from lab.paper.cases import PRINTED, SYMMETRIC
from lab.paper.knife_edge import MOVED, SMALLEST, VISIBLE, Edge


class Result(NamedTuple):
    """One thing that the page says beyond the paper."""

    key: str  # of its figure
    title: str
    text: str
    rows: Sequence[dict[str, str]]  # cells by their heads


class Beyond(NamedTuple):
    """What was computed for it."""

    gap: Gap
    tail: Tail
    chaos: Chaos
    stiffer: Sequence[Stiffer]
    damped: Sequence[Damped]
    stepped: Sequence[Stepped]
    edge: Sequence[Edge]


def results(found: Beyond) -> list[Result]:
    """All of them."""
    return [_gap(found.gap), _tail(found.tail), _chaos(found.chaos), _stiffer(found.stiffer), _damped(found.damped),
            _stepped(found.stepped), _edge(found.edge)]


def _gap(found: Gap) -> Result:
    unsafe = [str(number) for number, p, safe in found.safe if p >= safe]
    text = (
        "The proof shows that V falls within each contact mode, but not between modes. A pair"
        " that separates faster than 1/p while it penetrates is noncontact by (10): its Hertz term is removed from V,"
        f" and returns when u' rises through -1/p. V then jumps up: {len(found.jumps)} times in the two motions of the"
        " table."
        f" V_c, which keeps the term whenever u > 0, never rises here (largest step {found.V_c_rise:.1e} V_c(0)), and"
        " docs/certificate.md proves that it cannot. Where p is below sqrt(mu / V_c(0)) no pair can separate so fast"
        " and the printed proof is complete; that covers all of the paper's cases but No."
        f" {', '.join(unsafe) or 'none'}. What happens in those is measured under C1."
    )
    return Result("gap", "The gap in the proof, and its repair", text, [
        {"scene": name, "t, s": f"{jump.time:.6f}", "side": NAMES[jump.side], "u, mm": f"{1e3 * jump.u:.4f}",
         "V jumps up by, J": f"{jump.height:.6f}"} for name, jump in found.jumps])


def _tail(found: Tail) -> Result:
    text = (
        "At the origin a contact has no linear stiffness, so that with C > 0 the decay is algebraic, not exponential."
        " The exception is an initial state that is symmetric to the last bit: the object rests, V_c falls"
        " exponentially (No. 8), and each arm hits it like a wall. V_c tends to (4/5) H (kappa t)^(-5/2), here with"
        f" kappa = {found.kappa:.6g} /(m s), from the damping C, the stiffness K, H and m_o alone. No. 1 has V_c / law"
        f" = {found.constant:.4f} after {found.t[-1]:g} s, falls like t^{found.slope:.3f} over the last decade, and has"
        f" touched {found.contacts[-1]:.0f} times by then, like t^{found.touches_slope:.3f} (the law: t^0.75). The"
        " contacts never end. For C = 0 kappa is 0, and the law does not apply to No. 3."
    )
    decades = [int(np.argmin(np.abs(found.t - 10.0**power))) for power in range(2, 6)]
    return Result("tail", "The end is algebraic", text, [
        {"t, s": f"{found.t[place]:.3g}", "V_c, J": f"{found.V_c[place]:.3e}",
         "V_c / law": f"{found.V_c[place] / found.law[place]:.4f}", "touches": f"{found.contacts[place]:.0f}"}
        for place in dict.fromkeys(decades)])


def _chaos(found: Chaos) -> Result:
    text = (
        "Without any loss the motion neither grows nor decays, but it does not repeat either: two motions that begin"
        f" {SMALL:g} sqrt(V(0)) apart are {found.apart[1][-1]:.2g} sqrt(V(0)) apart after {found.apart[0][-1]:g} s. The"
        f" largest Lyapunov exponent is {found.exponent:.3f} +- {found.error:.3f} /s over {found.t[-1]:g} s (standard"
        f" error of ten blocks), a factor of {np.exp(20.0 * found.exponent):.1e} in the 20 s of Fig. 3. In"
        f" {RETURN_SECONDS:g} s the motion comes back to its start no nearer than some {found.near:.2g} sqrt(V(0));"
        f" after {-np.log(np.spacing(1.0)) / found.exponent:.0f} s or so the computed motion is one of those that"
        " begin within rounding of this one."
        " From a start that is symmetric to the last bit the object rests and the arms are periodic: the return is"
        f" within {found.periodic:.1e}, and the exponent of offsets that keep the symmetry tends to 0"
        f" ({found.symmetric:.3f} /s). Other offsets grow even faster, at {found.across:.2f} /s."
    )
    printed, symmetric = (f"x_l(0) = {start.x_l:g}, x_r(0) = {start.x_r:g} m" for start in (PRINTED, SYMMETRIC))
    heads = "start", "Lyapunov exponent, 1/s", "nearest return, sqrt(V(0))", "at, s"
    rows = (
        (printed, f"{found.exponent:.3f} +- {found.error:.3f}", f"{found.near:.2g}", f"{found.near_time:.0f}"),
        (f"{symmetric}, within symmetry", f"{found.symmetric:.3f}", f"{found.periodic:.1e}",
         f"{found.periodic_time:.1f}"),
        (f"{symmetric}, across it", f"{found.across:.3f}", "", f"over {WITHIN:g}"),
    )
    cells = [dict(zip(heads, row, strict=True)) for row in rows]
    return Result("chaos", "No. 2 is chaos, not a periodic motion", text, cells)


def _edge(rows: Sequence[Edge]) -> Result:
    grown = [row for row in rows if np.isfinite(row.visible)]
    robust = [row for row in rows if row not in grown]
    named = {row.case: row for row in rows}
    text = (
        "Figs. 6, 8 and 9 begin symmetrically. With equal arms the object then rests, to the last bit, and what the"
        f" figures show is one arm against a wall. An offset of {SMALLEST:g} m of one arm, which no experiment can"
        f" avoid, exceeds {1e3 * VISIBLE:g} mm after {min(row.visible for row in grown):.1f} to"
        f" {max(row.visible for row in grown):.1f} s in No. {', '.join(str(row.case) for row in grown)}: every touch"
        " that is slightly early pushes the object, which then hits the other arm even earlier. Only in No."
        f" {', '.join(str(row.case) for row in robust)} does the offset decay: the dampers act faster. So the settling"
        " times of the symmetric start belong to a motion that cannot be observed: No. 5 needs"
        f" {named[5].settling[0]:.1f} s there and {named[5].settling[1]:.0f} s from {MOVED[1]:g} m beside it, No. 7"
        f" {named[7].settling[0]:.1f} and, from {MOVED[-1]:g} m, {named[7].settling[-1]:.1f} s. The same holds for the"
        " period of No. 2."
    )
    return Result("edge", "A symmetric start is a knife-edge", text, [{
        f"case, from {SYMMETRIC.x_l:g}, {SYMMETRIC.x_r:g} m": f"No. {row.case}",
        "asymmetry without offset, m": f"{row.rest:g}",
        f"{1e3 * VISIBLE:g} mm after, s":
            f"{row.visible:.2f}" if np.isfinite(row.visible) else f"not in {row.t[-1]:g}",
        "mean growth, 1/s": f"{row.rate:.2f}" if np.isfinite(row.rate) else "",
        **{f"settled, {offset:g} m beside, s": "never" if np.isinf(time) else f"{time:.2f}"
           for offset, time in zip(MOVED, row.settling, strict=True)},
    } for row in rows])


def _stiffer(rows: Sequence[Stiffer]) -> Result:
    standard = next(row for row in rows if row.k == 10.0)
    printed = next(row for row in rows if row.k == 100.0)
    best, last = min(rows, key=lambda row: row.settling.middle), rows[-1]
    flat = [row.k for row in rows if row.settling.low <= best.settling.high]
    end = "more than that" if last.settling.low > best.settling.high else "no more than the scatter"
    text = (
        f"Medians over {standard.starts} random starts, with the 95 % interval of each. Ten times the stiffness changes"
        f" the settling time from {standard.settling} to {printed.settling} s. The arms alone are hardly affected"
        f" ({standard.alone} and {printed.alone} s: the envelope exp(-C t / 2m) does not depend on k). With the object"
        f" a stiffer arm returns sooner ({standard.rate:.2f} and {printed.rate:.2f} touches a second), hits it faster"
        f" ({standard.speed:.2f} and {printed.speed:.2f} m/s) and so loses more to impacts ({standard.share:.0%} and"
        f" {printed.share:.0%} of the lost energy), since 1 - e = (2/3) p v to first order. The benefit is limited:"
        f" the medians from k = {min(flat):g} to {max(flat):g} N/m do not differ significantly from the lowest, and at"
        f" {last.k:g} N/m it is"
        f" {last.settling} s, {end}. Touches, speeds and shares are those of the first {min(MANY, last.starts)} starts."
    )
    return Result("stiffer", "Stiffer arms settle sooner, up to a point", text, [{
        "k, N/m": f"{row.k:g}", "settling time, s": str(row.settling), "arms alone, s": str(row.alone),
        "touches per s": f"{row.rate:.2f}", "speed of approach, m/s": f"{row.speed:.2f}",
        "lost to impacts": f"{row.share:.0%}",
    } for row in rows])


def _damped(rows: Sequence[Damped]) -> Result:
    without = rows[0]
    later = [row for row in rows if row.C > 0.0 and row.later - 2.0 * row.error > 0.5]
    text = (
        f"Medians over {without.starts} random starts, with the 95 % interval of each. Without dampers only impacts"
        f" stop the arms: {without.together} s with the object, never without. With dampers it is the opposite: from C"
        f" = {min(row.C for row in later):g} N s/m on, in most of the random"
        " starts (by two standard errors) the arms settle later with the object between them than alone, because the"
        " object, which has no damper, absorbs energy and returns it. The negative term of (18) compares V' at one"
        " state, not two motions."
    )
    return Result("damped", "Collisions slow arms that are damped", text, [{
        "C, N s/m": f"{row.C:g}", "with the object, s": str(row.together),
        "alone, s": str(row.alone) if np.isfinite(row.alone.middle) else "never",
        "ratio": f"{row.together.middle / row.alone.middle:.2f}" if np.isfinite(row.alone.middle) else "",
        "starts with the object later": f"{row.later:.0%} +- {row.error:.0%}",
    } for row in rows])


def _stepped(rows: Sequence[Stepped]) -> Result:
    fine, coarse = ([row for row in rows if row.step == step] for step in STEPS)
    elastic = {row.step: row for row in rows if row.case == 2}
    text = (
        "The paper does not print its step. Its method (Runge-Kutta, contact detected at the ends of a step, time and"
        f" state by linear interpolation) at 1 ms is off by up to {max(row.error for row in fine):.2g} m within 20 s,"
        f" at 10 ms by up to {max(row.error for row in coarse):.2g} m. In No. 2, where V_c is constant, it loses"
        f" {-elastic[STEPS[0]].drift:.1%} of it at 1 ms and {-elastic[STEPS[1]].drift:.0%} at 10 ms: a figure drawn"
        f" that way shows a decay that is not there. It finds between {min(row.touches for row in rows):.0%} and"
        f" {max(row.touches for row in rows):.0%} of the touches, more than 100% where its motion has already diverged."
    )
    return Result("stepped", "What the paper's own method does to its figures", text, [{
        "No.": str(row.case), "step, ms": f"{1e3 * row.step:g}", "largest error, m": f"{row.error:.2g}",
        "V_c at 20 s off by, V_c(0)": f"{row.drift:+.2g}", "touches found": f"{row.touches:.0%}",
        "first touch off by, s": f"{row.first:.1e}",
    } for row in rows])

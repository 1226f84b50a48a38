"""What the paper lacks, and what is doubtful in it, in sentences and tables whose numbers are computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.energy import energy
from grasp_ros.physics.model import hertzian_force
from grasp_ros.physics.system import NAMES
from grasp_ros.studies.paper.arms import Damped, Stepped, Stiffer
from grasp_ros.studies.paper.beyond import Chaos, Gap, Tail
from grasp_ros.studies.paper.cases import LITERAL, PRINTED, STANDARD, SYMMETRIC, Cases, started, with_values
from grasp_ros.studies.paper.measures import measure

Row = tuple[str, ...]


class Result(NamedTuple):
    """One thing that the page says beyond the paper."""

    key: str  # of its figure
    title: str
    text: str
    heads: Row
    rows: Sequence[Row]


class Beyond(NamedTuple):
    """What was computed for it."""

    gap: Gap
    tail: Tail
    chaos: Chaos
    stiffer: Sequence[Stiffer]
    damped: Sequence[Damped]
    stepped: Sequence[Stepped]


def results(found: Beyond) -> list[Result]:
    """All of them."""
    return [
        _gap(found.gap),
        _tail(found.tail),
        _chaos(found.chaos),
        _stiffer(found.stiffer),
        _damped(found.damped),
        _stepped(found.stepped),
    ]


def _gap(found: Gap) -> Result:
    unsafe = [str(number) for number, p, safe in found.safe if p >= safe]
    text = (
        "The proof shows that V falls within each condition of contact, and not that it does so between them. A pair"
        " that separates faster than 1/p while it penetrates is noncontact by (10): its Hertz term leaves V, and comes"
        f" back where u' rises through -1/p. V then jumps up, {len(found.jumps)} times below. V_c, which keeps the term"
        f" whenever u > 0, never rises here (largest step {found.V_c_rise:.1e} V_c(0)), and docs/certificate.md proves"
        " that it cannot. Where p is below sqrt(mu / V_c(0)) no pair can separate so fast and the printed proof is"
        f" complete; that covers all of the paper's cases but No. {', '.join(unsafe) or 'none'}."
    )
    rows = [
        (name, f"{jump.time:.6f}", NAMES[jump.side], f"{1e3 * jump.u:.4f}", f"{jump.height:.6f}")
        for name, jump in found.jumps
    ]
    return Result(
        "gap",
        "The gap in the proof, and its repair",
        text,
        ("scene", "t, s", "side", "u, mm", "V jumps up by, J"),
        rows,
    )


def _tail(found: Tail) -> Result:
    text = (
        "At the origin a contact has no linear stiffness, so that the end is algebraic and not exponential, whatever"
        f" the dampers. V_c tends to (4/5) H (kappa t)^(-5/2), here with kappa = {found.kappa:.6g} /(m s), from the"
        f" damping C, the stiffness K, H and m_o alone. No. 1 has V_c / law = {found.constant:.4f} after"
        f" {found.t[-1]:g} s, falls like t^{found.slope:.3f} over the last decade, and has touched"
        f" {found.contacts[-1]:.0f} times by then, like t^{found.touches_slope:.3f} (the law: t^0.75). The contacts"
        " never end."
    )
    rows = [
        (f"{t:.3g}", f"{V:.3e}", f"{V / law:.4f}", f"{n:.0f}")
        for t, V, law, n in zip(found.t, found.V_c, found.law, found.contacts, strict=True)
    ]
    decades = [int(np.argmin(np.abs(found.t - 10.0**power))) for power in range(2, 6)]
    return Result(
        "tail",
        "The end is algebraic",
        text,
        ("t, s", "V_c, J", "V_c / law", "touches"),
        [rows[place] for place in dict.fromkeys(decades)],
    )


def _chaos(found: Chaos) -> Result:
    text = (
        "Without any loss the motion neither grows nor decays, but it does not repeat either: two motions that begin"
        " 1e-9 apart are as far apart as the motion is large within a minute. The largest Lyapunov exponent is"
        f" {found.exponent:.3f} +- {found.error:.3f} /s over {found.t[-1]:g} s (standard error of ten blocks), a factor"
        f" of {np.exp(20.0 * found.exponent):.1e} in the 20 s of Fig. 3. In {found.seconds:g} s the motion comes back"
        f" to its start no nearer than {found.near:.3f} sqrt(V(0)), at {found.near_time:.1f} s. From a symmetric start"
        f" the object rests and the arms are periodic: the return is within {found.periodic:.1e}, and the exponent"
        f" within that symmetry tends to 0 ({found.symmetric:.3f} /s)."
    )
    rows = [
        (
            "x_l(0) = -0.3, x_r(0) = 0.5 m",
            f"{found.exponent:.3f} +- {found.error:.3f}",
            f"{found.near:.4f}",
            f"{found.near_time:.3f}",
        ),
        ("x_l(0) = -0.5, x_r(0) = 0.5 m", f"{found.symmetric:.3f}", f"{found.periodic:.1e}", "within 20"),
    ]
    return Result(
        "chaos",
        "No. 2 is chaos, not a periodic motion",
        text,
        ("start", "Lyapunov exponent, 1/s", "nearest return, sqrt(V(0))", "at, s"),
        rows,
    )


def _stiffer(rows: Sequence[Stiffer]) -> Result:
    standard = next(row for row in rows if row.k == 10.0)
    printed = next(row for row in rows if row.k == 100.0)
    best, last = min(rows, key=lambda row: row.settling), rows[-1]
    text = (
        f"Ten times the stiffness changes the median settling time from {standard.settling:.1f} to"
        f" {printed.settling:.1f} s. The arms alone do not care ({standard.alone:.1f} and {printed.alone:.1f} s: the"
        " envelope exp(-C t / 2m) does not know k). With the object a stiffer arm comes back sooner"
        f" ({standard.rate:.2f} and {printed.rate:.2f} touches a second), meets it faster ({standard.speed:.2f} and"
        f" {printed.speed:.2f} m/s) and so loses more to impacts ({standard.share:.0%} and {printed.share:.0%} of the"
        " lost energy), since 1 - e = (2/3) p v to first order. It has an end: the shortest settling time is at k ="
        f" {best.k:g} N/m, and {last.k:g} N/m needs {last.settling:.1f} s, because an arm that hardly gives way takes"
        " little from the object (kappa of the tail falls with 1/K^2)."
    )
    table = [
        (
            f"{row.k:g}",
            f"{row.settling:.2f}",
            f"{row.alone:.2f}",
            f"{row.rate:.2f}",
            f"{row.speed:.3f}",
            f"{row.share:.1%}",
        )
        for row in rows
    ]
    return Result(
        "stiffer",
        "Stiffer arms settle sooner, up to a point",
        text,
        ("k, N/m", "settling time, s", "arms alone, s", "touches per s", "speed of approach, m/s", "lost to impacts"),
        table,
    )


def _damped(rows: Sequence[Damped]) -> Result:
    without = rows[0]
    later = [row for row in rows if row.C > 0.0 and row.later > 0.5]
    text = (
        f"Where the arms have no damper, impacts are all that stops them: {without.together:.0f} s with the object,"
        f" never without. Where they have dampers it is the other way round: from C = {min(row.C for row in later):g} N"
        " s/m on, in most of the random starts the arms settle later with the object between them than alone, because"
        " the object has no damper, takes energy over and gives it back. That the term of (18) is negative compares V'"
        " at one state, not two motions."
    )
    table = [
        (f"{row.C:g}", f"{row.together:.2f}", f"{row.alone:.2f}", f"{row.together / row.alone:.2f}", f"{row.later:.0%}")
        for row in rows
    ]
    return Result(
        "damped",
        "Collisions slow arms that are damped",
        text,
        ("C, N s/m", "with the object, s", "alone, s", "ratio", "starts with the object later"),
        table,
    )


def _stepped(rows: Sequence[Stepped]) -> Result:
    fine, coarse = ([row for row in rows if row.step == step] for step in (1e-3, 1e-2))
    elastic = {row.step: row for row in rows if row.case == 2}
    text = (
        "The paper does not print its step. Its method (Runge-Kutta, contact decided at the ends of a step, time and"
        f" state by linear interpolation) at 1 ms is off by up to {max(row.error for row in fine):.2g} m within 20 s,"
        f" at 10 ms by up to {max(row.error for row in coarse):.2g} m. In No. 2, where V_c is constant, it loses"
        f" {-elastic[1e-3].drift:.1%} of it at 1 ms and {-elastic[1e-2].drift:.0%} at 10 ms: a figure drawn that way"
        f" shows a decay that is not there. It finds between {min(row.touches for row in rows):.0%} and"
        f" {max(row.touches for row in rows):.0%} of the touches."
    )
    table = [
        (
            str(row.case),
            f"{1e3 * row.step:g}",
            f"{row.error:.2g}",
            f"{row.drift:+.2g}",
            f"{row.touches:.0%}",
            f"{row.first:.1e}",
        )
        for row in rows
    ]
    return Result(
        "stepped",
        "What the paper's own method does to its figures",
        text,
        ("No.", "step, ms", "largest error, m", "V_c at 20 s off by, V_c(0)", "touches found", "first touch off by, s"),
        table,
    )


def doubts(cases: Cases) -> list[tuple[str, str]]:
    """What is doubtful in the source: what, and what follows, with numbers."""
    standard = cases[STANDARD]
    inputs = measure(cases[9]).input
    literal = started(standard, LITERAL)
    force = float(hertzian_force(standard.grasp.left_contact, np.array([LITERAL[0]]))[0])
    levels = [float(energy(scene.system, scene.initial_state).V_c) for scene in (standard, literal)]
    ps = (0.2, 0.5, 1.0, 2.0, 5.0)
    times = [measure(with_values(standard, {"p": p})).settling for p in ps]
    even, odd = (
        [measure(started(cases[number], start)).settling for number in (STANDARD, 11)] for start in (SYMMETRIC, PRINTED)
    )
    asymmetric = measure(standard).settling
    return [
        (
            "Number of figures",
            (
                'The text announces results "from Fig. 2 to Fig. 15"; the last figure is Fig. 12. Its list of cases'
                " ends there, too, so that nothing seems to be missing but three figures that nobody describes."
            ),
        ),
        (
            "Axis of Fig. 10",
            (
                f"It ends at -10 N. From rest the first input of No. 9 is -Kp x_r(0) = {-inputs:g} N on the right."
                " Either the curve leaves the figure or the start was another."
            ),
        ),
        (
            "Sign of x_l(0)",
            (
                f"Table 1 prints +{LITERAL[0]:g}. The left arm would start {LITERAL[0]:g} m inside the object, pressed"
                f" with {force:.0f} N, and with V_c(0) = {levels[1]:.0f} J in place of {levels[0]:.2g} J. Read as -0.3."
            ),
        ),
        (
            "p of No. 4",
            'Only "larger" is said. Read as 1 s/m; settling times for '
            + ", ".join(f"p = {p:g}: {time:.1f} s" for p, time in zip(ps, times, strict=True))
            + f" (p = 0.1: {asymmetric:.1f} s).",
        ),
        (
            "Symmetric starts",
            (
                "Nos. 5 to 8 start symmetrically, without numbers; read as -0.5 and 0.5 m. From there the object never"
                f" moves and its mass does not matter: No. 1 and No. 11 settle after {even[0]:.2f} and {even[1]:.2f} s,"
                f" from the printed start after {odd[0]:.1f} and {odd[1]:.1f} s. Comparing Fig. 2 with Figs. 6 to 9"
                " compares starts as well."
            ),
        ),
        ("x_o(0)", "Not printed. Read as 0, in the middle of the axes of Figs. 2 to 12."),
        ("Step of the integration", "Not printed; see what it does to the figures below."),
        (
            '"In Fig. 1"',
            "The sentence on where x_l is larger than x_o (p. 246) can only mean Fig. 2: Fig. 1 is the model.",
        ),
    ]

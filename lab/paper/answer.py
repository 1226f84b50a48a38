"""The answer in ten lines: what of the paper holds, and what is known beyond it. Every number is computed."""

from __future__ import annotations

from collections.abc import Sequence

from lab.paper.claims import Claim, Kind, Verdict, tally
from lab.paper.results import Beyond

FIGURE = (  # that stands beside it, and its caption
    "tail", "V_c of No. 1 beside its law, t^(-5/2), and its touches beside t^(3/4)",
)
NUMBERED = ("O", "C")  # keys of the claims that the paper numbers


def answer(claims: Sequence[Claim], found: Beyond) -> list[str]:
    """Ten lines."""
    numbered = [claim for claim in claims if claim.key.startswith(NUMBERED)]
    missed = [claim for claim in numbered if claim.verdict is Verdict.FAILS]
    failing = "; ".join(f"{claim.key}: {claim.statement.rstrip('.')}" for claim in missed)
    lossless, standard = found.damped[0], next(row for row in found.damped if row.C == 0.7)
    grown = [row for row in found.edge if row.visible < float("inf")]
    coarse = max(row.error for row in found.stepped if row.step == max(row.step for row in found.stepped))
    return [
        f"The paper numbers {len(numbered)} claims, twelve observations and three conclusions:"
        f" {', '.join(tally(numbered))}.",
        f"Not so: {failing}." if failing else "None of them fails.",
        "The proof has a gap: V as printed jumps up where a pair separates faster than 1/p"
        f" ({len(found.gap.jumps)} times in two of our scenes). {_jumps(claims)} V_c, which keeps the term, never"
        " rises, and closes the proof.",
        "Stronger than the paper's claim: one dissipative contact makes the origin globally attracting, even if no arm"
        f" has a damper (proof: docs/certificate.md); it takes {lossless.together} s.",
        f"With dampers the decay is algebraic: V_c falls like t^(-5/2) (measured: t^{found.tail.slope:.3f}), and the"
        " touches never end.",
        f"Collisions slow arms that are damped: No. 1 settles after {standard.together} s with the object, after"
        f" {standard.alone} s without.",
        "Symmetric initial states are unstable: an offset of a nanometre grows to a millimetre after"
        f" {min(row.visible for row in grown):.0f}"
        f" to {max(row.visible for row in grown):.0f} s, and the motion of Figs. 6, 8 and 9 cannot be observed.",
        f"No. 2, without losses, is chaotic: its Lyapunov exponent is {found.chaos.exponent:.2f} +-"
        f" {found.chaos.error:.2f} /s.",
        "The object is not gripped: both arms are regulated to the same point, and in the end press with no force"
        " (T9). Overlapping set-points give a grip.",
        f"The paper's own method at a step of 10 ms is off by up to {coarse:.2g} m within 20 s.",
    ]


def _jumps(claims: Sequence[Claim]) -> str:
    """Whether V jumps in the paper's own cases."""
    first = next(claim for claim in claims if claim.key == "C1").parts[0]
    never = all(check.holds for check in first.checks if check.kind is Kind.PRINTED)
    return f"It {'never does' if never else 'also does'} in the paper's own cases."

"""A verdict for each figure of the paper: what can be read off the print, with its tolerance, against ours.

Our source is the text of a scan. It holds the captions, the letters of the curves and the numbers at the axes; the
curves themselves are not in it, and no value on a curve is read here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.simulation import simulate
from lab.paper.cases import ABSENT, LARGER, STANDARD, TENFOLD, Cases, Figure, value_of
from lab.paper.claims import Claim, Verdict

PAPER_DISPLACEMENT = (-1.0, 1.0)  # m, the axes of Figs. 2 to 12
PAPER_INPUT = (-10.0, 10.0)  # N
WIDTH = 0.01  # of an axis: a line that passes its end by less cannot be told from one that touches it
LAST = 20.0  # s, at the end of the time axis of each figure
LETTERS = ("m_l", "m_r", "k", "c", "Kp", "Kv", "p", "H", "m_o")


class Reading(NamedTuple):
    """One thing that the print shows, and ours."""

    what: str
    printed: str
    tolerance: str
    ours: str
    agrees: bool


class Compared(NamedTuple):
    """A figure of the paper against ours."""

    readings: Sequence[Reading]
    claims: Sequence[tuple[str, Verdict]]  # what the paper says of the curves

    @property
    def agrees(self) -> bool:
        """Whether all that can be read does."""
        return all(each.agrees for each in self.readings)

    @property
    def verdict(self) -> str:
        """In words."""
        if self.agrees:
            return "agrees in all that can be read"
        return "does not agree: " + ", ".join(each.what for each in self.readings if not each.agrees)


def compared(figure: Figure, cases: Cases, claims: Sequence[Claim]) -> Compared:
    """Read a figure and judge it; `claims` are those of the whole paper."""
    drawn = [(claim.key, claim.verdict) for claim in claims if claim.key in figure.used_by]
    return Compared(list(_readings(figure, cases)), drawn)


def _readings(figure: Figure, cases: Cases) -> Iterator[Reading]:
    scene = cases[figure.case]
    changed = {letter: (value_of(cases[STANDARD], letter), value_of(scene, letter)) for letter in LETTERS}
    changed = {letter: pair for letter, pair in changed.items() if pair[0] != pair[1]}
    ours = ", ".join(f"{letter} {before:g} to {after:g}" for letter, (before, after) in changed.items()) or "Table 1"
    right = set(changed) == set(figure.letters) and all(_as_said(figure.how, *pair) for pair in changed.values())
    yield Reading("caption", figure.caption, "exact" if figure.how != LARGER else "no number", ours, right)
    yield Reading("time axis", f"0 to {LAST:g} s", "exact", f"0 to {scene.duration:g} s", scene.duration == LAST)
    run = simulate(scene)
    lowest, low = float(run.state[:, 0::2].min()), PAPER_DISPLACEMENT[0]
    slack = WIDTH * (PAPER_DISPLACEMENT[1] - low)
    inside = lowest >= low - slack
    yield Reading("displacement axis", f"from {low:g} m", f"{slack:g} m", f"lowest {lowest:.2f} m", inside)
    largest, (low, high) = float(np.abs(run.command).max()), PAPER_INPUT
    slack = WIDTH * (high - low)
    inside = largest <= high + slack
    yield Reading("input axis", f"{low:g} to {high:g} N", f"{slack:g} N", f"largest {largest:.1f} N", inside)


def _as_said(how: str, before: float, after: float) -> bool:
    """Whether a number has changed as the caption says."""
    if how == TENFOLD:
        return abs(after - 10.0 * before) <= 1e-9 * after
    return after == 0.0 if how == ABSENT else after > before

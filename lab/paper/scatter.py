"""Medians with their own scatter, from which the verdict of a sweep follows, and where statements are false.

That is told by how far a start is from symmetric, if it can be.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binom

from lab.paper.cases import Start

CONFIDENCE = 0.95
FEWEST = 3  # false starts below which nothing is said
WRONG = 0.02  # of the starts that a border may put on the wrong side


class Median(NamedTuple):
    """The median of a sample, and an interval that holds that of all starts with CONFIDENCE, whatever they are like.

    The bounds are order statistics: so many of n numbers lie below the median as heads fall in n throws of a coin.
    """

    low: float
    middle: float
    high: float

    def __str__(self) -> str:
        return f"{self.middle:.3g} ({self.low:.3g} to {self.high:.3g})"


def median(values: Sequence[float]) -> Median:
    """The median of numbers, some of which may be infinite."""
    ordered = np.sort(np.asarray(values, dtype=float))
    n = len(ordered)
    rank = max(int(binom.ppf(0.5 * (1.0 - CONFIDENCE), n, 0.5)), 1)
    return Median(float(ordered[rank - 1]), float(ordered[n // 2]), float(ordered[n - rank]))


def asymmetry(start: Start) -> float:
    """|x_l(0) + x_r(0)| in the larger of both."""
    return abs(start.x_l + start.x_r) / max(abs(start.x_l), abs(start.x_r))


def where_false(starts: Sequence[Start], true: Sequence[bool]) -> str:
    """A sentence on the border in asymmetry below which a statement is false, and above which true; else nothing."""
    held = np.array(true)
    if np.count_nonzero(~held) < FEWEST or held.mean() < 0.5:
        return ""
    order = np.argsort([asymmetry(start) for start in starts])
    far, sorted_ = np.array([asymmetry(start) for start in starts])[order], held[order]
    below = np.concatenate([[0], np.cumsum(sorted_)])  # true ones on the false side of a border behind n starts
    above = np.count_nonzero(~sorted_) - np.concatenate([[0], np.cumsum(~sorted_)])
    border = int(np.argmin(below + above))
    wrong = int((below + above)[border])
    if not 0 < border < len(far) or wrong > WRONG * len(far):
        return ""
    return (
        f"; false where |x_l(0) + x_r(0)| is below {0.5 * (far[border - 1] + far[border]):.2g} of the larger"
        f" displacement ({border} starts), true elsewhere, but for {wrong}"
    )

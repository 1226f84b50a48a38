"""Medians with their own scatter: what a sweep prints, and from which its verdict follows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import binom

CONFIDENCE = 0.95


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

"""How far a start is from symmetric, and whether that tells where a statement is false."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lab.paper.cases import Start

FEWEST = 3  # false starts below which nothing is said
WRONG = 0.02  # of the starts that a border may put on the wrong side


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

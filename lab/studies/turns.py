"""Calls that are timed in turn, so that the ratios of their times hold on a machine that is shared."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

from tqdm import tqdm


def in_turn(
    calls: Sequence[Callable[[], object]], rounds: int, clock: Callable[[], float] = time.perf_counter, what: str = ""
) -> list[list[float]]:
    """So many times of each call in s, each behind a run that is not timed.

    What its predecessor has left in the caches is not a call's own cost.
    """
    times: list[list[float]] = [[] for _ in calls]
    for _ in tqdm(range(rounds), desc=what, file=sys.stderr, leave=False, disable=not what):
        for call, own in zip(calls, times, strict=True):
            call()
            begin = clock()
            call()
            own.append(clock() - begin)
    return times

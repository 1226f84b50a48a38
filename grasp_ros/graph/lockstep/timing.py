"""How well a free-running plant keeps its time, over a second: what it publishes on the topic `timing`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

PERCENTILE = 99.0
OLDEST = 10_000  # periods that are told apart over the whole run


class Timing:
    """Collects lateness, intervals and ages of commands; `period` in s of wall time, `factor` as it is asked for."""

    def __init__(self, sides: Sequence[str], period: float, factor: float) -> None:
        self._sides, self._period, self._factor = sides, period, factor
        self._spent, self._counted = 0.0, 0  # wall time of all intervals, and their number
        self.lost = 0.0  # wall time given up since the start, because the plant was too far behind, s
        self._overruns = 0
        self._before = math.nan
        self._all: dict[str, Counter[int]] = {side: Counter() for side in sides}  # ages since the start
        self._timed_out: Counter[str] = Counter()  # periods since the start
        self._clear()

    def _clear(self) -> None:
        self._intervals: list[float] = []
        self._lateness: list[float] = []
        self._ages: dict[str, list[int]] = {side: [] for side in self._sides}

    def period(self, now: float, late: float) -> None:
        """One control period, computed at a wall time in s, late by so much."""
        if not math.isnan(self._before):
            self._intervals.append(now - self._before)
            self._spent, self._counted = self._spent + now - self._before, self._counted + 1
        self._before = now
        self._lateness.append(late)
        self._overruns += late > self._period

    def pause(self) -> None:
        """The plant stands, as it was told to."""
        self._before = math.nan

    def age(self, side: str, periods: int, timed_out: bool) -> None:
        """Age of the last command in control periods: how much older the state is that it answers."""
        self._ages[side].append(periods)
        self._timed_out[side] += timed_out
        self._all[side][min(periods, OLDEST)] += 1

    def take(self) -> dict[str, float]:
        """What was collected since the last call, by name; nothing where there was no period.

        `reached` are the simulated seconds in a second since the start, without pauses; `period_s` is the mean
        interval, `jitter_s` its standard deviation, `late_p99_s` how late the periods were computed, `overruns` how
        many were later than a whole period since the start, and `left_age_p99` and so on the age of the commands in
        periods; `left_age_p99_all` and `left_age_max_all` are those since the start, and `left_timed_out_all` in how
        many periods it was older than the timeout.
        """
        if not self._lateness or not self._intervals:
            return {}
        values = {
            "period_s": float(np.mean(self._intervals)), "jitter_s": float(np.std(self._intervals)),
            "late_p99_s": float(np.percentile(self._lateness, PERCENTILE)), "overruns": float(self._overruns),
            "lost_s": self.lost, "reached": self._factor * self._period * self._counted / self._spent,
        }
        for side, ages in self._ages.items():
            values[f"{side}_age_p99"] = float(np.percentile(ages, PERCENTILE))
            values[f"{side}_age_max"] = float(np.max(ages))
            known, often = [*self._all[side]], [*self._all[side].values()]
            values[f"{side}_age_p99_all"] = float(  # the smallest that PERCENTILE of all do not exceed
                np.percentile(known, PERCENTILE, weights=often, method="inverted_cdf")
            )
            values[f"{side}_age_max_all"] = float(max(known))
            values[f"{side}_timed_out_all"] = float(self._timed_out[side])
        self._clear()
        return values

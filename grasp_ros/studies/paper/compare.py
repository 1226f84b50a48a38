"""Statements that compare two cases: the ratio of a measure, wherever a reading leaves room."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.scene import Scene
from grasp_ros.studies.paper.cases import (
    PRINTED,
    READ_STARTS,
    STANDARD,
    SYMMETRIC,
    Cases,
    Start,
    start_of,
    started,
    value_of,
    with_values,
)
from grasp_ros.studies.paper.claims import HALF, Check, Kind, Part, almost_all
from grasp_ros.studies.paper.measures import NAMES, UNITS, measure, ratio

MARGIN = 1.05  # a measure is higher or lower if it is so by more than 5 %
SWEPT = 15  # random starts of each value of a sweep; their median counts
ALIKE = (PRINTED, SYMMETRIC)


class Comparison(NamedTuple):
    """A measure of one case is higher, or lower, than that of another."""

    statement: str
    measure: str
    changed: int
    higher: bool
    why: str
    letter: str = ""  # of the parameter behind it, and its values from the standard to beyond the changed case
    values: tuple[float, ...] = ()
    words: tuple[str, ...] = ()  # other measures that the sentence may mean
    other: int = STANDARD
    others: tuple[tuple[str, tuple[tuple[str, float], ...]], ...] = ()  # other scenes to compare with: text, numbers

    @property
    def threshold(self) -> str:
        """In words."""
        side = f"above {MARGIN:g}" if self.higher else f"below {1.0 / MARGIN:.3g}"
        return f"{NAMES[self.measure]}, No. {self.changed} over No. {self.other}: {side}"

    def true_of(self, found: float) -> bool:
        """Whether a ratio is what the statement says."""
        return found > MARGIN if self.higher else found < 1.0 / MARGIN

    @property
    def settle(self) -> bool:
        """Whether it needs settling times, which take longer runs than the paper's 20 s."""
        return any(name.startswith("settling") for name in (self.measure, *self.words))

    def _value(self, scene: Scene, name: str) -> float:
        """A measure of a scene."""
        return float(getattr(measure(scene, self.settle), name))

    def scenes(self, cases: Cases, starts: Sequence[Start]) -> Iterator[tuple[Scene, bool]]:
        """All scenes that `judge` measures, and whether until they settle, for several processes."""
        return ((scene, self.settle) for scene in self._scenes(cases, starts))

    def _scenes(self, cases: Cases, starts: Sequence[Start]) -> Iterator[Scene]:
        changed, other = cases[self.changed], cases[self.other]
        yield from (changed, other)
        for start in (*ALIKE, *READ_STARTS.values(), *starts):
            yield from (started(changed, start), started(other, start))
        for start in starts[:SWEPT]:
            yield from (started(with_values(other, {self.letter: value}), start) for value in self.values)
        for _, numbers in self.others:
            yield from (started(with_values(cases[STANDARD], dict(numbers)), start) for start in starts)

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Measure and check."""
        checks = [self._printed(cases), *self._alike(cases), self._random(cases, starts, self.measure)]
        checks += [*self._sweep(cases, starts), *self._readings(cases)]
        checks += [self._random(cases, starts, word) for word in self.words]
        checks += [self._against(cases, starts, text, dict(numbers)) for text, numbers in self.others]
        return Part(self.statement, self.threshold, self.why, checks)

    def _check(self, kind: Kind, text: str, changed: Scene, other: Scene) -> Check:
        a, b = (self._value(scene, self.measure) for scene in (changed, other))
        found = ratio(a, b)
        unit = UNITS[self.measure]
        value = f"{a:.4g}{unit} against {b:.4g}{unit}: {found:.3g}"
        return Check(kind, text, value, float(self.true_of(found)), self.true_of(found))

    def _printed(self, cases: Cases) -> Check:
        changed, other = cases[self.changed], cases[self.other]
        text = f"No. {self.changed} and No. {self.other} as they are printed"
        if start_of(changed) != start_of(other):
            text += ", from different starts"
        return self._check(Kind.PRINTED, text, changed, other)

    def _alike(self, cases: Cases) -> list[Check]:
        return [
            self._check(
                Kind.ALIKE,
                f"both from {start.x_l:g}, {start.x_r:g} m",
                started(cases[self.changed], start),
                started(cases[self.other], start),
            )
            for start in ALIKE
        ]

    def _readings(self, cases: Cases) -> list[Check]:
        return [
            self._check(
                Kind.READING,
                f"both from {text}",
                started(cases[self.changed], start),
                started(cases[self.other], start),
            )
            for text, start in READ_STARTS.items()
            if start not in ALIKE
        ]

    def _random(self, cases: Cases, starts: Sequence[Start], word: str) -> Check:
        found = [
            ratio(*(self._value(started(cases[number], start), word) for number in (self.changed, self.other)))
            for start in starts
        ]
        kind, text = (
            (Kind.RANDOM, NAMES[word]) if word == self.measure else (Kind.WORD, f"{NAMES[word]}, random starts")
        )
        return self._shared(kind, text, found)

    def _shared(self, kind: Kind, text: str, found: Sequence[float]) -> Check:
        share = sum(map(self.true_of, found)) / len(found)
        low, middle, high = np.quantile(found, (0.0, 0.5, 1.0), method="nearest")
        value = f"{share:.0%} of {len(found)}; ratio {middle:.3g}, from {low:.3g} to {high:.3g}"
        return Check(kind, text, value, share, almost_all(share))

    def _sweep(self, cases: Cases, starts: Sequence[Start]) -> list[Check]:
        """The parameter alone, changed from the other case, at several values: the median over some random starts."""
        if not self.values:
            return []
        medians = [middle for _, middle in self.curve(cases, starts)]
        share = sum(map(self.true_of, medians)) / len(medians)
        standard = value_of(cases[self.other], self.letter)
        pairs = ", ".join(f"{value:g}: {middle:.3g}" for value, middle in zip(self.values, medians, strict=True))
        text = f"{self.letter} beside {standard:g}, median ratio of {len(starts[:SWEPT])} random starts"
        opposite = any(middle < 1.0 / MARGIN if self.higher else middle > MARGIN for middle in medians)
        return [Check(Kind.SWEEP, text, pairs, share, share > HALF and not opposite)]

    def curve(self, cases: Cases, starts: Sequence[Start]) -> list[tuple[float, float]]:
        """Value of the parameter and median ratio, over the sweep."""
        other, few = cases[self.other], starts[:SWEPT]
        before = [self._value(started(other, start), self.measure) for start in few]
        return [
            (
                value,
                float(
                    np.quantile(
                        [
                            ratio(
                                self._value(
                                    started(with_values(other, {self.letter: value}), start), self.measure
                                ),
                                reference,
                            )
                            for start, reference in zip(few, before, strict=True)
                        ],
                        0.5,
                        method="nearest",
                    )
                ),
            )
            for value in self.values
        ]

    def _against(self, cases: Cases, starts: Sequence[Start], text: str, numbers: dict[str, float]) -> Check:
        other = with_values(cases[STANDARD], numbers)
        found = [
            ratio(*(self._value(started(scene, start), self.measure) for scene in (cases[self.changed], other)))
            for start in starts
        ]
        return self._shared(Kind.READING, f"against {text}, random starts", found)

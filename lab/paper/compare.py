"""Statements that compare two scenes: the ratio of a measure, wherever a reading leaves room."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.scene import Scene
from lab.paper.cases import (
    ALIKE,
    STANDARD,
    Cases,
    Start,
    read_starts,
    start_of,
    started,
    value_of,
    with_values,
)
from lab.paper.claims import HALF, Check, Kind, Part, almost_all
from lab.paper.measures import MARGIN, NAMES, UNITS, near, over, ratio, seconds
from lab.paper.scatter import Median, median
from lab.paper.symmetry import where_false


class Variant(NamedTuple):
    """A case of the paper, or one with other numbers."""

    case: int
    values: tuple[tuple[str, float], ...] = ()  # by the paper's letters
    name: str = ""

    def scene(self, cases: Cases) -> Scene:
        """What is simulated."""
        return with_values(cases[self.case], dict(self.values)) if self.values else cases[self.case]

    def __str__(self) -> str:
        changes = ", ".join(f"{letter} = {value:g}" for letter, value in self.values)
        return self.name or (f"No. {self.case} with {changes}" if changes else f"No. {self.case}")


FIRST = Variant(STANDARD)
HIGHER, LOWER = True, False


class Comparison(NamedTuple):
    """A measure of one scene is higher, or lower, than that of others."""

    statement: str
    measure: str
    changed: Variant
    higher: bool
    why: str
    letter: str = ""  # of the parameter behind it, and its values, beside that of the first of the others
    values: tuple[float, ...] = ()
    words: tuple[str, ...] = ()  # other measures that the sentence may mean
    others: tuple[Variant, ...] = (FIRST,)  # each decides
    pairs: tuple[tuple[Variant, Variant], ...] = ()  # more comparisons that decide
    reading: bool = False

    @property
    def decisive(self) -> list[tuple[Variant, Variant]]:
        """All that is compared."""
        return [*((self.changed, other) for other in self.others), *self.pairs]

    @property
    def other(self) -> Variant:
        """What the sweep begins from."""
        return self.others[0]

    @property
    def threshold(self) -> str:
        """In words."""
        side = f"above {MARGIN:g}" if self.higher else f"below {1.0 / MARGIN:.3g}"
        return f"{NAMES[self.measure]}, {', '.join(f'{a} over {b}' for a, b in self.decisive)}: {side}"

    def true_of(self, found: float) -> bool:
        """Whether a ratio is what the statement says."""
        return found > MARGIN if self.higher else found < 1.0 / MARGIN

    def strict(self, found: float) -> bool:
        """Whether a ratio is so by whatever amount."""
        return found > 1.0 if self.higher else found < 1.0

    def _several(self, start: Start) -> tuple[Start, ...]:
        """Where a scene is measured from in place of one start: of times from all that cannot be told apart."""
        return near(start) if self.measure == "settling" else (start,)

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Measure and check."""
        checks = []
        for pair in self.decisive:
            checks += [self._printed(cases, *pair), *self._alike(cases, *pair)]
            checks.append(self._random(cases, starts, self.measure, *pair))
        curve = self.curve(cases, starts)
        checks += self._sweep(cases, starts, curve)
        for pair in self.decisive:
            checks += [*self._readings(cases, *pair), self._at_all(cases, starts, *pair)]
        checks += [self._random(cases, starts, word, self.changed, self.other) for word in self.words]
        return Part(self.statement, self.threshold, self.why, checks, self.reading, curve)

    def _check(self, kind: Kind, text: str, changed: Scene, other: Scene) -> Check:
        several = (over(scene, self._several(start_of(scene)), self.measure) for scene in (changed, other))
        pairs = list(zip(*several, strict=True))
        found = [ratio(a, b) for a, b in pairs]
        share = sum(map(self.true_of, found)) / len(found)
        if np.isnan(found).all():  # equal arms from a symmetric start, say: true, or not, whatever the other scene is
            return Check(Kind.TRIVIAL, text, f"{pairs[0][0]:.4g} against 0: no ratio", 0.0, False)
        unit = UNITS.get(self.measure, "")
        a, b = (
            seconds(several) if self.measure.startswith("settling") else f"{several[0]:.4g}{unit}"
            for several in zip(*pairs, strict=True)
        )
        return Check(kind, text, f"{a} against {b}: {_range(found)}", share, share == 1.0)

    def _printed(self, cases: Cases, changed: Variant, other: Variant) -> Check:
        scenes = changed.scene(cases), other.scene(cases)
        text = f"{changed} and {other} as they are printed"
        if start_of(scenes[0]) != start_of(scenes[1]):
            text += ", from different starts"
        return self._check(Kind.PRINTED, text, *scenes)

    def _alike(self, cases: Cases, changed: Variant, other: Variant) -> list[Check]:
        return [
            self._check(
                Kind.ALIKE,
                f"{changed} and {other}, both from {start.x_l:g}, {start.x_r:g} m",
                started(changed.scene(cases), start),
                started(other.scene(cases), start),
            )
            for start in ALIKE
        ]

    def _readings(self, cases: Cases, changed: Variant, other: Variant) -> list[Check]:
        a, b = changed.scene(cases), other.scene(cases)
        return [
            self._check(Kind.READING, f"{changed} and {other}, both from {text}", started(a, start), started(b, start))
            for text, start in read_starts(a, b).items()
            if start not in ALIKE
        ]

    def _ratios(
        self, cases: Cases, starts: Sequence[Start], word: str, changed: Variant, other: Variant
    ) -> list[float]:
        several = (over(each.scene(cases), starts, word) for each in (changed, other))
        return [ratio(a, b) for a, b in zip(*several, strict=True)]

    def _random(
        self, cases: Cases, starts: Sequence[Start], word: str, changed: Variant, other: Variant
    ) -> Check:
        found = self._ratios(cases, starts, word, changed, other)
        kind = Kind.RANDOM if word == self.measure else Kind.WORD
        true = [self.true_of(each) for each in found]
        share = sum(true) / len(true)
        low, middle, high = np.quantile(found, (0.0, 0.5, 1.0), method="nearest")
        value = f"{_percent(share)} of {len(found)}; ratio {middle:.3g}, from {low:.3g} to {high:.3g}"
        if kind is Kind.RANDOM:
            value += where_false(starts, true)
        return Check(kind, f"{NAMES[word]}, {changed} and {other}", value, share, almost_all(share), len(found))

    def _at_all(self, cases: Cases, starts: Sequence[Start], changed: Variant, other: Variant) -> Check:
        """The same without the margin."""
        found = self._ratios(cases, starts, self.measure, changed, other)
        share = sum(map(self.strict, found)) / len(found)
        text = f"by whatever amount, {changed} and {other}, random starts"
        return Check(Kind.WORD, text, f"{_percent(share)} of {len(found)}", share, almost_all(share))

    def _sweep(self, cases: Cases, starts: Sequence[Start], curve: Sequence[tuple[float, Median]]) -> list[Check]:
        """The parameter alone, changed from the other case, at several values: the median over the random starts.

        A value counts where the whole interval of its median lies on one side.
        """
        if not curve:
            return []
        share = sum(self.true_of(found.low) and self.true_of(found.high) for _, found in curve) / len(curve)
        standard = value_of(self.other.scene(cases), self.letter)
        text = f"{self.letter} beside {standard:g}, median ratio of {len(starts)} random starts (95 % interval)"
        opposite = [value for value, found in curve if self._against(found.low) and self._against(found.high)]
        pairs = ", ".join(f"{value:g}: {found}" for value, found in curve)
        at, lowest = min(curve, key=lambda point: point[1].middle)
        if lowest.high < min(curve[0][1].low, curve[-1][1].low):
            pairs += f"; lowest at {at:g}"
        if opposite:
            pairs += f"; the other way round at {', '.join(f'{value:g}' for value in opposite)}"
        return [Check(Kind.SWEEP, text, pairs, share, share > HALF and not opposite)]

    def _against(self, found: float) -> bool:
        """Whether a ratio is the other way round."""
        return found < 1.0 / MARGIN if self.higher else found > MARGIN

    def curve(self, cases: Cases, starts: Sequence[Start]) -> list[tuple[float, Median]]:
        """Value of the parameter and median ratio, over the sweep."""
        if not self.values:
            return []
        other = self.other.scene(cases)
        before = over(other, starts, self.measure)
        swept = {value: over(with_values(other, {self.letter: value}), starts, self.measure) for value in self.values}
        return [(value, median([ratio(a, b) for a, b in zip(found, before, strict=True)]))
                for value, found in swept.items()]


def _range(found: Sequence[float]) -> str:
    """Ratios from starts that cannot be told apart."""
    low, high = (f"{each:.3g}" for each in (min(found), max(found)))
    return low if low == high else f"{low} to {high}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"

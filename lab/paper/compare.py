"""Statements that compare two scenes: the ratio of a measure, wherever a reading leaves room."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.scene import Scene
from lab.paper.cases import ALIKE, STANDARD, Cases, Start, read_starts, start_of, started, value_of, with_values
from lab.paper.claims import ALMOST_ALL, HALF, Check, Kind, Part
from lab.paper.measures import MARGIN, MEASURES, near, over, ratio, seconds
from lab.paper.scatter import Median, median, where_false


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


Pair = tuple[Variant, Variant]  # one over the other
FIRST = Variant(STANDARD)
HIGHER, LOWER = True, False


class Comparison(NamedTuple):
    """A measure of one scene is higher, or lower, than that of others."""

    statement: str
    measure: str
    changed: Variant
    higher: bool
    why: str
    letter: str = ""  # of the parameter behind it, and its values, in place of that of the first of the others
    values: tuple[float, ...] = ()
    words: tuple[str, ...] = ()  # other measures that the sentence may mean
    others: tuple[Variant, ...] = (FIRST,)  # each decides
    pairs: tuple[Pair, ...] = ()  # more comparisons that decide
    reading: bool = False

    @property
    def decisive(self) -> list[Pair]:
        """All that is compared."""
        return [*((self.changed, other) for other in self.others), *self.pairs]

    @property
    def threshold(self) -> str:
        """In words."""
        side = f"above {MARGIN:g}" if self.higher else f"below {1.0 / MARGIN:.3g}"
        return f"{MEASURES[self.measure].name}, {', '.join(f'{a} over {b}' for a, b in self.decisive)}: {side}"

    def true_of(self, found: float, margin: float = MARGIN) -> bool:
        """Whether a ratio is what the statement says."""
        return past(found, self.higher, margin)

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Measure and check."""
        checks, curve = [], self.curve(cases, starts)
        for pair in self.decisive:
            a, b = (each.scene(cases) for each in pair)
            other = ", from different starts" if start_of(a) != start_of(b) else ""
            checks.append(self._check(Kind.PRINTED, f"{_words(pair)} as they are printed{other}", a, b))
            for start in ALIKE:
                text = f"{_words(pair)}, both from {start.x_l:g}, {start.x_r:g} m"
                checks.append(self._check(Kind.ALIKE, text, started(a, start), started(b, start)))
            checks.append(self._random(cases, starts, self.measure, pair))
        checks += self._sweep(cases, starts, curve)
        for pair in self.decisive:
            a, b = (each.scene(cases) for each in pair)
            for text, start in read_starts(a, b).items():
                if start not in ALIKE:
                    text = f"{_words(pair)}, both from {text}"
                    checks.append(self._check(Kind.READING, text, started(a, start), started(b, start)))
            true = [self.true_of(found, 1.0) for found in _ratios(cases, starts, self.measure, pair)]
            text = f"by whatever amount, {_words(pair)}, random starts"
            share = sum(true) / len(true)
            checks.append(Check(Kind.WORD, text, f"{_percent(share)} of {len(true)}", share, share >= ALMOST_ALL))
        checks += [self._random(cases, starts, word, self.decisive[0]) for word in self.words]
        return Part(self.statement, self.threshold, self.why, checks, self.reading, curve)

    def _check(self, kind: Kind, text: str, changed: Scene, other: Scene) -> Check:
        """From one start; of times from all that cannot be told apart from it."""
        beside = near if self.measure == "settling" else lambda start: (start,)
        several = [over(scene, beside(start_of(scene)), self.measure) for scene in (changed, other)]
        found = [ratio(a, b) for a, b in zip(*several, strict=True)]
        if np.isnan(found).all():  # equal arms from a symmetric start, say: true, or not, whatever the other scene is
            return Check(Kind.TRIVIAL, text, f"{several[0][0]:.4g} against 0: no ratio", 0.0, False)
        share = sum(map(self.true_of, found)) / len(found)
        unit = MEASURES[self.measure].unit
        a, b = (seconds(own) if self.measure.startswith("settling") else f"{own[0]:.4g}{unit}" for own in several)
        return Check(kind, text, f"{a} against {b}: {_range(found)}", share, share == 1.0)

    def _random(self, cases: Cases, starts: Sequence[Start], word: str, pair: Pair) -> Check:
        found = _ratios(cases, starts, word, pair)
        kind = Kind.RANDOM if word == self.measure else Kind.WORD
        true = [self.true_of(each) for each in found]
        share = sum(true) / len(true)
        low, middle, high = np.quantile(found, (0.0, 0.5, 1.0), method="nearest")
        value = f"{_percent(share)} of {len(found)}; ratio {middle:.3g}, from {low:.3g} to {high:.3g}"
        if kind is Kind.RANDOM:
            value += where_false(starts, true)
        return Check(kind, f"{MEASURES[word].name}, {_words(pair)}", value, share, share >= ALMOST_ALL, len(found))

    def _sweep(self, cases: Cases, starts: Sequence[Start], curve: Sequence[tuple[float, Median]]) -> list[Check]:
        """The parameter alone, changed from the other case, at several values: the median over the random starts.

        A value counts where the whole interval of its median lies on one side.
        """
        if not curve:
            return []
        share = sum(wholly(found, self.higher) for _, found in curve) / len(curve)
        standard = value_of(self.others[0].scene(cases), self.letter)
        text = f"{self.letter} in place of {standard:g}, median ratio of {len(starts)} random starts (95 % interval)"
        opposite = [value for value, found in curve if wholly(found, not self.higher)]
        pairs = ", ".join(f"{value:g}: {found}" for value, found in curve)
        at, lowest = min(curve, key=lambda point: point[1].middle)
        if lowest.high < min(curve[0][1].low, curve[-1][1].low):
            pairs += f"; lowest at {at:g}"
        if opposite:
            pairs += f"; the other way round at {', '.join(f'{value:g}' for value in opposite)}"
        return [Check(Kind.SWEEP, text, pairs, share, share > HALF and not opposite)]

    def curve(self, cases: Cases, starts: Sequence[Start]) -> list[tuple[float, Median]]:
        """Value of the parameter and median ratio, over the sweep."""
        other = self.others[0].scene(cases)
        before = over(other, starts, self.measure) if self.values else []
        swept = {value: over(with_values(other, {self.letter: value}), starts, self.measure) for value in self.values}
        return [(value, median([ratio(a, b) for a, b in zip(found, before, strict=True)]))
                for value, found in swept.items()]


def past(found: float, higher: bool, margin: float = MARGIN) -> bool:
    """Whether a ratio is on one side of 1, by a factor."""
    return found > margin if higher else found < 1.0 / margin


def wholly(found: Median, higher: bool) -> bool:
    """Whether the whole interval of a median is."""
    return past(found.low, higher) and past(found.high, higher)


def _words(pair: Pair) -> str:
    return f"{pair[0]} and {pair[1]}"


def _ratios(cases: Cases, starts: Sequence[Start], measure: str, pair: Pair) -> list[float]:
    changed, other = (over(each.scene(cases), starts, measure) for each in pair)
    return [ratio(a, b) for a, b in zip(changed, other, strict=True)]


def _range(found: Sequence[float]) -> str:
    """Ratios from starts that cannot be told apart."""
    low, high = (f"{each:.3g}" for each in (min(found), max(found)))
    return low if low == high else f"{low} to {high}"


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"

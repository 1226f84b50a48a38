"""Statements that say the same of every motion, or of some: one test of a scene, over cases, starts and sweeps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from grasp_ros.scene import Scene
from grasp_ros.studies.paper.cases import NUMBERS, READ_STARTS, SEED, STANDARD, Cases, Start, started, with_values
from grasp_ros.studies.paper.claims import Check, Kind, Part, almost_all

FEW = 20  # random starts of each case and of each value of a sweep


class Found(NamedTuple):
    """What a test says of one scene: a number, and whether the statement is true there."""

    value: float
    holds: bool


Test = Callable[[Scene], Found]


class Universal(NamedTuple):
    """A statement about each of some cases."""

    statement: str
    threshold: str
    test: Test
    why: str
    cases: tuple[int, ...] = NUMBERS
    letter: str = ""  # of the parameter that is swept from the standard case
    values: tuple[float, ...] = ()
    least: bool = False  # whether the smallest number is the one to print, not the largest
    extra: tuple[tuple[str, Callable[[Cases], Scene]], ...] = ()  # other scenes that the words include: text, scene
    unit: str = ""

    def scenes(self, cases: Cases, starts: Sequence[Start]) -> Iterator[tuple[Scene, bool]]:
        """Scenes that can be measured ahead: none; the tests are quick."""
        return iter(())

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Test and check."""
        few = starts[:FEW]
        texts = ", ".join(map(str, self.cases)) if len(self.cases) < len(NUMBERS) else "1 to 11"
        own = [self.test(cases[number]) for number in self.cases]
        checks = [self._all(Kind.PRINTED, f"No. {texts}, as printed", own, self._which(own))]
        drawn = [self.test(started(cases[number], start)) for number in self.cases for start in few]
        share = sum(found.holds for found in drawn) / len(drawn)
        value = f"{share:.0%} of {len(drawn)}; {self._extreme(drawn)}"
        checks.append(Check(Kind.RANDOM, f"No. {texts}", value, share, share == 1.0))
        for value_ in self.values:
            scene = with_values(cases[STANDARD], {self.letter: value_})
            found = [self.test(started(scene, start)) for start in few]
            checks.append(self._all(Kind.SWEEP, f"{self.letter} = {value_:g}, {len(few)} random starts", found))
        for text, start in READ_STARTS.items():
            found = [self.test(started(cases[number], start)) for number in self.cases]
            checks.append(self._all(Kind.READING, text, found, self._which(found)))
        checks += [self._all(Kind.READING, text, [self.test(build(cases))]) for text, build in self.extra]
        return Part(self.statement, self.threshold, self.why, checks)

    def _all(self, kind: Kind, text: str, found: Sequence[Found], which: str = "") -> Check:
        share = sum(each.holds for each in found) / len(found)
        counted = f"{share:.0%} of {len(found)}; " if len(found) > 1 else ""
        return Check(kind, text, f"{counted}{self._extreme(found)}{which}", share, share == 1.0)

    def _which(self, found: Sequence[Found]) -> str:
        """Names the cases that fail."""
        failing = [str(number) for number, each in zip(self.cases, found, strict=True) if not each.holds]
        return f"; not in No. {', '.join(failing)}" if failing else ""

    def _extreme(self, found: Sequence[Found]) -> str:
        values = [each.value for each in found]
        name, value = ("smallest", min(values)) if self.least else ("largest", max(values))
        return f"{name} {value:.3g}{self.unit}" if len(values) > 1 else f"{value:.3g}{self.unit}"


class Share(NamedTuple):
    """How many of the random starts a statement is true of, with the same start for every case that it needs."""

    statement: str
    threshold: str
    test: Callable[[Cases, Start], Found]
    why: str
    printed: Start
    unit: str = ""

    def scenes(self, cases: Cases, starts: Sequence[Start]) -> Iterator[tuple[Scene, bool]]:
        """None ahead."""
        return iter(())

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Test and check."""
        own = self.test(cases, self.printed)
        checks = [
            Check(Kind.PRINTED, "from the printed start", f"{own.value:.3g}{self.unit}", float(own.holds), own.holds)
        ]
        drawn = [self.test(cases, start) for start in starts[: 2 * FEW]]
        share = sum(found.holds for found in drawn) / len(drawn)
        values = sorted(found.value for found in drawn)
        text = (
            f"{share:.0%} of {len(drawn)}; {values[len(values) // 2]:.3g}{self.unit} in the middle, "
            f"from {values[0]:.3g} to {values[-1]:.3g}"
        )
        checks.append(Check(Kind.RANDOM, f"seed {SEED}", text, share, almost_all(share)))
        for name, start in READ_STARTS.items():
            found = self.test(cases, start)
            checks.append(Check(Kind.READING, name, f"{found.value:.3g}{self.unit}", float(found.holds), found.holds))
        return Part(self.statement, self.threshold, self.why, checks)

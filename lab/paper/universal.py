"""Statements that say the same of every motion, or of some: one test of a scene, over cases, starts and sweeps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from grasp_ros.scene import Scene
from lab.paper.cases import NUMBERS, PRINTED, READ_P, SEED, STANDARD, Cases, Start, read_starts, started, with_values
from lab.paper.claims import ALMOST_ALL, Check, Kind, Part

FEW = 20  # random starts of each case
FEWER = 10  # of each value of a sweep
LARGER = 4  # the case whose p the paper does not print


class Found(NamedTuple):
    """What a test says of one scene: a number, whether the statement is true there, and the number as text."""

    value: float
    holds: bool
    text: str = ""  # where the number alone would say more than is known


class Test(NamedTuple):
    """What finds a number in a scene, or in some cases from a start; its threshold in words, and how it is printed."""

    find: Callable[..., Found]
    threshold: str
    unit: str = ""
    least: bool = False  # whether the smallest of several numbers is the one to print, not the largest

    def __call__(self, *asked: Any) -> Found:
        """What is found."""
        return self.find(*asked)

    def of(self, *first: Any) -> Test:
        """The same with its first arguments."""
        return self._replace(find=partial(self.find, *first))

    def text(self, found: Found) -> str:
        """A number to print."""
        return found.text or f"{found.value:.3g}{self.unit}"


def threshold(words: str, unit: str = "", *, least: bool = False) -> Callable[[Callable[..., Found]], Test]:
    """Make a function a test."""
    return lambda find: Test(find, words, unit, least)


class Universal(NamedTuple):
    """A statement about each of some cases."""

    statement: str
    test: Test  # of a scene
    why: str
    cases: tuple[int, ...] = NUMBERS
    letter: str = ""  # of the parameter that is swept
    values: tuple[float, ...] = ()
    base: int = STANDARD  # the case that the sweep begins from
    extra: tuple[tuple[str, Callable[[Cases], Scene]], ...] = ()  # other scenes that the words include: text, scene
    reading: bool = False

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Test and check."""
        few, fewer = starts[:FEW], starts[:FEWER]
        own = [self.test(cases[number]) for number in self.cases]
        checks = [self._all(Kind.PRINTED, f"{_named(self.cases)}, as printed", own, self._which(own))]
        checks += self._random(cases, few)
        for value in self.values:
            scene = with_values(cases[self.base], {self.letter: value})
            found = [self.test(started(scene, start)) for start in fewer]
            checks.append(
                self._all(Kind.SWEEP, f"No. {self.base}, {self.letter} = {value:g}, {len(fewer)} random starts", found)
            )
        for text, start in read_starts(*(cases[number] for number in self.cases)).items():
            found = [self.test(started(cases[number], start)) for number in self.cases]
            checks.append(self._all(Kind.READING, text, found, self._which(found)))
        if LARGER in self.cases:
            found = [self.test(with_values(cases[LARGER], {"p": p})) for p in READ_P]
            checks.append(self._all(Kind.READING, f"p of No. {LARGER}: {', '.join(map(str, READ_P))} s/m", found))
        checks += [self._all(Kind.READING, text, [self.test(build(cases))]) for text, build in self.extra]
        return Part(self.statement, self.test.threshold, self.why, checks, self.reading)

    def _random(self, cases: Cases, few: Sequence[Start]) -> list[Check]:
        """Cases of which it is always, or never, true together, and others by themselves: none hides in a crowd."""
        drawn = {number: [self.test(started(cases[number], start)) for start in few] for number in self.cases}
        shares = {number: sum(each.holds for each in found) / len(found) for number, found in drawn.items()}
        always, never = ([number for number in self.cases if shares[number] == share] for share in (1.0, 0.0))
        mixed = [[number] for number in self.cases if number not in always + never]
        groups = [group for group in (always, never, *mixed) if group]
        return [
            self._all(Kind.RANDOM, _named(group), [each for number in group for each in drawn[number]])
            for group in groups
        ]

    def _all(self, kind: Kind, text: str, found: Sequence[Found], which: str = "") -> Check:
        share = sum(each.holds for each in found) / len(found)
        counted = f"{share:.0%} of {len(found)}; " if len(found) > 1 else ""
        return Check(kind, text, f"{counted}{self._extreme(found)}{which}", share, share == 1.0)

    def _which(self, found: Sequence[Found]) -> str:
        """Names the cases that fail."""
        if len(self.cases) == 1:
            return ""
        failing = [str(number) for number, each in zip(self.cases, found, strict=True) if not each.holds]
        return f"; not in No. {', '.join(failing)}" if failing else ""

    def _extreme(self, found: Sequence[Found]) -> str:
        name, best = ("smallest", min) if self.test.least else ("largest", max)
        text = self.test.text(best(found, key=lambda each: each.value))
        return f"{name} {text}" if len(found) > 1 else text


class Share(NamedTuple):
    """How many of the random starts a statement is true of, with the same start for every case that it needs."""

    statement: str
    test: Test  # of the cases and a start
    why: str
    of: tuple[int, ...]  # the cases that the test looks at
    letter: str = ""  # swept in the first of the cases
    values: tuple[float, ...] = ()
    starts: int = 2 * FEW  # at most
    reading: bool = False

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Test and check."""
        own = self.test(cases, PRINTED)
        checks = [Check(Kind.PRINTED, "from the printed start", self.test.text(own), float(own.holds), own.holds)]
        drawn = [self.test(cases, start) for start in starts[: self.starts]]
        checks.append(self._many(Kind.RANDOM, f"seed {SEED}", drawn))
        first = self.of[0]
        for value in self.values:
            changed = {**cases, first: with_values(cases[first], {self.letter: value})}
            found = [self.test(changed, start) for start in starts[:FEWER]]
            text = f"No. {first} with {self.letter} = {value:g}, {len(found)} random starts"
            checks.append(self._many(Kind.SWEEP, text, found))
        for name, start in read_starts(*(cases[number] for number in self.of)).items():
            each = self.test(cases, start)
            checks.append(Check(Kind.READING, name, self.test.text(each), float(each.holds), each.holds))
        return Part(self.statement, self.test.threshold, self.why, checks, self.reading)

    def _many(self, kind: Kind, text: str, drawn: Sequence[Found]) -> Check:
        share = sum(found.holds for found in drawn) / len(drawn)
        values = sorted(found.value for found in drawn)
        value = (
            f"{100.0 * share:.3g} % of {len(drawn)}; {values[len(values) // 2]:.3g}{self.test.unit} in the middle, "
            f"from {values[0]:.3g} to {values[-1]:.3g}"
        )
        return Check(kind, text, value, share, share >= ALMOST_ALL, len(drawn))


def _named(numbers: Sequence[int]) -> str:
    if tuple(numbers) == NUMBERS:
        return f"No. {NUMBERS[0]} to {NUMBERS[-1]}"
    return f"No. {', '.join(map(str, numbers))}"

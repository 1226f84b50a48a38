"""From checks to verdicts: one rule for every statement of the paper.

A part of a statement is checked in up to six ways. Its verdict follows from four of them: the paper's cases as printed,
the same start for both cases, random starts, and a sweep of the parameter behind it.

* *holds*: all of these hold; of random starts, at least 95 % do.
* *does not hold*: less than half of the random starts hold, in whatever case and against whatever it is compared with;
  where no start is random, of the paper's own cases.
* *holds within stated limits*: all else; the checks that fail are the limits.

Other readings of the source and other measures of the same word do not enter the verdict: those by which it would come
out the other way are named beside it. A statement of several parts holds as far as its weakest part does; a part may
restate another reading of the whole sentence, and does not enter then either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import NamedTuple, Protocol

from lab.paper.cases import Cases, Start
from lab.paper.scatter import Median

ALMOST_ALL, HALF = 0.95, 0.5  # of the random starts


class Verdict(Enum):
    """What becomes of a statement, from the weakest to the strongest."""

    FAILS = "does not hold"
    LIMITED = "holds within stated limits"
    HOLDS = "holds"


class Kind(Enum):
    """How a statement is checked."""

    PRINTED = "the paper's cases"
    ALIKE = "same start"
    RANDOM = "random starts"
    SWEEP = "sweep"
    TRIVIAL = "by construction"
    READING = "other reading"
    WORD = "other measure"


DECISIVE = (Kind.PRINTED, Kind.ALIKE, Kind.RANDOM, Kind.SWEEP)


class Check(NamedTuple):
    """One check of one part: how, on what, what was found, and in which share it holds."""

    kind: Kind
    text: str
    value: str
    share: float  # of the runs that were looked at, 0 to 1
    holds: bool
    runs: int = 0  # that were drawn, where they were

    @property
    def close(self) -> bool:
        """Whether other draws could put the share on the other side of a bound of the rule: two standard errors."""
        error = (self.share * (1.0 - self.share) / self.runs) ** 0.5 if self.runs else 0.0
        return any(abs(self.share - bound) < 2.0 * error for bound in (ALMOST_ALL, HALF))

    @property
    def brief(self) -> str:
        """What was found: of a sweep how many of its values, not each; of random starts no range."""
        if self.kind is Kind.SWEEP and ": " in self.value:
            _, _, other = self.value.partition("; ")
            return f"in {self.share:.0%} of its values" + (f", {other}" if other else "")
        return self.value.partition(", from")[0] if self.kind is Kind.RANDOM else self.value


class Part(NamedTuple):
    """One statement with one threshold."""

    statement: str
    threshold: str
    why: str  # the physics behind it, a sentence
    checks: Sequence[Check]
    reading: bool = False  # of another reading of the sentence
    curve: Sequence[tuple[float, Median]] = ()  # the sweep: value of its parameter, and median ratio

    @property
    def verdict(self) -> Verdict:
        """The rule at the head of this file."""
        if not self.limits:
            return Verdict.HOLDS
        drawn = [check.share for check in self.checks if check.kind is Kind.RANDOM]
        decisive = drawn or [check.share for check in self.checks if check.kind is Kind.PRINTED]
        return Verdict.FAILS if all(share < HALF for share in decisive) else Verdict.LIMITED

    @property
    def limits(self) -> list[Check]:
        """Checks that fail, of those that decide."""
        return [check for check in self.checks if check.kind in DECISIVE and not check.holds]

    @property
    def gravest(self) -> Check:
        """What weighs most of the limits, if there are any."""
        return next((check for check in self.limits if check.kind is Kind.RANDOM), self.limits[0])

    @property
    def limits_in_short(self) -> str:
        """The gravest, and how many more there are."""
        check = self.gravest
        return f"{check.kind.value}, {check.text}: {check.brief}{_more(self.limits)}"

    @property
    def turned_in_short(self) -> str:
        """The first of `turned`, and how many more there are."""
        return self.turned[0].text + _more(self.turned)

    @property
    def close(self) -> list[Check]:
        """Random starts that others could turn."""
        return [check for check in self.checks if check.kind is Kind.RANDOM and check.close]

    @property
    def turned(self) -> list[Check]:
        """Readings and measures by which the statement would come out the other way."""
        fails = self.verdict is Verdict.FAILS
        return [
            check
            for check in self.checks
            if check.kind in (Kind.READING, Kind.WORD) and (check.holds if fails else check.share < HALF)
        ]


class Claim(NamedTuple):
    """A statement of the paper, restated, with what was found."""

    key: str
    where: str  # page and number in the paper
    statement: str
    parts: Sequence[Part]

    @property
    def weakest(self) -> Part:
        """The part that decides: the first of those with the weakest verdict."""
        order = list(Verdict)
        return min((part for part in self.parts if not part.reading), key=lambda part: order.index(part.verdict))

    @property
    def verdict(self) -> Verdict:
        """That of the weakest part."""
        return self.weakest.verdict

    @property
    def turned(self) -> list[Part]:
        """Parts that read the sentence in another way and come to another verdict."""
        return [part for part in self.parts if part.reading and part.verdict is not self.verdict]


class Judged(Protocol):
    """A part that can be judged."""

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Measure and check."""


class Statement(NamedTuple):
    """A statement of the paper as it is to be judged: where it stands, what it says in our words, and its parts."""

    key: str
    where: str
    statement: str
    parts: Sequence[Judged]

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Claim:
        """Judge all parts."""
        return Claim(self.key, self.where, self.statement, [part.judge(cases, starts) for part in self.parts])


def numbered(letter: str, where: str, several: Mapping[str, Sequence[Judged]]) -> tuple[Statement, ...]:
    """Statements that the paper numbers, by their words."""
    return tuple(Statement(f"{letter}{number}", f"{where} ({number})", words, parts)
                 for number, (words, parts) in enumerate(several.items(), 1))


def tally(claims: Sequence[Claim]) -> list[str]:
    """How many hold, hold within limits and do not hold, in words."""
    found = [(sum(claim.verdict is verdict for claim in claims), verdict.value) for verdict in reversed(Verdict)]
    return [f"{count} {words if count == 1 else words.replace('holds', 'hold').replace('does', 'do')}"
            for count, words in found]


def _more(checks: Sequence[Check]) -> str:
    """How many there are beside one of them."""
    return f", and {len(checks) - 1} more" if len(checks) > 1 else ""

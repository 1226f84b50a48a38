"""A statement of the paper as it is to be judged: where it stands, what it says in our words, and its parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from lab.paper.cases import Cases, Start
from lab.paper.claims import Claim, Part


class Judged(Protocol):
    """A part that can be judged: `Comparison`, `Universal` or `Share`."""

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Part:
        """Measure and check."""


class Statement(NamedTuple):
    """One statement and its parts."""

    key: str
    where: str
    statement: str
    parts: Sequence[Judged]

    def judge(self, cases: Cases, starts: Sequence[Start]) -> Claim:
        """Judge all parts."""
        return Claim(self.key, self.where, self.statement, [part.judge(cases, starts) for part in self.parts])

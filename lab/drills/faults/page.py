"""The table of the drills, as text and as docs/faults.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from lab.drills.faults.drill import Drill, lost_words
from lab.drills.faults.verdict import LOST_SECONDS, NOTICE_SECONDS, SLACK_SECONDS, Evidence, Verdict
from lab.studies import pages

Played = tuple[Drill, Evidence]


def summary(played: Sequence[Played]) -> str:
    """How many drills ended how."""
    counts = [(verdict.value, sum(evidence.verdict is verdict for _, evidence in played)) for verdict in Verdict]
    return ", ".join(f"{words} {number}" for words, number in reversed(counts) if number)


def row(drill: Drill, evidence: Evidence) -> list[str]:
    """A row of the table."""
    if evidence.skipped:
        return [drill.fault, evidence.skipped, "", "", "", "", Verdict.SKIPPED.value]
    said = evidence.traceback or evidence.said or ("nobody can read it" if evidence.mute else "nothing")
    exits = sorted(set(evidence.exits.values()))
    same = ", ".join(map(str, exits)) if len(exits) < 2 or len(evidence.exits) < 2 else ", ".join(
        f"{name.replace('_', ' ')} {number}" for name, number in evidence.exits.items())
    left = [f"{evidence.left} processes"] * bool(evidence.left) + [f"{evidence.shared} files"] * bool(evidence.shared)
    verdict = evidence.verdict
    words = f"{verdict.value}: {evidence.wrong}" if verdict is Verdict.WRONG else verdict.value
    return [drill.fault, said, lost_words(evidence), noticed(evidence), same, ", ".join(left) or "nothing",
            words if verdict.passes else f"**{words}**"]


def noticed(evidence: Evidence) -> str:
    """How long it took until somebody said something; empty where nothing has to be said."""
    if math.isfinite(evidence.noticed):
        return f"{evidence.noticed:.1f} s"
    return "" if evidence.went_on or evidence.mute else "never"


def write(docs: Path, played: Sequence[Played]) -> None:
    """Write the page.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    groups = [(f"{group[0].upper()}{group[1:]}", [row(*pair) for pair in members])
              for group, members in groupby(played, key=lambda pair: pair[0].group)]
    pages.write(docs, "faults", number=len(played), summary=summary(played), groups=groups, notice=NOTICE_SECONDS,
                slack=SLACK_SECONDS, lost=LOST_SECONDS)

"""What became of the drills: docs/faults.md by groups, and docs/faults.csv with a row of each."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from lab.drills.faults.drill import Drill, lost_words
from lab.drills.faults.verdict import LOST_SECONDS, NOTICE_SECONDS, SLACK_SECONDS, Evidence, Verdict
from lab.studies import pages
from lab.studies.records import write_csv

Played = tuple[Drill, Evidence]


def summary(played: Sequence[Played]) -> str:
    """How many drills ended how."""
    counts = [(verdict.value, sum(evidence.verdict is verdict for _, evidence in played)) for verdict in Verdict]
    return ", ".join(f"{words} {number}" for words, number in reversed(counts) if number)


HEADS = "where", "fault", "what the user sees", "kept", "noticed", "exit", "left", "verdict"


def row(drill: Drill, evidence: Evidence) -> list[str]:
    """A row of the table of all drills."""
    if evidence.skipped:
        return [drill.group, drill.fault, evidence.skipped, "", "", "", "", Verdict.SKIPPED.value]
    said = evidence.traceback or evidence.said or ("nobody can read it" if evidence.mute else "nothing")
    exits = sorted(set(evidence.exits.values()))
    same = ", ".join(map(str, exits)) if len(exits) < 2 or len(evidence.exits) < 2 else ", ".join(
        f"{name.replace('_', ' ')} {number}" for name, number in evidence.exits.items())
    left = [f"{evidence.left} processes"] * bool(evidence.left) + [f"{evidence.shared} files"] * bool(evidence.shared)
    verdict = evidence.verdict
    words = f"{verdict.value}: {evidence.wrong}" if verdict is Verdict.WRONG else verdict.value
    return [drill.group, drill.fault, said, lost_words(evidence), noticed(evidence), same,
            ", ".join(left) or "nothing", words]


def noticed(evidence: Evidence) -> str:
    """How long it took until somebody said something; empty where nothing has to be said."""
    if math.isfinite(evidence.noticed):
        return f"{evidence.noticed:.1f} s"
    return "" if evidence.went_on or evidence.mute else "never"


def group_rows(played: Sequence[Played]) -> list[list[str]]:
    """A row for each group: how its drills ended, the latest notice, the largest loss, and a message."""
    found = []
    for group, members in groupby(played, key=lambda pair: pair[0].group):
        evidences = [evidence for _, evidence in members]
        ends = Counter(evidence.verdict for evidence in evidences)
        latest = max((evidence.noticed for evidence in evidences if evidence.noticed >= 0.0), default=0.0)
        lost = max((evidence.lost for evidence in evidences if not evidence.nothing_to_keep), default=0.0)
        said = next((evidence.said for evidence in evidences if evidence.verdict is Verdict.SENTENCE), "")
        found.append([group, str(len(evidences)), str(ends[Verdict.SURVIVED]), str(ends[Verdict.SENTENCE]),
                      f"{latest:.1f} s", f"{lost:.2f} s", said])
    return found


def write(docs: Path, played: Sequence[Played]) -> None:
    """Write the page, and the table of all drills beside it."""
    rows = [row(*pair) for pair in played]
    write_csv(HEADS, rows, docs / "faults.csv")
    failed = [words for words, (_, evidence) in zip(rows, played, strict=True)
              if not evidence.verdict.passes or evidence.skipped]
    pages.write(docs, "faults", number=len(played), summary=summary(played), heads=HEADS, failed=failed,
                groups=group_rows(played), notice=NOTICE_SECONDS, slack=SLACK_SECONDS, lost=LOST_SECONDS)

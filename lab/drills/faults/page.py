"""The table of the drills, as text and as docs/faults.md."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from lab.drills.faults.drill import Drill, lost_words
from lab.drills.faults.verdict import LOST_SECONDS, NOTICE_SECONDS, SLACK_SECONDS, Evidence, Verdict
from lab.studies import document

COMMAND = "python -m lab faults -o docs/faults.md"
HEADS = ("fault", "what the user sees", "kept", "noticed", "exit", "left", "verdict")
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


def write(path: Path, played: Sequence[Played]) -> None:
    """Write the page.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    head = document.prose(f"""
        Written by `{COMMAND}`, which plays {len(played)} accidents with real processes, each in a ROS domain of its
        own, and computes every cell. A drill passes if the graph survives, which means that it goes on and that its
        bag holds every tick and [proves itself](graph.md#a-bag-proves-itself), or if it ends with a sentence within
        {NOTICE_SECONDS:g} s of the accident (and {SLACK_SECONDS:g} s for a machine that plays two at a time), with
        all ticks but those of the last {LOST_SECONDS} s in the bag, no process left behind, and no traceback.
        """)
    parts = ["# Faults", head, f"**{summary(played)}.**"]
    for group, members in groupby(played, key=lambda pair: pair[0].group):
        parts += [f"## {group[0].upper()}{group[1:]}", document.table(HEADS, [row(*pair) for pair in members])]
    parts.append("## How to read it\n\n" + document.prose("""
        *What the user sees* is the last sentence that was printed before the run was over; of a drill that is survived,
        before it was stopped with a Ctrl-C. DIR stands for the directory, N for numbers that differ from run to run.
        *Kept* counts the ticks that the plant had published before the accident; where the monitor itself was hit,
        those that it had recorded. *Noticed* is the time from the accident to the first sentence on a terminal or the
        first report on `/diagnostics` that is not OK. *Exit* is the exit status of `grasp run`, or of the nodes that
        ended. *Left* are processes that had to be killed, and files in /dev/shm of processes that
        [were killed](graph.md). In four terminals, what still waits when plant and monitor have ended is ended with a
        Ctrl-C.
        """))
    document.write(path, "\n\n".join(parts) + "\n")

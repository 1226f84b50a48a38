"""Plays the drills, two at a time; what came of them is printed, and written by groups and with a row of each."""

from __future__ import annotations

import math
import queue
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import groupby
from pathlib import Path

from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from lab.drills.faults import network, signals, strays, surroundings
from lab.drills.faults.drill import LOST_SECONDS, NOTICE_SECONDS, SLACK_SECONDS, Drill, Evidence, Skipped, Verdict, play
from lab.drills.faults.stage import Companion, Failed, Stage, free_domains
from lab.studies import pages
from lab.studies.records import write_csv

TOGETHER = 2
SCENE, SETTINGS = "case_01", ["time.duration_s=120"]
HEADS = "where", "fault", "what the user sees", "kept", "noticed", "exit", "left", "verdict"
Played = tuple[Drill, Evidence]


def all_drills() -> list[Drill]:
    """The whole list."""
    return [*signals.drills(), *strays.drills(), *surroundings.drills(), *network.drills()]


def chosen(names: Sequence[str], quick: bool) -> list[Drill]:
    """Drills by their names, or those of `--quick`, or all; refuses a name that there is not."""
    drills = all_drills()
    known = {drill.name for drill in drills}
    if unknown := sorted(set(names) - known):
        raise Refused(f"--only: {', '.join(unknown)}: no such fault; allowed: {', '.join(sorted(known))}")
    if names:
        return [drill for drill in drills if drill.name in names]
    return [drill for drill in drills if drill.quick or not quick]


def run(drills: Sequence[Drill], docs: Path | None) -> bool:
    """Play drills, print a row of each and write the page; returns whether all pass."""
    for number in (signal.SIGINT, signal.SIGQUIT):  # ignored in the background of a shell
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    domains: queue.Queue[int] = queue.Queue()
    for domain in free_domains():
        domains.put(domain)
    if domains.qsize() < TOGETHER:
        raise Refused("no ROS domain is free; allowed: fewer graphs on this machine")
    found: dict[str, Evidence] = {}
    with tempfile.TemporaryDirectory() as directory, ThreadPoolExecutor(TOGETHER) as pool:
        companions: queue.Queue[Companion] = queue.Queue()
        for _ in range(TOGETHER):
            companions.put(Companion())
        futures = {pool.submit(_one, drill, Path(directory), companions, domains): drill for drill in drills}
        try:
            for future in tqdm(as_completed(futures), total=len(futures), unit="fault"):
                drill = futures[future]
                found[drill.name] = evidence = future.result()
                if not evidence.verdict.passes:
                    tqdm.write(f"{drill.name}: {' | '.join(row(drill, evidence))}", file=sys.stderr)
        finally:
            pool.shutdown(cancel_futures=True)
            while not companions.empty():
                companions.get().close()
    played = [(drill, found[drill.name]) for drill in drills]
    for drill, evidence in played:
        print(f"{drill.name:<28} {evidence.verdict.value:<22} {row(drill, evidence)[2]}")
    print(summary(played))
    if docs is not None:
        _write(docs, played)
    return all(evidence.verdict.passes for evidence in found.values())


def _one(drill: Drill, directory: Path, companions: queue.Queue[Companion], domains: queue.Queue[int]) -> Evidence:
    companion, domain = companions.get(), domains.get()
    stage = Stage(directory / drill.name.replace(" ", "_"), scenes.load(SCENE, SETTINGS), companion, domain, drill.seen)
    try:
        return play(drill, stage)
    except Skipped as error:
        return Evidence(skipped=str(error))
    except Failed as error:
        return Evidence(hung=True, said=f"the drill could not take place: {error}")
    finally:
        stage.clear()
        companions.put(companion)
        domains.put(domain)


def summary(played: Sequence[Played]) -> str:
    """How many drills ended how."""
    counts = [(verdict.value, sum(evidence.verdict is verdict for _, evidence in played)) for verdict in Verdict]
    return ", ".join(f"{words} {number}" for words, number in reversed(counts) if number)


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


def lost_words(evidence: Evidence) -> str:
    """What is kept, for a reader."""
    if evidence.nothing_to_keep:
        return "nothing is there to keep"
    if math.isinf(evidence.lost):
        return evidence.wrong
    if evidence.lost > LOST_SECONDS:
        return f"all but {evidence.lost:.1f} s"
    return "all" if not evidence.lost else f"all but at most {LOST_SECONDS} s"


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


def _write(docs: Path, played: Sequence[Played]) -> None:
    """Write the page, and the table of all drills beside it."""
    rows = [row(*pair) for pair in played]
    write_csv(HEADS, rows, docs / "faults.csv")
    failed = [words for words, (_, evidence) in zip(rows, played, strict=True)
              if not evidence.verdict.passes or evidence.skipped]
    pages.write(docs, "faults", number=len(played), summary=summary(played), heads=HEADS, failed=failed,
                groups=group_rows(played), notice=NOTICE_SECONDS, slack=SLACK_SECONDS, lost=LOST_SECONDS)

"""Plays the drills, two at a time, and prints what came of them."""

from __future__ import annotations

import queue
import signal
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from lab.drills.faults import network, page, signals, strays, surroundings
from lab.drills.faults.companion import Companion, Failed, free_domains
from lab.drills.faults.drill import Drill, Skipped, play
from lab.drills.faults.stage import Stage
from lab.drills.faults.verdict import Evidence

TOGETHER = 2
SCENE, SETTINGS = "case_01", ["time.duration_s=120"]


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
                    tqdm.write(f"{drill.name}: {' | '.join(page.row(drill, evidence))}", file=sys.stderr)
        finally:
            pool.shutdown(cancel_futures=True)
            while not companions.empty():
                companions.get().close()
    played = [(drill, found[drill.name]) for drill in drills]
    for drill, evidence in played:
        print(f"{drill.name:<28} {evidence.verdict.value:<22} {page.row(drill, evidence)[2]}")
    print(page.summary(played))
    if docs is not None:
        page.write(docs, played)
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

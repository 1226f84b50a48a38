"""A long run in lockstep: what it loses, and how the memory of its processes grows after its first quarter."""

from __future__ import annotations

import tempfile
import time
from contextlib import suppress
from pathlib import Path

import psutil
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.graph import bag
from grasp_ros.scene.effects.base import NANOSECONDS
from lab.drills.faults.stage import NODES, Companion, Stage, free_domains

LOOK_SECONDS = 0.5
MOST_GROWTH = 10.0  # bytes a tick, of a process, from the first quarter of the run to its end
MEGABYTE = 2**20


def run(name: str, ticks: int) -> bool:
    """Print what many ticks of a scene took; returns whether nothing was lost and memory was flat."""
    scene = scenes.load(name, [f"time.duration_s={ticks * scenes.load(name).period_ns / NANOSECONDS!r}"])
    companion = Companion()
    with tempfile.TemporaryDirectory() as directory:
        stage = Stage(Path(directory) / "long", scene, companion, free_domains()[0])
        try:
            stage.run()
            early, late, seconds = _watch(stage, ticks)
            status = stage.started["grasp run"].wait()
            found = bag.read(stage.bag)
            missing = sum(found.missing.values()) + ticks + 1 - len(found.tick)
        finally:
            stage.clear()
            companion.close()
    print(f"{scene.title}: {ticks} ticks in lockstep, {ticks / seconds:.0f} ticks/s, exit status {status}")
    print(f"lost                {missing} messages and ticks")
    growth = {node: (late[node] - early[node]) / (0.75 * ticks) for node in NODES}
    for node, grown in growth.items():
        words = f"{early[node] / MEGABYTE:.1f} MB at 25 %, {late[node] / MEGABYTE:.1f} MB at 100 %"
        print(f"{node:<19} {words}, {grown:+.2f} bytes a tick")
    return status == 0 and not missing and max(growth.values()) <= MOST_GROWTH


def _watch(stage: Stage, ticks: int) -> tuple[dict[str, int], dict[str, int], float]:
    """Memory of the nodes in bytes, early and late, and the seconds from the first tick to the last."""
    stage.settle()
    processes = {node: psutil.Process(stage.pid(node)) for node in NODES}
    begin, first = time.monotonic(), stage.published
    early: dict[str, int] = {}
    late = dict.fromkeys(NODES, 0)
    with tqdm(total=ticks, unit="tick") as progress:
        while not stage.ended("grasp run") and (now := stage.published) < ticks:
            progress.update(now - progress.n)
            with suppress(psutil.NoSuchProcess):
                late = {node: process.memory_info().rss or late[node] for node, process in processes.items()}
            if not early and 4 * now >= ticks:
                early = dict(late)
            time.sleep(LOOK_SECONDS)
        progress.update(ticks - progress.n)
    return early or late, late, (time.monotonic() - begin) * ticks / max(ticks - first, 1)

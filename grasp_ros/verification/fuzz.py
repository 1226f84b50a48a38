"""Random scenes against all properties, for as long as wanted."""

from __future__ import annotations

import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from grasp_ros.scene.files import writing
from grasp_ros.verification.cases.case import Unfinished
from grasp_ros.verification.draw import NUMBERS, draw_scene
from grasp_ros.verification.properties import Check, checks

COMPARED = 200  # every how many scenes one is compared with the reference


@dataclass
class Tally:
    """How often a property was checked, and how often it failed."""

    scenes: int = 0
    failures: int = 0

    def add(self, check: Check) -> None:
        """Count a check."""
        self.scenes += 1
        self.failures += not check.holds


def run(seconds: float, seed: int, directory: Path) -> int:
    """Draw scenes until the time is over; print what became of them, and write those that fail as YAML.

    Returns
    -------
    int
        Number of failures.

    Raises
    ------
    Refused
        If a scene that fails cannot be written.
    """
    begin = time.monotonic()
    rng = np.random.default_rng(seed)
    ends: Counter[str] = Counter()
    tallies: dict[str, Tally] = {}
    sampled = broken = 0
    with tqdm(total=seconds, unit="s", desc="fuzz", file=sys.stderr, bar_format="{l_bar}{bar}| {postfix}") as bar:
        while (passed := time.monotonic() - begin) < seconds:
            scene = draw_scene(rng.random(NUMBERS).tolist())
            sampled += scene.sampled
            try:
                found = checks(scene, compare=ends.total() % COMPARED == 0)
                ends["all properties hold" if all(check.holds for check in found) else "a property fails"] += 1
            except Unfinished as reason:
                ends[str(reason)] += 1
                found = []
            for check in found:
                tallies.setdefault(check.name, Tally()).add(check)
                if not check.holds:
                    broken += 1
                    path = directory / f"{check.name.replace(' ', '_')}_{seed}_{ends.total()}.yaml"
                    with writing(path):
                        directory.mkdir(parents=True, exist_ok=True)
                        path.write_text(scene.to_yaml(), encoding="utf-8")
                    bar.write(f"{check.name}: {check.error:.3g}, allowed {check.bound:.3g}; scene in {path}")
            bar.set_postfix_str(f"{ends.total()} scenes, {broken} failures", refresh=False)
            bar.update(passed - bar.n)
    print(f"{ends.total()} scenes in {seconds:g} s, seed {seed}, {sampled} of them sampled")
    for text, count in ends.most_common():
        print(f"  {count:8}  {text}")
    print(f"  {'checked':>8}  {'failures':>8}  property")
    for name, tally in tallies.items():
        print(f"  {tally.scenes:8}  {tally.failures:8}  {name}")
    print(f"failures: {broken}")
    return broken

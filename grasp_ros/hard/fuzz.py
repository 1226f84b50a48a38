"""Random scenes against all properties, for as long as wanted."""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from tqdm import tqdm

from grasp_ros.hard.case import Unfinished
from grasp_ros.hard.properties import NUMBERS, draw_scene, failures


def run(seconds: float, seed: int, directory: Path) -> int:
    """Draw scenes until the time is over; print what became of them, and write those that fail as YAML.

    Returns
    -------
    int
        Number of failures.
    """
    begin = time.monotonic()
    rng = np.random.default_rng(seed)
    ends: Counter[str] = Counter()
    broken: Counter[str] = Counter()
    sampled = 0
    with tqdm(total=seconds, unit="s", desc="fuzz", file=sys.stderr, bar_format="{l_bar}{bar}| {postfix}") as bar:
        while (passed := time.monotonic() - begin) < seconds:
            scene = draw_scene(rng.random(NUMBERS).tolist())
            sampled += scene.sampled
            try:
                found = failures(scene)
                ends["every property holds" if not found else "a property fails"] += 1
            except Unfinished as reason:
                ends[str(reason)] += 1
                found = []
            for failure in found:
                broken[failure.name] += 1
                directory.mkdir(parents=True, exist_ok=True)
                path = directory / f"{failure.name.replace(' ', '_')}_{seed}_{ends.total()}.yaml"
                path.write_text(scene.to_yaml(), encoding="utf-8")
                bar.write(f"{failure.name}: {failure.figure:.3g}, allowed {failure.bound:.3g}; scene in {path}")
            bar.set_postfix_str(f"{ends.total()} scenes, {broken.total()} failures")
            bar.update(passed - bar.n)
    print(f"{ends.total()} scenes in {seconds:g} s, seed {seed}, {sampled} of them sampled")
    for text, count in ends.most_common():
        print(f"  {count:8}  {text}")
    for name, count in broken.most_common():
        print(f"  {count:8}  failures of: {name}")
    print(f"failures: {broken.total()}")
    return broken.total()

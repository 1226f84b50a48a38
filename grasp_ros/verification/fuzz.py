"""Random scenes against all properties, for as long as wanted; each is drawn again from a seed and its number."""

from __future__ import annotations

import multiprocessing
import re
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros.scene import Scene
from grasp_ros.scene.files import writing
from grasp_ros.verification.draw import NUMBERS
from grasp_ros.verification.habits import draw_scene
from grasp_ros.verification.properties import Check, Examination, examine

CHUNK = 50  # draws that a process does at once
COMPARED = 5000  # every how many scenes one is compared with the reference


class Drawn(NamedTuple):
    """What became of one draw."""

    number: int
    habits: str
    found: Examination
    yaml: str  # empty if all properties hold


@dataclass
class Tally:
    """How often a property was checked, and how often it failed."""

    checked: int = 0
    skipped: int = 0  # pieces that the quadrature does not resolve
    failures: int = 0
    worst: float = 0.0
    where: int = 0  # number of the worst draw

    def add(self, check: Check, number: int) -> None:
        """Count a check."""
        self.checked += 1
        self.skipped += check.skipped
        self.failures += not check.holds
        if not check.error <= self.worst:
            self.worst, self.where = check.error, number


@dataclass
class Book:
    """What became of all draws."""

    ends: Counter[str] = field(default_factory=Counter)
    tallies: dict[str, Tally] = field(default_factory=dict)
    habits: Counter[str] = field(default_factory=Counter)
    broken_habits: Counter[str] = field(default_factory=Counter)
    broken: int = 0

    def add(self, drawn: Drawn) -> None:
        """Count a draw."""
        self.ends[drawn.found.end] += 1
        names = drawn.habits.split(", ")
        self.habits.update(names)
        for check in drawn.found.checks:
            self.tallies.setdefault(check.name, Tally()).add(check, drawn.number)
        if drawn.found.broken:
            self.broken += 1
            self.broken_habits.update(names)

    def show(self) -> None:
        """Print all tables."""
        for text, number in self.ends.most_common():
            print(f"  {number:8}  {text}")
        print(f"  {'checked':>8}  {'skipped':>8}  {'failures':>8}  {'worst':>8}  {'draw':>8}  property")
        for name, tally in sorted(self.tallies.items(), key=lambda item: -item[1].failures):
            counts = f"{tally.checked:8}  {tally.skipped:8}  {tally.failures:8}"
            print(f"  {counts}  {tally.worst:8.2g}  {tally.where:8}  {name}")
        print(f"  {'drawn':>8}  {'failures':>8}  habit")
        for name, number in self.habits.most_common():
            print(f"  {number:8}  {self.broken_habits[name]:8}  {name}")
        print(f"failures: {self.broken}")


def draw(seed: int, number: int) -> Scene:
    """The scene of a seed and a number."""
    return draw_scene(np.random.default_rng((seed, number)).random(NUMBERS).tolist())


def check_draws(seed: int, numbers: Iterable[int]) -> list[Drawn]:
    """Draw scenes and check them; an exception is a failure."""
    return [_check(number, draw(seed, number)) for number in numbers]


def _check(number: int, scene: Scene) -> Drawn:
    try:
        found = examine(scene, every=False, compare=number % COMPARED == 0)
    except Exception:
        reason = traceback.format_exc().strip().splitlines()
        found = Examination("traceback", [Check(f"traceback: {reason[-1][:60]}", 1.0, 0.0)])
    names = ", ".join(f"{check.name} {check.error:.2g}" for check in found.broken)
    yaml = f"# {number}: {names}\n{scene.to_yaml()}" if found.broken else ""
    return Drawn(number, scene.title, found, yaml)


def run(seed: int, directory: Path, *, seconds: float | None = None, draws: int | None = None, first: int = 0,
        jobs: int = 1) -> int:
    """Draw scenes until the time is over or enough are drawn; print what became of them, write those that fail.

    Parameters
    ----------
    seed : int
    directory : Path
        Where scenes that fail are written as YAML.
    seconds, draws : float in s, and int, optional
        What ends the search; None: does not.
    first : int
        Number of the first draw.
    jobs : int
        Processes.

    Returns
    -------
    int
        Number of scenes that fail.

    Raises
    ------
    Refused
        If a scene that fails cannot be written.
    """
    begin, book = time.monotonic(), Book()
    with tqdm(total=draws, unit=" draws", desc="fuzz", file=sys.stderr) as bar:
        for chunk in _chunks(seed, draws, first, jobs):
            for drawn in chunk:
                book.add(drawn)
                if drawn.yaml:
                    _write(directory, seed, drawn, bar)
            bar.update(len(chunk))
            if seconds is not None and time.monotonic() - begin > seconds:
                break
    print(f"{book.ends.total()} scenes in {time.monotonic() - begin:.0f} s, seed {seed}")
    book.show()
    return book.broken


def _chunks(seed: int, draws: int | None, first: int, jobs: int) -> Iterator[list[Drawn]]:
    starts = count(first, CHUNK) if draws is None else range(first, first + draws, CHUNK)
    end = None if draws is None else first + draws
    chunks = (range(start, start + CHUNK if end is None else min(start + CHUNK, end)) for start in starts)
    if jobs == 1:
        yield from map(partial(check_draws, seed), chunks)
        return
    with multiprocessing.get_context("spawn").Pool(jobs) as pool:
        waiting = []
        for chunk in chunks:
            waiting.append(pool.apply_async(check_draws, (seed, chunk)))
            if len(waiting) > 2 * jobs:
                yield waiting.pop(0).get()
        yield from (result.get() for result in waiting)


def _write(directory: Path, seed: int, drawn: Drawn, bar: Any) -> None:
    worst = max(drawn.found.broken, key=lambda check: check.error)
    name = re.sub(r"[^0-9A-Za-z]+", "_", worst.name).strip("_")
    path = directory / f"{name}_{seed}_{drawn.number}.yaml"
    with writing(path):
        directory.mkdir(parents=True, exist_ok=True)
        path.write_text(drawn.yaml, encoding="utf-8")
    bar.write(f"{drawn.yaml.splitlines()[0]}; scene in {path}", file=sys.stderr)

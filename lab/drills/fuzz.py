"""Random scenes against all properties, for as long as wanted; each is drawn again from a seed and its number.

The page says what a search has counted, and a journal keeps it, so that the search can go on.
"""

from __future__ import annotations

import json
import multiprocessing
import re
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros.exact.compilation.kernel_cache import sources_digest
from grasp_ros.scene import Scene
from grasp_ros.scene.files import writing
from grasp_ros.scene.versions import versions
from lab.cases.degenerate import ORDINARY, draw_scene
from lab.cases.draw import inside
from lab.oracles.properties import Check, Examination, examine
from lab.studies import pages
from lab.studies.records import Journal, digest

CHUNK = 50  # draws that a process does at once
TABLES = {  # headers
    "ends": ["scenes", "end"], "properties": ["property", "checked", "skipped", "failures", "worst", "draw"],
    "degeneracies": ["degeneracy", "drawn", "failures"],
}
COMPARED = 5000  # every how many scenes one is compared with the reference
# what a draw depends on beside the kernels and the physics
ROOMS = "grasp_ros/scene", "grasp_ros/simulation", "lab/reference", "lab/cases", "lab/oracles"


@dataclass
class Tally:
    """How often a property was checked, and how often it failed."""

    checked: int = 0
    skipped: int = 0  # pieces that the quadrature does not resolve
    failures: int = 0
    worst: float = 0.0
    where: int = 0  # number of the worst draw

    def merge(self, other: Tally) -> None:
        """Count those of later draws, too."""
        self.checked += other.checked
        self.skipped += other.skipped
        self.failures += other.failures
        if not other.worst <= self.worst:
            self.worst, self.where = other.worst, other.where


@dataclass
class Book:
    """What became of all draws."""

    ends: Counter[str] = field(default_factory=Counter)
    tallies: dict[str, Tally] = field(default_factory=dict)
    degeneracies: Counter[str] = field(default_factory=Counter)
    broken_degeneracies: Counter[str] = field(default_factory=Counter)
    scenes: dict[int, str] = field(default_factory=dict)  # those that fail, YAML by number

    @property
    def broken(self) -> int:
        """Number of scenes that fail."""
        return len(self.scenes)

    def merge(self, other: Book) -> None:
        """Count later draws, too."""
        self.ends.update(other.ends)
        self.degeneracies.update(other.degeneracies)
        self.broken_degeneracies.update(other.broken_degeneracies)
        self.scenes.update(other.scenes)
        for name, tally in other.tallies.items():
            self.tallies.setdefault(name, Tally()).merge(tally)

    def tables(self) -> dict[str, list[list[str]]]:
        """Rows, see TABLES: the largest numbers first, equal ones by their names."""
        tallies = sorted(self.tallies.items(), key=lambda item: (-item[1].failures, item[0]))
        return {
            "ends": [[str(number), text] for text, number in _ordered(self.ends)],
            "properties": [[name, str(tally.checked), str(tally.skipped), str(tally.failures), f"{tally.worst:.2g}",
                            str(tally.where)] for name, tally in tallies],
            "degeneracies": [[name, str(number), str(self.broken_degeneracies[name])]
                             for name, number in _ordered(self.degeneracies)],
        }

    def show(self) -> None:
        """Print all tables."""
        for name, rows in self.tables().items():
            for row in [TABLES[name], *rows]:
                print(*(f"{cell:>8}" for cell in row), sep="  ")
        print(f"failures: {self.broken}")


class Line(NamedTuple):
    """The book of a chunk of draws in the journal."""

    book: str  # JSON


class Kept:
    """The books of all chunks that were drawn with these sources, in the journal of a directory."""

    def __init__(self, directory: Path, seed: int, ordinary: float = ORDINARY) -> None:
        sources = (path.read_text("utf-8") for room in ROOMS for path in sorted((pages.HOME / room).rglob("*.py")))
        self._journal = Journal(directory)
        self._name = digest(seed, ordinary, sources_digest(), *sources, *versions().items())

    def _key(self, numbers: range) -> str:
        return f"{self._name} {numbers.start} {numbers.stop}"

    def get(self, numbers: range) -> Book | None:
        """What became of these draws, if that is known."""
        line = self._journal.get(self._key(numbers), Line)
        if line is None:
            return None
        ends, tallies, degeneracies, broken, scenes = json.loads(line.book).values()
        return Book(Counter(ends), {name: Tally(**tally) for name, tally in tallies.items()}, Counter(degeneracies),
                    Counter(broken), {int(number): yaml for number, yaml in scenes.items()})

    def put(self, numbers: range, book: Book) -> None:
        """Keep what became of these draws."""
        self._journal.put(self._key(numbers), Line(json.dumps(vars(book), default=vars)))


def _ordered(counts: Counter[str]) -> list[tuple[str, int]]:
    return sorted(counts.items(), key=lambda item: (-item[1], item[0]))


def draw(seed: int, number: int, ordinary: float = ORDINARY) -> Scene:
    """The scene of a seed and a number; `ordinary` is the part of scenes that are not degenerate."""
    return inside(partial(draw_scene, ordinary=ordinary), np.random.default_rng((seed, number)))


def check_draws(seed: int, numbers: Iterable[int], ordinary: float = ORDINARY) -> Book:
    """Draw scenes and check them; an exception is a failure."""
    book = Book()
    for number in numbers:
        book.merge(_check(number, draw(seed, number, ordinary)))
    return book


def _check(number: int, scene: Scene) -> Book:
    """What became of one draw."""
    try:
        found = examine(scene, every=False, compare=number % COMPARED == 0)
    except Exception:
        reason = traceback.format_exc().strip().splitlines()
        found = Examination("traceback", [Check(f"traceback: {reason[-1][:60]}", 1.0, 0.0)])
    book = Book(Counter([found.end]), degeneracies=Counter(scene.title.split(", ")))
    for check in found.checks:
        tally = Tally(1, check.skipped, int(not check.holds), check.error, number)
        book.tallies.setdefault(check.name, Tally()).merge(tally)
    if broken := sorted(found.broken, key=lambda check: -check.error):
        names = "; ".join(f"{check.name} {check.error:.2g}" for check in broken)
        book.scenes[number] = f"# {number}: {names}\n{scene.to_yaml()}"
        book.broken_degeneracies = book.degeneracies.copy()
    return book


def run(seed: int, directory: Path, *, seconds: float | None = None, draws: int | None = None, first: int = 0,
        jobs: int = 1, memory: Kept | None = None, ordinary: float = ORDINARY) -> Book:
    """Draw scenes until the time in s is over or so many are drawn; None: that does not end the search.

    Prints what became of them, and writes those that fail as YAML into the directory. `first` is the number of the
    first draw, `ordinary` the part of ordinary scenes; what `memory` knows is not drawn again.
    """
    begin, book = time.monotonic(), Book()
    with tqdm(total=draws, unit=" draws", desc="fuzz", file=sys.stderr) as bar:
        for chunk in _chunks(seed, draws, first, jobs, memory, ordinary):
            book.merge(chunk)
            for number, yaml in chunk.scenes.items():
                _write(directory, seed, number, yaml, bar)
            bar.update(chunk.ends.total())
            if seconds is not None and time.monotonic() - begin > seconds:
                break
    print(f"{book.ends.total()} scenes in {time.monotonic() - begin:.0f} s, seed {seed}")
    book.show()
    return book


def _chunks(seed: int, draws: int | None, first: int, jobs: int, memory: Kept | None,
            ordinary: float) -> Iterator[Book]:
    """The books of all chunks in their order; what is new is kept in `memory`."""
    starts = count(first, CHUNK) if draws is None else range(first, first + draws, CHUNK)
    end = None if draws is None else first + draws
    waiting: list[tuple[range, Any]] = []  # not more than the processes need

    def take() -> Book:
        asked, answer = waiting.pop(0)
        if isinstance(answer, Book):
            return answer
        book: Book = check_draws(seed, asked, ordinary) if answer is None else answer.get()
        if memory is not None:
            memory.put(asked, book)
        return book

    with multiprocessing.get_context("spawn").Pool(jobs) if jobs > 1 else nullcontext() as pool:
        for start in starts:
            numbers = range(start, start + CHUNK if end is None else min(start + CHUNK, end))
            found: Any = None if memory is None else memory.get(numbers)
            if found is None and pool is not None:
                found = pool.apply_async(check_draws, (seed, numbers, ordinary))
            waiting.append((numbers, found))
            if pool is None or len(waiting) > 2 * jobs:
                yield take()
        while waiting:
            yield take()


def _write(directory: Path, seed: int, number: int, yaml: str, bar: Any) -> None:
    worst = yaml.splitlines()[0].split(": ", 1)[1].split("; ")[0].rsplit(" ", 1)[0]
    name = re.sub(r"[^0-9A-Za-z]+", "_", worst).strip("_")
    path = directory / f"{name}_{seed}_{number}.yaml"
    with writing(path):
        directory.mkdir(parents=True, exist_ok=True)
        path.write_text(yaml, encoding="utf-8")
    bar.write(f"{yaml.splitlines()[0]}; scene in {path}", file=sys.stderr)


def write_page(docs: Path, seed: int, first: int, book: Book, ordinary: float = ORDINARY) -> None:
    """Write the page of random scenes: what was counted."""
    source = f"--seed {seed}" + ("" if ordinary == ORDINARY else f" --ordinary {ordinary:g}")
    failures = [[f"`{source} --first {number} --draws 1`", yaml.splitlines()[0].split(": ", 1)[1]]
                for number, yaml in sorted(book.scenes.items())]
    pages.write(docs, "fuzz", source=source, first=first, draws=book.ends.total(), failures=failures, **book.tables())

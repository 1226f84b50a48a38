"""The page of random scenes: what a search by `python -m lab fuzz` has counted, and a journal from which it goes on."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import NamedTuple

from grasp_ros.exact.compilation.kernel_cache import sources_digest
from grasp_ros.scene.versions import versions
from lab.cases.degenerate import ORDINARY
from lab.drills.fuzz import Book, Tally
from lab.studies import pages
from lab.studies.records import Journal, digest

# what a draw depends on beside the kernels and the physics
ROOMS = "grasp_ros/scene", "grasp_ros/simulation", "lab/reference", "lab/cases", "lab/oracles"


class Line(NamedTuple):
    """The book of a chunk of draws in the journal."""

    book: str  # JSON


class Kept:
    """The books of all chunks that were drawn with these sources, in the journal of a directory.

    Raises
    ------
    Refused
        If the journal cannot be read or written, or is damaged.
    """

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


def write_page(docs: Path, seed: int, first: int, book: Book, ordinary: float = ORDINARY) -> None:
    """Write what was counted.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    source = f"--seed {seed}" + ("" if ordinary == ORDINARY else f" --ordinary {ordinary:g}")
    failures = [[f"`{source} --first {number} --draws 1`", yaml.splitlines()[0].split(": ", 1)[1]]
                for number, yaml in sorted(book.scenes.items())]
    pages.write(docs, "fuzz", source=source, first=first, draws=book.ends.total(), failures=failures, **book.tables())

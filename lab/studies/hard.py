"""The page of hard cases, family by family: the error of each case, and those of other methods beside it."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros.exact.events import Event
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.versions import versions
from grasp_ros.simulation import simulate
from lab.cases.case import Case, Product, Unfinished, Verdict, evaluate
from lab.cases.registry import cases
from lab.cases.scenes import library
from lab.reference.deadline import Deadline, deadline
from lab.studies import page_figures
from lab.studies.document import prose, put, read, table, write

PART = "the hard cases"  # marked part of the document
OTHERS = (("lsoda_events", 1e-12), ("paper", 1e-4))  # scipy's best on these scenes; the paper's method, step in s
SECONDS = 1.5  # that another method may take for a case
FAR = 1e-3  # an error that no one would call a result


class Row(NamedTuple):
    """A case with our verdict, and those of the other methods, if they were asked."""

    case: Case
    own: Verdict
    others: list[Verdict]


class Other:
    """One of the other methods, at its own setting."""

    def __init__(self, name: str, setting: float) -> None:
        self.name, self._setting = name, setting
        self.states(library("case_01", 0.1), [0.1])  # compiles here: a deadline must not fire within the compiler

    def states(self, scene: Scene, times: Iterable[float]) -> Array:
        """States (n, 6) at ascending times."""
        grid = np.array(list(times))
        motion = simulate(scene, grid=grid, method=self.name, setting=min(self._setting, scene.duration))
        if len(motion.state) < len(grid):
            raise Unfinished(motion.status.value)
        return motion.state

    def events(self, scene: Scene) -> list[Event]:
        """Events in the order of time."""
        return simulate(scene, method=self.name, setting=min(self._setting, scene.duration)).events


def run(document: Path | None, *, alone: bool) -> int:
    """Print the table; with a document, put it and a figure into it. Returns 1 if a case is wrong.

    Raises
    ------
    Refused
        If the document cannot be read or written, or has no marks.
    """
    text = "" if document is None else put(document, read(document), PART, "")
    rows: list[Row] = []
    others = [] if alone else [Other(name, setting) for name, setting in OTHERS]
    for case in tqdm(cases(), desc="hard", file=sys.stderr):
        own = evaluate(case, Product(case.max_events, case.max_work))
        rows.append(Row(case, own, [] if case.product_only else [_other(case, other) for other in others]))
    text_of_rows = _families(rows)
    print(text_of_rows)
    if document is not None:
        figure = document.with_suffix(".png")
        drawn = [(row.case.family.name, row.case.bound, row.own.error, [other.error for other in row.others])
                 for row in rows]
        page_figures.hard_cases(drawn, [name for name, _ in OTHERS], figure)
        block = f"{text_of_rows}\n\n![errors of the hard cases]({figure.name})"
        write(document, put(document, text, PART, block))
    return 0 if all(row.own.right(row.case) for row in rows) else 1


def _other(case: Case, other: Other) -> Verdict:
    try:
        with deadline(SECONDS), np.errstate(all="ignore"):
            return evaluate(case, other)
    except Deadline:
        return Verdict(None, f"not done in {SECONDS:g} s")
    except (ValueError, ArithmeticError, IndexError) as error:  # what it raises is its answer
        return Verdict(None, f"{type(error).__name__}: {error}")


def _families(rows: list[Row]) -> str:
    """What was reached in all, and a paragraph and a table for each family."""
    blocks = [_summary(rows)]
    for family, group in groupby(rows, key=lambda row: row.case.family):
        blocks += [f"### {family.name}", prose(family.why), prose(f"*Decided by* {family.oracle}.")]
        blocks.append(_cases(list(group)))
    return "\n\n".join(blocks)


def _summary(rows: list[Row]) -> str:
    right = sum(row.own.right(row.case) for row in rows)
    machine = ", ".join(f"{name} {version}" for name, version in versions().items())
    lines = [f"{right} of {len(rows)} cases right. {machine}."]
    compared = [row for row in rows if row.others]
    for place, (name, setting) in enumerate(OTHERS if compared else ()):
        found = [row.others[place] for row in compared]
        within = sum(other.right(row.case) for row, other in zip(compared, found, strict=True))
        lost = sum(other.error is None or not other.error < FAR for other in found)
        lines.append(f"`{name}` at {setting:g}: {within} of {len(compared)} within the same bounds, {lost} without a"
                     f" result or off by more than {FAR:g}.")
    return "\n".join(lines)


def _cases(rows: list[Row]) -> str:
    """The cases of a family; a column of notes, and columns of other methods, only where there are any."""
    others = [name for name, _ in OTHERS] if any(row.others for row in rows) else []
    noted = any(row.case.note for row in rows)
    heads = ["case", "promised", "reached", *others, *(["note"] if noted else [])]
    lines = []
    for row in rows:
        wrong = "" if row.own.right(row.case) else " **wrong**"
        cells = [_short(other) for other in row.others] or ["-"] * len(others)
        lines.append([row.case.name, f"{row.case.bound:.1g}", _short(row.own) + wrong, *cells,
                      *([row.case.note] if noted else [])])
    return table(heads, lines)


def _short(verdict: Verdict) -> str:
    return verdict.status if verdict.error is None else f"{verdict.error:.1e}"

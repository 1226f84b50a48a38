"""The table of hard cases: what decides, the figure reached, and other methods beside it."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros.exact.integrator import Event
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from grasp_ros.simulation.versions import versions
from grasp_ros.studies import page_figures
from grasp_ros.studies.document import put, read, write
from grasp_ros.verification.cases.case import Case, Outcome, Product, Unfinished, judge
from grasp_ros.verification.cases.registry import cases
from grasp_ros.verification.deadline import Deadline, deadline

PART = "the hard cases"  # marked part of the document
OTHERS = (("lsoda_events", 1e-12), ("paper", 1e-4))  # scipy's best on these scenes; the paper's method, step in s
SECONDS = 1.5  # that another method may take for a case
FAR = 1e-3  # a figure that no one would call a result


class Row(NamedTuple):
    """A case with the figure reached, and those of the other methods, if they were asked."""

    case: Case
    own: Outcome
    others: list[Outcome]


class Other:
    """One of the other methods, at its own setting."""

    def __init__(self, name: str, setting: float) -> None:
        self.name, self._setting = name, setting

    def states(self, scene: Scene, times: Iterable[float]) -> Array:
        """States (n, 6) at ascending times."""
        grid = np.array(list(times))
        motion = simulate(scene, grid=grid, method=self.name, setting=min(self._setting, scene.duration))
        if len(motion.state) < len(grid):
            raise Unfinished(motion.status.value)
        return motion.state

    def events(self, scene: Scene) -> list[Event]:
        """Switches in the order of time."""
        return simulate(scene, method=self.name, setting=min(self._setting, scene.duration)).events


def run(document: Path | None, *, alone: bool) -> int:
    """Print the table; with a document, put it and a figure into it. Returns 1 if a case is wrong.

    Raises
    ------
    Refused
        If the document cannot be read or written, or has no marks.
    """
    text = "" if document is None else put(read(document), PART, "")
    rows: list[Row] = []
    others = [] if alone else [Other(name, setting) for name, setting in OTHERS]
    for case in tqdm(cases(), desc="hard", file=sys.stderr):
        own = judge(case, Product(case.max_events, case.max_work))
        rows.append(Row(case, own, [] if case.product_only else [_other(case, other) for other in others]))
    table = _table(rows)
    print(table)
    if document is not None:
        figure = document.with_suffix(".png")
        drawn = [(row.case.family, row.case.bound, row.own.figure, [other.figure for other in row.others])
                 for row in rows]
        page_figures.hard_cases(drawn, [name for name, _ in OTHERS], figure)
        block = f"{table}\n\n![figures of the hard cases]({figure.name})"
        write(document, put(text, PART, block))
    return 0 if all(row.own.right(row.case) for row in rows) else 1


def _other(case: Case, other: Other) -> Outcome:
    try:
        with deadline(SECONDS), np.errstate(all="ignore"):
            return judge(case, other)
    except Deadline:
        return Outcome(None, f"not done in {SECONDS:g} s")
    except (ValueError, ArithmeticError, IndexError) as error:  # what it raises is its answer
        return Outcome(None, f"{type(error).__name__}: {error}")


def _table(rows: list[Row]) -> str:
    right = sum(row.own.right(row.case) for row in rows)
    machine = ", ".join(f"{name} {version}" for name, version in versions().items())
    lines = [f"{right} of {len(rows)} cases right. {machine}."]
    compared = [row for row in rows if row.others]
    for place, (name, setting) in enumerate(OTHERS if compared else ()):
        found = [row.others[place] for row in compared]
        within = sum(other.right(row.case) for row, other in zip(compared, found, strict=True))
        lost = sum(other.figure is None or not other.figure < FAR for other in found)
        lines.append(f"`{name}` at {setting:g}: {within} of {len(compared)} within the same bounds, {lost} without a"
                     f" result or off by more than {FAR:g}.")
    lines += ["", f"| family | case | why it is hard | what decides | promised | reached |{_heads(compared)}",
              f"|---|---|---|---|---:|---:|{'---:|' * (len(OTHERS) if compared else 0)}"]
    for row in rows:
        case, verdict = row.case, "" if row.own.right(row.case) else " **wrong**"
        others = [_short(other) for other in row.others] or ["-"] * (len(OTHERS) if compared else 0)
        cells = [case.family, case.name, case.why, case.oracle, f"{case.bound:.1g}", _short(row.own) + verdict, *others]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _heads(compared: list[Row]) -> str:
    return "".join(f" {name} |" for name, _ in OTHERS) if compared else ""


def _short(outcome: Outcome) -> str:
    return outcome.status if outcome.figure is None else f"{outcome.figure:.1e}"

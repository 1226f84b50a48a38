"""The hard cases: the error of each, and those of other methods beside it, as a page by families and as a table."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from tqdm import tqdm

from grasp_ros.exact.events import Event
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import canvas, simulate
from grasp_ros.simulation.plots import LEFT_COLOR, save
from lab.cases import regression
from lab.cases.case import Case, Product, Unfinished, Verdict, evaluate
from lab.cases.families import ORDER
from lab.cases.registry import cases
from lab.cases.scenes import library
from lab.reference.deadline import Deadline, deadline
from lab.studies import pages
from lab.studies.records import write_csv

OTHERS = (("lsoda_events", 1e-12), ("paper", 1e-4))  # scipy's best on these scenes; the paper's method, step in s
SECONDS = 1.5  # that another method may take for a case
FAR = 1e-3  # an error that no one would call a result
KEPT, BROKEN, NONE = "kept", "broken", "no result"
OUTCOMES = {KEPT: (LEFT_COLOR, "", "white"), BROKEN: ("#f2a65a", "////", "black"), NONE: ("#d8d8d8", "", "black")}


class Row(NamedTuple):
    """A case with our verdict, and those of the other methods, if they were asked."""

    case: Case
    own: Verdict
    others: list[Verdict]


class Other:
    """One of the other methods, at its own setting."""

    def __init__(self, name: str, setting: float) -> None:
        self.name, self.setting = name, setting
        self.states(library("case_01", 0.1), [0.1])  # compiles here: a deadline must not fire within the compiler

    def states(self, scene: Scene, times: Iterable[float]) -> Array:
        """States (n, 6) at ascending times."""
        grid = np.array(list(times))
        motion = simulate(scene, grid=grid, method=self.name, setting=min(self.setting, scene.duration))
        if len(motion.state) < len(grid):
            raise Unfinished(motion.status.value)
        return motion.state

    def events(self, scene: Scene) -> list[Event]:
        """Events in the order of time."""
        return simulate(scene, method=self.name, setting=min(self.setting, scene.duration)).events


def run(docs: Path | None, alone: bool) -> int:
    """Print a row for each case; with a directory of pages, write the page there. Returns 1 if a case is wrong."""
    rows: list[Row] = []
    others = [] if alone else [Other(name, setting) for name, setting in OTHERS]
    for case in tqdm(cases(), desc="hard", file=sys.stderr):
        own = evaluate(case, Product(case.max_events, case.max_work))
        rows.append(Row(case, own, [] if case.product_only else [_other(case, other) for other in others]))
    for row in rows:
        print(row.case.family.name, *cells(row), sep="  ")
    right = sum(row.own.right(row.case) for row in rows)
    print(f"{right} of {len(rows)} cases are right")
    if docs is not None:
        names = ["this package", *(other.name for other in others)]
        _draw(counts(rows, len(others)), names, docs / "hard.png")
        heads = ["family", "case", "promised", "reached", *names[1:], "note"]
        write_csv(heads, ([row.case.family.name, *cells(row), *["-"] * (len(others) - len(row.others)), row.case.note]
                          for row in rows), docs / "hard.csv")
        pages.write(docs, "hard", rows=rows, right=right, names=names[1:], others=others,
                    compared=_compared(others, rows), families=ORDER, results=_results(rows, len(others)),
                    seconds=SECONDS, far=FAR, **regression_numbers())
    return 0 if right == len(rows) else 1


def regression_numbers() -> dict[str, object]:
    """How many regression scenes there are, how many have an answer, and how many each rule of the domain refuses."""
    refused = regression.refusals()
    return {"inside": len(regression.names()), "answered": len(regression.answers()), "outside": refused.total(),
            "refused": [[*rule, str(count)] for rule, count in refused.most_common()]}


def _other(case: Case, other: Other) -> Verdict:
    try:
        with deadline(SECONDS), np.errstate(all="ignore"):
            return evaluate(case, other)
    except Deadline:
        return Verdict(None, f"not done in {SECONDS:g} s")
    except (ValueError, ArithmeticError, IndexError) as error:  # what it raises is its answer
        return Verdict(None, f"{type(error).__name__}: {error}")


def counts(rows: Sequence[Row], others: int) -> dict[str, list[Counter[str] | None]]:
    """By family: of this package and of each other method how many cases are kept, broken, or without a result."""
    found: dict[str, list[Counter[str] | None]] = {}
    for name, members in _members(rows).items():
        asked = [row for row in members if row.others]
        found[name] = [Counter(_outcome(row.own, row.case) for row in members)]
        found[name] += [Counter(_outcome(row.others[i], row.case) for row in asked) if asked else None
                        for i in range(others)]
    return found


def _members(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return {name: list(group) for name, group in groupby(rows, key=lambda row: row.case.family.name)}


def _outcome(verdict: Verdict, case: Case) -> str:
    """Whether a method keeps the bound of a case."""
    if verdict.right(case):
        return KEPT
    return NONE if verdict.error is None else BROKEN


def _compared(others: Sequence[Other], rows: Sequence[Row]) -> list[list[str]]:
    """For each other method how many cases it has within our bounds, and how many it does not do at all."""
    compared = [row for row in rows if row.others]
    found = []
    for i, other in enumerate(others):
        theirs = [(row.others[i], row.case) for row in compared]
        lost = sum(verdict.error is None or not verdict.error < FAR for verdict, _ in theirs)
        found.append([f"`{other.name}`", str(len(compared)), str(sum(one.right(case) for one, case in theirs)),
                      str(lost)])
    return found


def _results(rows: Sequence[Row], others: int) -> list[list[str]]:
    """For each family how many cases are right, and the largest error as a part of its bound; and those of others."""
    found = []
    for (name, (own, *theirs)), members in zip(counts(rows, others).items(), _members(rows).values(), strict=True):
        parts = [row.own.error / row.case.bound for row in members if row.own.error and row.case.bound]
        kept = [f"{count[KEPT]} of {count.total()}" if count else "-" for count in theirs]
        assert own is not None
        found.append([name, f"{own[KEPT]} of {own.total()}", f"{max(parts, default=0.0):.1g}", *kept])
    return found


def cells(row: Row) -> list[str]:
    """A case by its name, what is promised, and what is reached, by others, too."""
    wrong = "" if row.own.right(row.case) else " (wrong)"
    return [row.case.name, f"{row.case.bound:.1g}", _short(row.own) + wrong, *map(_short, row.others)]


def _short(verdict: Verdict) -> str:
    return verdict.status if verdict.error is None else f"{verdict.error:.1e}"


@canvas.style()
def _draw(rows: Mapping[str, Sequence[Counter[str] | None]], solvers: Sequence[str], path: Path) -> None:
    """Draw how many cases of each family each solver keeps, breaks, or has no result of; None: it was not asked."""
    size = (2.2 + 2.6 * len(solvers), 0.33 * len(rows) + 1.2)
    figure, panels = canvas.subplots(1, len(solvers), sharey=True, squeeze=False, figsize=size)
    for column, (axes, solver) in enumerate(zip(panels[0], solvers, strict=True)):
        for row, counts in enumerate(each[column] for each in rows.values()):
            _bar(axes, row, counts)
        axes.set_xlim(0.0, 1.0)
        axes.set_xticks([])
        axes.set_title(solver, fontsize="medium")
        axes.spines[:].set_visible(False)
        axes.tick_params(left=False)
    panels[0, 0].set_yticks(range(len(rows)), list(rows))
    panels[0, 0].set_ylim(len(rows) - 0.5, -0.5)
    handles = [Patch(facecolor=color, hatch=hatch, edgecolor="white", label=name)
               for name, (color, hatch, _) in OUTCOMES.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False,
                  title="cases of each family: error against the promised bound", title_fontsize="small")
    save(figure, path)


def _bar(axes: Axes, row: int, counts: Counter[str] | None) -> None:
    """A bar with a part for each outcome, and its number."""
    if counts is None:
        axes.text(0.0, row, "not asked", va="center", fontsize="small", color="#555555")
        return
    left, whole = 0.0, counts.total()
    for name, (color, hatch, ink) in OUTCOMES.items():
        if counts[name]:
            width = counts[name] / whole
            axes.barh(row, width, left=left, height=0.8, color=color, hatch=hatch, edgecolor="white", linewidth=0.8)
            axes.text(left + 0.5 * width, row, str(counts[name]), ha="center", va="center", fontsize="small", color=ink,
                      bbox={"facecolor": color, "edgecolor": "none", "pad": 1.0})
            left += width

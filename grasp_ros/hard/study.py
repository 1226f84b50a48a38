"""The table of hard cases: what decides, the figure reached, and scipy beside it."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from grasp_ros import plots
from grasp_ros.hard.case import Case, Outcome, Product, Unfinished, judge
from grasp_ros.hard.registry import cases
from grasp_ros.physics.integrator import SwitchEvent
from grasp_ros.physics.model import Array, penetration
from grasp_ros.scene import Scene
from grasp_ros.studies.document import put
from grasp_ros.studies.peers import scipy_methods
from grasp_ros.versions import versions

PART = "the hard cases"  # marked part of the document
PEER, STRAIGHT, TOLERANCE, SECONDS = "LSODA, events", "LSODA, no events", 1e-12, 3.0
FAR = 1e-3  # a figure that no one would call a result


class Scipy:
    """scipy's LSODA with a restart at every touch and release, at its finest sensible tolerance."""

    def states(self, scene: Scene, times: Iterable[float]) -> Array:
        """States (n, 6) at ascending times."""
        grid = np.array(list(times))
        u_l, _, u_r, _ = penetration(scene.initial_state)
        name = STRAIGHT if max(u_l, u_r) >= 0.0 else PEER  # the restarts begin with open pairs
        method = next(method for method in scipy_methods(scene) if method.name == name)
        answer = method.build(TOLERANCE)(grid)
        if len(answer.state) < len(grid):
            raise Unfinished(answer.status)
        return answer.state

    def events(self, scene: Scene) -> list[SwitchEvent]:
        """Not delivered."""
        raise Unfinished("gives no events")


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raise Unfinished in the body after some seconds of wall time."""
    def give_up(*_: Any) -> None:
        raise Unfinished(f"not done in {seconds:g} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def run(document: Path | None, *, alone: bool) -> int:
    """Print the table; with a document, put it and a figure into it. Returns 1 if a case is wrong.

    Raises
    ------
    ValueError
        If the document has no marks.
    """
    text = "" if document is None else put(document.read_text(encoding="utf-8"), PART, "")
    rows: list[tuple[Case, Outcome, Outcome | None]] = []
    for case in tqdm(cases(), desc="hard", file=sys.stderr):
        own = judge(case, Product(case.max_events))
        rows.append((case, own, None if alone or case.product_only else _peer(case)))
    table = _table(rows)
    print(table)
    if document is not None:
        figure = document.with_suffix(".png")
        plots.draw_hard([(case.family, case.bound, own.figure, None if peer is None else peer.figure)
                         for case, own, peer in rows], figure)
        block = f"{table}\n\n![figures of the hard cases]({figure.name})"
        document.write_text(put(text, PART, block), encoding="utf-8")
    return 0 if all(own.right(case) for case, own, _ in rows) else 1


def _peer(case: Case) -> Outcome:
    try:
        with deadline(SECONDS), np.errstate(all="ignore"):
            return judge(case, Scipy())
    except Unfinished as reason:
        return Outcome(None, str(reason))
    except (ValueError, ArithmeticError, IndexError) as error:  # what it raises is its answer
        return Outcome(None, f"{type(error).__name__}: {error}")


def _table(rows: list[tuple[Case, Outcome, Outcome | None]]) -> str:
    right = sum(own.right(case) for case, own, _ in rows)
    compared = [(case, peer) for case, _, peer in rows if peer is not None]
    lost = sum(peer.figure is None or not peer.figure < FAR for _, peer in compared)
    lines = [
        f"{right} of {len(rows)} cases right."
        f" scipy {PEER} at {TOLERANCE:g}: {sum(peer.right(case) for case, peer in compared)} of"
        f" {len(compared)} within the same bounds, {lost} without a result or off by more than {FAR:g}."
        f" {', '.join(f'{name} {version}' for name, version in versions().items())}.", "",
        "| family | case | why it is hard | what decides | promised | reached | scipy |",
        "|---|---|---|---|---:|---:|---:|",
    ]
    for case, own, peer in rows:
        verdict = "" if own.right(case) else " **wrong**"
        other = "-" if peer is None else _short(peer)
        lines.append(f"| {case.family} | {case.name} | {case.why} | {case.oracle} | {case.bound:.1g} |"
                     f" {_short(own)}{verdict} | {other} |")
    return "\n".join(lines)


def _short(outcome: Outcome) -> str:
    return outcome.status if outcome.figure is None else f"{outcome.figure:.1e}"

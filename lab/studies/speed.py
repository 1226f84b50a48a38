"""Time to one error: each solver at its first setting that reaches it, with all output times or the last state alone.

The same measurements as `accuracy`, but the timings are interleaved, so that their ratios hold on a machine that is
shared.
"""

from __future__ import annotations

import math
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from grasp_ros.accuracy.contender import Contender, Solve
from grasp_ros.accuracy.measure import Record, seconds
from grasp_ros.accuracy.truth import Truth
from grasp_ros.methods.registry import EXACT, check
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.studies import measure, peer_heyoka
from lab.studies.contenders import all_contenders, own_contenders
from lab.studies.records import Journal

BUDGET_S, FEWEST, MOST = 1.5, 3, 200  # per solver: time for its repeats, and their number
PATIENCE_S = 2.0  # a solver that needs longer for one run climbs no further
WARM_S = 0.05  # a solver that takes longer is warm by itself
FINER = 2  # settings a decade of `exact`, as a user of one error has them


class Timing(NamedTuple):
    """Repeats of a solver that reaches the error, without what it compiles."""

    record: Record
    median: float  # s


def run(scene: Scene, error: float, directory: Path) -> None:
    """Print what all solvers take, and their ratios to `exact`.

    Raises
    ------
    Refused
        If the error is not positive, or the scene is one that `paper` or the outside peers do not know.
    """
    if not error > 0.0:
        raise Refused(f"--error {error!r} is not allowed; allowed: a number > 0")
    check("paper", scene, None)
    _check_for_peers(scene)
    target = measure.truth(scene, Journal(directory))
    others = [contender for contender in all_contenders() if contender.name != EXACT]
    for words, grid in ((f"{len(target.grid)} output times", target.grid), ("the last state alone", target.grid[-1:])):
        print(f"{scene.name}, {words}, error at most {error:g}: medians, and their ratio to {EXACT}")
        timings = sorted(fastest(scene, target._replace(grid=grid), error, others), key=lambda timing: timing.median)
        own = next((timing.median for timing in timings if timing.record.method == EXACT), math.nan)
        for record, median in timings:
            print(f"  {record.method:30}{record.knob + f' {record.setting:.0e}':17}{record.error:8.1e}"
                  f"{1e3 * median:11.3f} ms{median / own:8.2f}")


def _check_for_peers(scene: Scene) -> None:
    x_l, _, x_o, _, x_r, _ = scene.initial_state
    if not x_l < x_o < x_r:
        raise Refused(f"{scene.name}: starts in contact; allowed here: scenes that start with gaps on both sides")
    if any(event.kind == Transition.CLAMP for event in simulate(scene).events):
        raise Refused(f"{scene.name}: a pair separates faster than 1/p; allowed here: scenes where none does")


def final_state(scene: Scene, target: Truth, error: float) -> list[Timing]:
    """The last state alone, of `exact` and of heyoka, its closest rival."""
    return fastest(scene, target._replace(grid=target.grid[-1:]), error, [peer_heyoka.contenders()[-1]])


def fastest(scene: Scene, target: Truth, error: float, others: Sequence[Contender]) -> list[Timing]:
    """Time to an error of `exact` and of others, of those that reach it; the grid of the target may end its own."""
    exact = next(contender for contender in own_contenders() if contender.name == EXACT)
    finer = tuple(10.0 ** (-k / FINER) for k in range(3 * FINER, 16 * FINER + 1))
    finalists = []
    for rival in (exact._replace(ladder=finer), *others):
        record = _first_to_reach(rival, scene, target, error)
        if record is not None:
            finalists.append((record, rival.build(scene, record.setting)))
    return _race(finalists, target.grid)


def _first_to_reach(contender: Contender, scene: Scene, target: Truth, error: float) -> Record | None:
    """The first setting, from loose to tight, that reaches an error; None if none does."""
    effort = measure.FULL._replace(patience=PATIENCE_S, deadline=3.0 * PATIENCE_S, most=1)
    for setting in contender.ladder:
        record = measure.attempt(contender, scene, setting, target, effort)
        if record.good and record.error is not None and record.error <= error:
            return record
        if measure.given_up(record, effort):
            break
    return None


def _race(finalists: list[tuple[Record, Solve]], grid: Array) -> list[Timing]:
    """Time the finalists in turn, warm; slow ones drop out once their time is used up.

    A fast one runs once before it is timed: what its predecessor has left in the caches is not its own cost.
    """
    samples: list[list[float]] = [[] for _ in finalists]
    for _ in tqdm(range(MOST), desc="timing", file=sys.stderr, leave=False):
        for (record, solve), times in zip(finalists, samples, strict=True):
            if len(times) < FEWEST or sum(times) < BUDGET_S:
                if record.least is not None and record.least < WARM_S:
                    solve(grid)
                times.append(seconds(solve, grid))
    return [Timing(record, statistics.median(times)) for (record, _), times in zip(finalists, samples, strict=True)]

"""Time to one error: each solver at its first setting that reaches it; the last state alone.

The same measurements as `accuracy`, but the timings are interleaved, so that their ratios hold on a machine that is
shared.
"""

from __future__ import annotations

import statistics
import sys
from typing import NamedTuple

from tqdm import tqdm

from grasp_ros.accuracy.contender import Contender, Solve, contender_of
from grasp_ros.accuracy.measure import Record, seconds
from grasp_ros.accuracy.truth import Truth
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.studies import measure, peer_heyoka

BUDGET_S, FEWEST, MOST = 1.5, 3, 200  # per solver: time for its repeats, and their number
PATIENCE_S = 2.0  # a solver that needs longer for one run climbs no further
WARM_S = 0.05  # a solver that takes longer is warm by itself
FINER = 2  # settings a decade of `exact`, as a user of one error has them


class Timing(NamedTuple):
    """Repeats of a solver that reaches the error, without what it compiles."""

    record: Record
    median: float  # s


def final_state(scene: Scene, target: Truth, error: float) -> list[Timing]:
    """Time to an error in the last state, of `exact` and of heyoka, its closest rival, where they reach it."""
    target = target._replace(grid=target.grid[-1:])
    exact = contender_of(EXACT)
    finer = tuple(10.0 ** (-k / FINER) for k in range(3 * FINER, 16 * FINER + 1))
    finalists = []
    for rival in (exact._replace(ladder=finer), peer_heyoka.contenders()[-1]):
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

"""Time to one error: each solver at its first setting that reaches it; the last state alone.

The same measurements as `accuracy`, but the timings are interleaved.
"""

from __future__ import annotations

import statistics
from functools import partial
from typing import NamedTuple

from grasp_ros.accuracy.measure import Contender, Record, Truth, contender_of
from grasp_ros.methods.registry import EXACT
from grasp_ros.scene import Scene
from lab.studies import measure, peer_heyoka
from lab.studies.turns import in_turn

ROUNDS = 50
PATIENCE_S = 2.0  # a solver that needs longer for one run climbs no further
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
    records, calls = [], []
    for rival in (exact._replace(ladder=finer), peer_heyoka.contenders()[-1]):
        record = _first_to_reach(rival, scene, target, error)
        if record is not None:
            records.append(record)
            calls.append(partial(rival.build(scene, record.setting), target.grid))
    return list(map(Timing, records, map(statistics.median, in_turn(calls, ROUNDS, what="timing"))))


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

"""Time to one error in the last state alone, of `exact` and of its closest rival, timed in turn."""

from __future__ import annotations

import math
import statistics
from functools import partial
from typing import NamedTuple

from grasp_ros.accuracy.measure import Record, Truth, compare, contender_of, fastest
from grasp_ros.methods.registry import EXACT
from grasp_ros.scene import Scene
from lab.studies import peer_heyoka
from lab.studies.turns import in_turn

ROUNDS = 50
FINER = 2  # settings a decade of `exact`, as a user of one error has them


class Timing(NamedTuple):
    """Repeats of a solver that reaches the error, without what it compiles."""

    record: Record
    median: float  # s


def final_state(scene: Scene, target: Truth, error: float) -> list[Timing | None]:
    """Time to an error in the last state, of `exact` and of heyoka, each at its fastest setting; None: not reached."""
    target = target._replace(grid=target.grid[-1:])
    finer = tuple(10.0 ** (-k / FINER) for k in range(3 * FINER, 16 * FINER + 1))
    rivals = contender_of(EXACT)._replace(ladder=finer), peer_heyoka.contenders()[-1]
    measured, _ = compare(scene, rivals, target, seconds=math.inf)
    records = [fastest((record for record in measured if record.method == rival.name), error) for rival in rivals]
    calls = [partial(rival.build(scene, record.setting), target.grid)
             for rival, record in zip(rivals, records, strict=True) if record]
    medians = map(statistics.median, in_turn(calls, ROUNDS, what="timing"))
    return [record and Timing(record, next(medians)) for record in records]

"""Where the time of `exact` goes, and its time to one error in the last state alone beside that of its closest rival.

Calls are timed in turn, so that the ratios of their times hold on a machine that is shared.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import simulation
from grasp_ros.accuracy.measure import Truth, compare, contender_of, fastest
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.contact.series import expand_one
from grasp_ros.exact.contact.step_unit import series_order
from grasp_ros.exact.driver.workspace import new_workspace
from grasp_ros.exact.integrator import Integrator
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.layout import LANES, LEFT, V, Work, Z
from grasp_ros.scene import Scene
from lab.studies import peer_heyoka

ROUNDS, RUNS, EXPANSIONS = 50, 100, 1000
FINER = 2  # settings a decade of `exact`, as a user of one error has them


class Timing(NamedTuple):
    """Repeats of a solver that reaches the error, without what it compiles."""

    error: float | None
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
    return [record and Timing(record.error, next(medians)) for record in records]


def profile(scene: Scene, accuracy: float) -> list[str]:
    """The cells of one scene at one accuracy: medians of the parts of a run, warm and in turn, and their shares."""
    grid = np.linspace(0.0, scene.duration, simulation.GRID_POINTS)
    order = series_order(accuracy)
    tables, system = new_workspace(order).tables, scene.system
    bodies = system.closed_loop

    def integrate(times: np.ndarray) -> Integrator:
        integrator = Integrator(system, continuous=True, accuracy=accuracy)
        integrator.advance(scene.duration, times)
        return integrator

    parts: list[Callable[[], Any]] = [
        lambda: simulation.simulate(scene, grid=grid, setting=accuracy),
        lambda: integrate(grid),
        lambda: integrate(grid[-1:]),
        lambda: expand_often(tables.c, tables.f, bodies, system.pairs, order, EXPANSIONS),
    ]
    call, outputs, end, expansions = map(statistics.median, in_turn(parts, RUNS))
    steps, expansion = int(integrate(grid[-1:]).work[Work.CONTACT_STEPS]), expansions / EXPANSIONS
    shares = [call - outputs, outputs - end, steps * expansion, end - steps * expansion]
    return [scene.name, f"{accuracy:.0e}", f"{1e3 * call:.3g} ms", *(f"{share / call:.0%}" for share in shares),
            f"{steps}, with one side of order {order}, {1e9 * expansion:.0f} ns each"]


@kernel
def expand_often(c: Any, f: Any, bodies: Any, pairs: Any, order: int, times: int) -> None:
    """Taylor expansions with the left side 1 mm deep at 1 m/s, in its own unit of time."""
    for _ in range(times):
        for lane in range(LANES):
            c[lane] = 0.0
        c[Z.L], c[V.L], c[Z.R] = 0.03, 1.0, -0.1
        expand_one(c, f, bodies, pairs, LEFT, 0.03, order)


def in_turn(
    calls: Sequence[Callable[[], object]], rounds: int, clock: Callable[[], float] = time.perf_counter, what: str = ""
) -> list[list[float]]:
    """So many times of each call in s, each behind a run that is not timed.

    What its predecessor has left in the caches is not a call's own cost.
    """
    times: list[list[float]] = [[] for _ in calls]
    for _ in tqdm(range(rounds), desc=what, file=sys.stderr, leave=False, disable=not what):
        for call, own in zip(calls, times, strict=True):
            call()
            begin = clock()
            call()
            own.append(clock() - begin)
    return times

"""How many runs a second: `ensemble` beside heyoka and scipy in processes, each at its coarsest setting for one error.

heyoka's batch mode advances its lanes in one system of equations, and here each lane would be in another contact mode,
so that its scalar integrators share the work as processes. They are compiled once: the numbers of a scene are heyoka's
runtime parameters. scipy's DOP853 has located events.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.maps.plan import Plan
from grasp_ros.physics.model import Arm, Array, Contact, Grasp
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.simulate import simulate
from lab.cases.draw import relative
from lab.studies.peer_heyoka import BALLISTIC_HERTZ, BALLISTIC_S, HeyokaGrasp, Leg, heyoka_system

ERROR, OFF = 1e-6, 0.02
LADDER = (1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 3e-9, 1e-9, 3e-10, 1e-10, 3e-11, 1e-11, 3e-12, 1e-12)  # of settings
ROWS = {"ensemble": 20_000, "heyoka": 2000, "scipy": 8}
METHOD = "dop853_events"


class Rate(NamedTuple):
    """Runs a second of one way."""

    name: str
    setting: float
    error: float
    workers: int
    per_second: float


class HeyokaRows(HeyokaGrasp):
    """The integrators of all modes, with the numbers of a scene as runtime parameters."""

    def __init__(self, tolerance: float) -> None:
        import heyoka as hy

        par: Any = [hy.par[i] for i in range(15)]
        grasp = Grasp(Arm(*par[:5]), Arm(*par[5:10]), Contact(*par[10:12]), Contact(*par[12:14]), par[14])
        settings = {"tol": tolerance}
        self._legs = [Leg(hy, grasp, mode, settings) for mode in range(4)]
        self._ballistic = hy.taylor_adaptive(heyoka_system(hy, grasp, False, False)[0], [0.0] * 6, **settings)

    def run(self, scene: Scene) -> Array:
        """The last state (6,) of one scene."""
        grasp = scene.grasp
        numbers = [*grasp.left, *grasp.right, *grasp.left_contact, *grasp.right_contact, grasp.object_mass]
        for solver in (*(leg.solver for leg in self._legs), self._ballistic):
            solver.pars[:] = numbers[: len(solver.pars)]  # those of its own equations
        hertzian = max(grasp.left_contact.hertzian, grasp.right_contact.hertzian)
        self._start, self._ballistic_s = scene.initial_state, BALLISTIC_S * (BALLISTIC_HERTZ / hertzian) ** 0.4
        return np.asarray(self(np.array([scene.duration])).state[-1])


@cache
def _heyoka(tolerance: float) -> HeyokaRows:
    return HeyokaRows(tolerance)


def run_heyoka(tolerance: float, scene: Scene) -> Array:
    """The last state of one scene; the integrators of a process are compiled at the first one."""
    return _heyoka(tolerance).run(scene)


def run_scipy(tolerance: float, scene: Scene) -> Array:
    """The last state of one scene; NaN where the solver stops before, in whose favour it counts as a run."""
    found = simulate(scene, grid=np.array([scene.duration]), method=METHOD, setting=tolerance)
    return np.asarray(found.state[-1]) if len(found.state) else np.full(6, np.nan)


def run_ensemble(accuracy: float, scene: Scene) -> Array:
    """The last state of one scene."""
    table = ensemble(scene, {}, ["last_state"], setup=Setup(accuracy=accuracy))
    return np.array([values[0] for values in table.columns.values()])


ONE: dict[str, Callable[[float, Scene], Array]] = {"ensemble": run_ensemble, "heyoka": run_heyoka, "scipy": run_scipy}


def coarsest(name: str, scene: Scene) -> tuple[float, float]:
    """The coarsest setting whose last state has no larger error than `ERROR`, and that error."""
    truth = simulate(scene, grid=np.array([scene.duration])).state[-1]
    setting, error = 0.0, np.inf
    for setting in LADDER:
        error = float(np.abs(ONE[name](setting, scene) - truth).max())
        if error <= ERROR:
            break
    return setting, error


def run(name: str = "case_01", share: float = 1.0) -> list[Rate]:
    """Rates of all ways, one after the other."""
    scene, cores = scenes.load(name), os.cpu_count() or 1
    rates = []
    for way in ONE:
        setting, error = coarsest(way, scene)
        for workers in sorted({1, cores}):
            rows = max(int(ROWS[way] * share), 2 * workers)
            plan = Plan(scene, Setup(("last_state",), setting), relative(scene, OFF), rows, 1)
            variants = plan.variants(0, rows)
            if way == "ensemble":
                begin = time.perf_counter()
                ensemble(scene, variants.changes, plan.setup.outcomes, setup=plan.setup, threads=workers)
                seconds = time.perf_counter() - begin
            else:
                seconds = _in_processes(partial(ONE[way], setting), [variants.row(i) for i in range(rows)], workers)
            rates.append(Rate(way, setting, error, workers, rows / seconds))
    return rates


def _in_processes(one: Callable[[Scene], Array], rows: Sequence[Scene], workers: int) -> float:
    """Time in s of all rows, without that of starting the processes and of compiling."""
    with ProcessPoolExecutor(workers) as pool:
        list(pool.map(one, rows[: 2 * workers], chunksize=1))
        begin = time.perf_counter()
        list(pool.map(one, rows, chunksize=max(1, len(rows) // (8 * workers))))
        return time.perf_counter() - begin


def report(rates: Sequence[Rate]) -> str:
    """A line for each way, with ratios to `ensemble` on as many cores."""
    own: dict[int, float] = {rate.workers: rate.per_second for rate in rates if rate.name == "ensemble"}
    lines = [f"  {'way':10}{'setting':>10}{'error':>10}{'workers':>9}{'runs/s':>11}{'as long':>10}"]
    for rate in rates:
        ratio: Any = own[rate.workers] / rate.per_second
        lines.append(f"  {rate.name:10}{rate.setting:10.0e}{rate.error:10.1e}{rate.workers:9d}"
                     f"{rate.per_second:11.1f}{ratio:9.1f}x")
    return "\n".join(lines)

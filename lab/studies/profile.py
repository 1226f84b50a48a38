"""Where the time of `exact` goes: the call, its outputs, its Taylor expansions, and the rest of the integration."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from grasp_ros import simulation
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.contact.series import expand_one
from grasp_ros.exact.contact.step_unit import series_order
from grasp_ros.exact.driver.workspace import new_workspace
from grasp_ros.exact.integrator import Integrator
from grasp_ros.physics.layout import LANES, LEFT, V, Work, Z
from grasp_ros.scene import Scene
from lab.studies.turns import in_turn

RUNS = 100
EXPANSIONS = 1000


class Profile(NamedTuple):
    """Medians of one scene at one accuracy; all times in s."""

    scene: str
    accuracy: float
    order: int  # of the series with one side in contact
    contact_steps: int
    call: float  # `simulation.simulate` with all outputs
    outputs: float  # the integrator alone, with all outputs
    end: float  # the integrator alone, last state only
    expansion: float  # of one Taylor step with one side in contact

    @property
    def expansions(self) -> float:
        """Time of all expansions in s."""
        return self.contact_steps * self.expansion


def profile(scene: Scene, accuracy: float) -> Profile:
    """Time the parts of a run in turn, warm."""
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
    work = integrate(grid[-1:]).work
    steps = int(work[Work.CONTACT_STEPS])
    return Profile(scene.name, accuracy, order, steps, call, outputs, end, expansions / EXPANSIONS)


@kernel
def expand_often(c: Any, f: Any, bodies: Any, pairs: Any, order: int, times: int) -> None:
    """Taylor expansions with the left side 1 mm deep at 1 m/s, in its own unit of time."""
    for _ in range(times):
        for lane in range(LANES):
            c[lane] = 0.0
        c[Z.L], c[V.L], c[Z.R] = 0.03, 1.0, -0.1
        expand_one(c, f, bodies, pairs, LEFT, 0.03, order)

"""Where the time of `exact` goes: the call, its outputs, its Taylor expansions, and the rest of the integration."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from typing import Any

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


def row(scene: Scene, accuracy: float) -> list[str]:
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

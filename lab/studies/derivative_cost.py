"""What derivatives cost: runs with them, as multiples of the same run without."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.directions import directions
from grasp_ros.sensitivity.run import Carrier
from grasp_ros.simulation.differentiate import complete
from grasp_ros.simulation.simulate import GRID_POINTS, simulate
from lab.studies import pages
from lab.studies.turns import in_turn

NUMBERS = [
    f"{side}_{number}" for side in ("left", "right") for number in (
        "arm.mass_kg", "arm.stiffness_N_per_m", "arm.damping_Ns_per_m", "contact.hertz_N_per_m1_5",
        "contact.dissipation_s_per_m", "feedback.position_gain_N_per_m",
    )
]
SCENES = ("case_01", "tilt_hold", "preload")  # many impacts, and grasps that come to rest early
ROUNDS = 80


def run() -> str:
    """A table of Markdown: the least time of the processor of ROUNDS, in turn."""
    rows = [_row(scenes.load(name), count) for name in SCENES for count in (1, GRID_POINTS)]
    heads = ("scene", "output times", "`simulate`, ms", "states by 1 number", "by 12", "`sensitivity` by 1", "by 12")
    return pages.table(heads, rows)


def _row(scene: Scene, count: int) -> list[str]:
    """Times of a scene with so many output times, the last one at its end."""
    times = np.linspace(0.0, scene.duration, count + 1)[1:]
    without, *others = map(min, in_turn([
        partial(simulate, scene, grid=times),
        *(partial(states_alone, scene, NUMBERS[:chosen], times) for chosen in (1, len(NUMBERS))),
        *(partial(simulate, scene, grid=times, sensitivity=NUMBERS[:chosen]) for chosen in (1, len(NUMBERS))),
    ], ROUNDS, time.thread_time))
    return [scene.name, f"{count}", f"{1e3 * without:.2f}", *(f"{seconds / without:.1f}" for seconds in others)]


def states_alone(scene: Scene, keys: Sequence[str], times: Array) -> Array:
    """Derivatives (m, 6, n) of the states alone: one run."""
    integrator = Integrator(scene.system, continuous=True)
    carrier = Carrier(scene, integrator, directions(scene, keys, False), times, False)
    complete(scene, integrator, False, times)
    carrier.finish()
    return carrier.out

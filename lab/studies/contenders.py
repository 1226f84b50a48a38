"""Who competes: the methods of `grasp simulate`, and the outside peers."""

from __future__ import annotations

import importlib.util
import warnings
from functools import partial

import numpy as np

from grasp_ros import simulation
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.equations import parameters
from grasp_ros.methods.library import slopes
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.studies import peer_heyoka, peer_sundials
from lab.studies.peers import Answer, Contender, Solve

OURS = "grasp_ros"
MAX_STEPS = 10_000_000


def own_contenders() -> list[Contender]:
    """The methods of `grasp simulate`."""
    return [
        Contender(OURS if method.package is None else method.package, name, method.knob, method.ladder,
                  partial(_simulated, name))
        for name, method in METHODS.items()
    ]


def all_contenders() -> list[Contender]:
    """The methods of `grasp simulate` and the outside peers."""
    odeint = Contender("scipy", "odeint", "tolerance", METHODS["lsoda"].ladder, _odeint)
    return [*own_contenders(), odeint, *peer_sundials.contenders(), *peer_heyoka.contenders()]


def _simulated(name: str, scene: Scene, setting: float) -> Solve:
    package = METHODS[name].package
    if package is not None and importlib.util.find_spec(package) is None:
        raise ImportError(package)
    finds = METHODS[name].events

    def solve(grid: Array) -> Answer:
        motion = simulation.simulate(scene, grid=grid, method=name, setting=setting)
        left, right = (len(motion.times(Transition.TOUCH, side)) for side in (LEFT, RIGHT))
        touches = (left, right) if finds else None
        status = "done" if motion.status is Status.DONE else motion.status.value
        counts = motion.counters
        steps = sum(counts.get(counter, 0) for counter in ("steps", "flights", "contact steps"))
        return Answer(motion.state, touches, status, steps, counts.get("right hand sides"))

    return solve


def _odeint(scene: Scene, tolerance: float) -> Solve:
    """LSODA over everything, with its loop over the steps outside Python."""
    from scipy.integrate import odeint

    args = (parameters(scene.system), True, True)

    def solve(grid: Array) -> Answer:
        times = grid if grid[0] == 0.0 else np.concatenate([[0.0], grid])
        with warnings.catch_warnings():  # an integration that fails says so in its status
            warnings.simplefilter("ignore")
            states, report = odeint(
                slopes, scene.initial_state, times, args, rtol=tolerance, atol=tolerance, tfirst=True,
                mxstep=MAX_STEPS, full_output=True,
            )
        status = "done" if report["message"] == "Integration successful." else report["message"]
        return Answer(states[-len(grid) :], None, status, int(report["nst"][-1]), int(report["nfe"][-1]))

    return solve

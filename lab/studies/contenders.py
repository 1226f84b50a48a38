"""Who competes: the methods of `grasp simulate`, and the outside peers."""

from __future__ import annotations

import warnings

import numpy as np

from grasp_ros.accuracy.measure import DONE, Answer, Contender, Solve, own_contenders
from grasp_ros.methods.equations import parameters
from grasp_ros.methods.library import slopes
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.studies import peer_heyoka, peer_sundials

MAX_STEPS = 10_000_000


def all_contenders(scene: Scene) -> list[Contender]:
    """The methods of `grasp simulate` that can treat a scene, and the outside peers."""
    own, _ = own_contenders(scene)
    odeint = Contender("scipy", "odeint", "tolerance", METHODS["lsoda"].ladder, _odeint)
    return [*own, odeint, *peer_sundials.contenders(), *peer_heyoka.contenders()]


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
        status = DONE if report["message"] == "Integration successful." else report["message"]
        return Answer(states[-len(grid) :], None, status, int(report["nst"][-1]), int(report["nfe"][-1]))

    return solve

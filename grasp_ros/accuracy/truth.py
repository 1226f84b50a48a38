"""What solvers are held against: the exact method at its finest, with an estimate of its own error.

A motion in double precision is known no better than the scene amplifies roundings. So the estimate is the largest
difference to runs that begin a rounding of the largest position beside the initial state; or, if that is more, a tenth
of the difference to a run with ten times the first neglected term.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.accuracy import FINEST
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import EPS, LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.force import SECTIONS
from grasp_ros.simulation.simulate import GRID_POINTS, simulate
from grasp_ros.simulation.trajectory import Trajectory

FINER = 10.0


class Truth(NamedTuple):
    """A motion that is known."""

    grid: Array  # (n,), s
    state: Array  # (n, 6), m and m/s
    touches: tuple[int, int]
    uncertainty: float = 0.0  # of the states, m and m/s


def finest(scene: Scene) -> Truth:
    """The motion of a scene to its end, and how well it is known."""
    grid = np.linspace(0.0, scene.duration, GRID_POINTS)
    run = simulate(scene, grid=grid, setting=FINEST)
    if run.status is not Status.DONE:
        raise Refused(f"{scene.name}: {run.stop}; allowed here: a scene that runs to its end")
    rounding = EPS * float(np.nanmax(np.abs(run.state[:, 0::2])))
    apart = [distance(run, simulate(scene, grid=grid, setting=FINER * FINEST).state) / FINER]
    for body in {*SECTIONS} & {*scene.values}:
        beside = scene.changed({f"{body}.position_m": scene.values[body]["position_m"] + rounding})  # farther right
        apart.append(distance(run, simulate(beside, grid=grid, setting=FINEST).state))
    left, right = (len(run.times(Transition.TOUCH, side)) for side in (LEFT, RIGHT))
    return Truth(grid, run.state, (left, right), max(apart))


def distance(truth: Truth | Trajectory, state: Array) -> float:
    """Largest difference of states (n, 6) to the last n of a motion that is known, m and m/s; without absent bodies."""
    known = truth.state[-len(state) :]
    return float(np.abs(state - known)[~np.isnan(known)].max(initial=0.0))

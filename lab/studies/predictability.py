"""How far ahead a scene can be predicted in double precision."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Integrator
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.reference.grasp import grasp_of, system_of

SECONDS = 100.0
POINTS = 10_001
RUNS = 8
ROUNDINGS = 2.0  # of the initial state, in units of its last place
SMALL = 1e-11  # relative, of the perturbation whose growth is measured; still small when the scene has amplified it
LEVELS = (1e-9, 1e-6, 1e-3)


class Prediction(NamedTuple):
    """One scene."""

    scene: str
    t: Array  # (n,), s
    distance: Array  # (n,): largest distance so far of motions that begin some roundings apart, m or m/s
    growth: float  # of a small perturbation over the scene's own duration, largest component by largest component

    def until(self, level: float) -> float | None:
        """When the distance passes a level, s; None: not within the time that was looked at."""
        passed = np.nonzero(self.distance > level)[0]
        return float(self.t[passed[0]]) if len(passed) else None


def predict(scene: Scene, seconds: float = SECONDS) -> Prediction:
    """Measure with `exact`; the perturbations are the same in every run."""
    grid = np.linspace(0.0, seconds, POINTS)
    signs = np.random.default_rng(1990).choice([-1.0, 1.0], size=(RUNS, 6))
    start = scene.initial_state
    plain = states_from(scene, start, grid)
    shifted = [states_from(scene, start + ROUNDINGS * np.spacing(np.abs(start)) * sign, grid) for sign in signs]
    distance = np.maximum.accumulate(np.abs(np.array(shifted) - plain).max(axis=(0, 2)))
    own = np.linspace(0.0, scene.duration, POINTS)
    plain = states_from(scene, start, own)
    pushes = SMALL * np.abs(start).max() * signs
    grown = max(np.abs(states_from(scene, start + push, own) - plain).max() for push in pushes)
    return Prediction(scene.name, grid, distance, float(grown / np.abs(pushes).max()))


def states_from(scene: Scene, start: Array, grid: Array) -> Array:
    """States (n, 6) of the motion of a scene that begins in another state (6,), at times in s."""
    return Integrator(system_of(grasp_of(scene), start), continuous=True).advance(float(grid[-1]), grid)

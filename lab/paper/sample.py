"""Places on a motion at which equations are held against it, with derivatives from the dense output."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from grasp_ros.physics.energy import Energy, energy, pairs_of
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Array, Mode
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.reference.grasp import grasp_of

STEP = 2e-4  # s, of the differences
STENCIL = np.array([1.0 / 280.0, -4.0 / 105.0, 0.2, -0.8, 0.0, 0.8, -0.2, 4.0 / 105.0, -1.0 / 280.0])  # order 8
POINTS = 12  # in each stretch between two events


class Sample:
    """One motion, at points between its events, with the derivatives of everything."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.system, self.grasp = scene, scene.system, grasp_of(scene)
        self.run = simulate(scene)
        edges = np.unique(np.concatenate([[0.0], self.run.event_table[:, 0], [scene.duration]]))
        reach = 4.0 * STEP
        times = [np.linspace(a + 2 * reach, b - 2 * reach, POINTS) for a, b in pairwise(edges) if b - a > 20.0 * reach]
        self.t: Array = np.concatenate(times)
        grid = (self.t[:, None] + STEP * np.arange(-4, 5)).ravel()
        order = np.argsort(grid, kind="stable")  # in a short contact the stencils overlap
        states: Array = np.empty((len(grid), 6))
        states[order] = simulate(scene, grid=grid[order]).state
        states = states.reshape(len(self.t), 9, 6)
        self.stencils = states
        self.state: Array = states[:, 4]
        self.rate: Array = np.einsum("k,nki->ni", STENCIL, states) / STEP

    @cached_property
    def crosses(self) -> bool:
        """Whether a pair separates faster than 1/p while it penetrates, and moves on another scale of time then."""
        return bool((self.run.event_table[:, 2] == Transition.CLAMP).any())

    @cached_property
    def level(self) -> Energy:
        """V, V_c, V' at the points."""
        return energy(self.system, self.state)

    @cached_property
    def V_rate(self) -> Array:
        """V differentiated."""
        return self.differentiated(energy(self.system, self.stencils).V)

    @property
    def fastest(self) -> float:
        """The largest rate of V, W; 1 where V does not change."""
        return float(np.abs(self.level.V_rate).max()) or 1.0

    def differentiated(self, values: Array) -> Array:
        """The derivative at each point of what is known on the stencils, (n, 9) or (m, 9)."""
        return np.asarray(values @ STENCIL / STEP)

    def pair(self, side: int) -> tuple[Array, Array]:
        """u and u' of one side."""
        return next((u, d) for which, _, u, d in pairs_of(self.system, self.state) if which == side)

    def where(self, mode: Mode) -> np.ndarray:
        """Places in a condition of contact."""
        return np.asarray(self.level.mode == int(mode))


def relative(a: Array, b: Array) -> float:
    """Largest difference in the largest |b|."""
    return float(np.abs(a - b).max() / np.abs(b).max()) if np.size(b) else 0.0

"""The observer that carries the tangents of a run along, with its memory."""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.driver.callback import Observer
from grasp_ros.exact.integrator import Integrator
from grasp_ros.physics.control import normals_of
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.directions import Directions
from grasp_ros.sensitivity.propagate import propagate
from grasp_ros.sensitivity.tangents import CORNERS, Corner, Count, Number, tangents_of


class Carrier(Observer):
    """Carries the tangents of one run, which has not begun, along as the observer of its integrator.

    `times` (m,) are output times in s, in any order, the last e of them those of events; `sampled`: commands are held.
    `x` (6, n) has the derivatives of the state now, `out` (m, 6, n) those at the output times. `forces` (e, 3, 2 + n)
    has of each body, at the events, its mass in kg, infinite while it sticks, the constant force on it in N, and its
    derivatives.
    """

    def __init__(self, scene: Scene, integrator: Integrator, directions: Directions, times: Array, sampled: bool,
                 e: int = 0) -> None:
        system, n = scene.system, directions.state.shape[1]
        changes = directions if sampled else directions.closed_loop(system)
        tangents = tangents_of(integrator.plant, integrator.records, changes, times, e)
        if sampled or system.external:
            tangents.counts[Count.DRIVEN], tangents.numbers[Number.PERIOD] = 1, scene.time_of(1)
        if sampled:
            tangents = tangents._replace(
                control=system.law_rows, control_rates=directions.laws, waiting=np.zeros((system.delay, 2, n)),
                normals=normals_of(system.laws, 0, scene.ticks + 1))
        super().__init__(propagate, tangents)
        self.x, self.out, self.forces = tangents.x[:, :n], tangents.out, tangents.forces
        integrator.observer = self

    @property
    def corner(self) -> float | None:
        """First time in s at which one-sided derivatives differ; None: there is none."""
        corner = float(self.memory.numbers[Number.CORNER])
        return corner if math.isfinite(corner) else None

    @property
    def corner_reason(self) -> str | None:
        """Why they differ there."""
        return None if self.corner is None else CORNERS[Corner(self.memory.counts[Count.CORNER])]

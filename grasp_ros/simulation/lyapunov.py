"""The largest Lyapunov exponent of a run: the mean rate at which a small difference of states grows.

Two trajectories, renormalised (G. Benettin, L. Galgani, J.-M. Strelcyn, Kolmogorov entropy and numerical experiments,
Physical Review A 14 (1976)): the second one begins at a distance d of the first, and after each piece of time it is
put back to that distance, in the direction in which it lies. The exponent is the mean of ln(distance / d) per time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, System

DISTANCE = 1e-8  # of the state: far above rounding, far below what a touch tells apart
PIECE_S = 0.5


def exponent(system: System, duration: float, accuracy: float) -> float:
    """Largest Lyapunov exponent over a run under continuous feedback, 1/s; nan if it stops.

    Distances are those of the states of the bodies that are there, (x, v) in m and m/s.
    """
    places = [place for body in system.present for place in (COLUMN[body], COLUMN[body] + 1)]
    first, apart = system.state, np.zeros(6)
    distance = DISTANCE * float(np.linalg.norm(first))
    apart[places] = distance / math.sqrt(len(places))
    pieces, total = max(math.ceil(duration / PIECE_S), 1), 0.0
    for _ in range(pieces):
        second = _moved(system, first + apart, duration / pieces, accuracy)
        first = _moved(system, first, duration / pieces, accuracy)
        apart = second - first
        grown = float(np.linalg.norm(apart))
        if not 0.0 < grown < math.inf:
            return math.nan
        total += math.log(grown / distance)
        apart *= distance / grown
    return total / duration


def _moved(system: System, state: Array, seconds: float, accuracy: float) -> Array:
    """State after some time; nan if the run stops."""
    integrator = Integrator(replace(system, state=state), continuous=True, accuracy=accuracy)
    integrator.advance(seconds)
    return integrator.state if integrator.status is Status.DONE else np.full(6, np.nan)

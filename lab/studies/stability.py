"""At which control period the sampled loop of a free arm loses stability, confirmed by simulation."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.control import ControlLaw
from grasp_ros.physics.layout import LEFT, Of, V, X
from grasp_ros.physics.model import Arm
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation import SampledPlant
from lab.reference.grasp import commands

FIRST_S, LAST_S, SCAN = 1e-4, 10.0, 3000  # periods that are looked at for the first crossing
TICKS = 4000
NEAR = (0.98, 1.02)  # of the limit: where the simulation confirms it


class Limit(NamedTuple):
    """Loss of stability of one arm."""

    delay: int  # periods
    period: float  # s; infinite if there is none
    checks: tuple[tuple[float, float], ...]  # period, growth per period in the simulation


def first_limit(arm: Arm, delay: int) -> float:
    """Smallest period in s at which the spectral radius passes 1 upwards; infinite if there is none up to LAST_S."""
    from scipy.optimize import brentq

    periods = np.geomspace(FIRST_S, LAST_S, SCAN)
    above = spectral_radius(arm, periods, delay) >= 1.0
    crossings = np.nonzero(above[1:] & ~above[:-1])[0]
    if not len(crossings):
        return math.inf
    low, high = periods[crossings[0]], periods[crossings[0] + 1]
    return float(brentq(lambda h: spectral_radius(arm, h, delay) - 1.0, low, high, xtol=1e-15, rtol=1e-15))


def simulated_growth(arm: Arm, period: float, delay: int, ticks: int = TICKS) -> float:
    """Growth per period of an arm alone in the plant's own simulation, from the second half of the run."""
    system = System(delay=delay, laws={LEFT: ControlLaw(arm.position_gain, arm.velocity_gain)})
    system.bodies[LEFT, :Of.FORCE] = arm.mass, arm.stiffness, arm.damping
    system.state[X.L] = 1e-150  # room to grow
    plant = SampledPlant(system, round(period * NANOSECONDS))
    sizes = []
    for tick in range(ticks):
        state = plant.state
        speed = math.sqrt((arm.stiffness + arm.position_gain) / arm.mass) * state[X.L]
        sizes.append(math.hypot(speed, state[V.L]))
        plant.step(commands(system, tick, state))
    half = ticks // 2
    window = ticks // 8  # maxima over a window: the phase of the oscillation drops out
    return float((max(sizes[-window:]) / max(sizes[half - window : half])) ** (1.0 / (ticks - half)))


def limits(arm: Arm, delays: tuple[int, ...] = (0, 1)) -> list[Limit]:
    """The first limit for each delay, confirmed by simulation a little below and above it."""
    found = []
    for delay in delays:
        period = first_limit(arm, delay)
        near = [factor * period for factor in NEAR if math.isfinite(period)]
        checks = tuple((h, simulated_growth(arm, h, delay)) for h in near)
        found.append(Limit(delay, period, checks))
    return found

"""Sensors of an arm: seeded noise, then quantisation."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Sections
from grasp_ros.scene.parameter import Parameter

PARAMETERS = (
    Parameter("noise_seed", 0, 2**31 - 1, "seed of the noise", whole=True),
    Parameter("position_noise_m", 0.0, 1e3, "standard deviation of the measured position", optional=True),
    Parameter("velocity_noise_m_per_s", 0.0, 1e3, "standard deviation of the measured velocity", optional=True),
    Parameter("position_step_m", 1e-12, 1e3, "resolution of the measured position", optional=True),
    Parameter("velocity_step_m_per_s", 1e-12, 1e3, "resolution of the measured velocity", optional=True),
)
BLOCK = 1024  # ticks whose noise is drawn at once


@lru_cache(maxsize=16)
def _noise(seed: int, side: int, block: int) -> Array:
    """Standard normal numbers (BLOCK, 2) of one block of ticks: the same for whoever asks, in whatever order."""
    return np.random.default_rng([seed, side, block]).standard_normal((BLOCK, 2))


def _add_noise(seed: int, side: int, deviations: tuple[float, float], tick: int, x: float, v: float) -> tuple[
    float, float
]:
    block, row = divmod(tick, BLOCK)
    draw = _noise(seed, side, block)[row]
    return float(x + deviations[0] * draw[0]), float(v + deviations[1] * draw[1])


def _round(steps: tuple[float, float], _: int, x: float, v: float) -> tuple[float, float]:
    """To the nearest step; a step of 0 means no rounding."""
    return (
        steps[0] * round(x / steps[0]) if steps[0] else x,
        steps[1] * round(v / steps[1]) if steps[1] else v,
    )


def _build(side: str, sections: Sections, system: System) -> None:
    numbers = sections[f"{side}_sensor"]
    stages = system.laws[SIDES[side]].sensing
    deviations = numbers.get("position_noise_m", 0.0), numbers.get("velocity_noise_m_per_s", 0.0)
    steps = numbers.get("position_step_m", 0.0), numbers.get("velocity_step_m_per_s", 0.0)
    if any(deviations):
        stages.append(partial(_add_noise, numbers["noise_seed"], int(SIDES[side]), deviations))
        system.caveats.append(f"the {side} arm is measured with noise")
    if any(steps):
        stages.append(partial(_round, steps))
        system.caveats.append(f"the {side} arm is measured in steps")


EFFECTS = tuple(
    Effect(
        f"{side}_sensor", f"the {side} controller measures its arm with noise and in steps", PARAMETERS,
        partial(_build, side), "no certificate: wrong measurements do work through the feedback",
        needs=(f"{side}_feedback", "loop"), node=f"{side}_controller",
        example={
            "noise_seed": 1, "position_noise_m": 1e-4, "velocity_noise_m_per_s": 1e-3, "position_step_m": 1e-4,
            "velocity_step_m_per_s": 1e-3,
        },
    )
    for side in SIDES
)

"""Sensors of an arm: seeded noise, then quantisation."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache, partial

import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Oddity, Sections
from grasp_ros.scene.parameter import Parameter

PARAMETERS = (
    Parameter("noise_seed", 0, 2**31 - 1, "seed of the noise", whole=True),
    Parameter("position_noise_m", 0.0, 1e3, "standard deviation of the measured position", optional=True),
    Parameter("velocity_noise_m_per_s", 0.0, 1e3, "standard deviation of the measured velocity", optional=True),
    Parameter("position_step_m", 1e-12, 1e3, "resolution of the measured position", optional=True),
    Parameter("velocity_step_m_per_s", 1e-12, 1e3, "resolution of the measured velocity", optional=True),
)
WHOLE = 2.0**53  # from here on every number is a whole one
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


def _to_step(step: float, x: float) -> float:
    """The nearest multiple of a step; x itself without a step, or where its own rounding is wider than the step."""
    if step and abs(x / step) < WHOLE:  # neither infinity nor NaN is
        return step * round(x / step)
    return x


def _round(steps: tuple[float, float], _: int, x: float, v: float) -> tuple[float, float]:
    return _to_step(steps[0], x), _to_step(steps[1], v)


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


def _odd(side: str, sections: Sections, _: System) -> Iterable[Oddity]:
    section = f"{side}_sensor"
    numbers, gains = sections[section], sections[f"{side}_feedback"]
    wrong = {what: any(numbers.get(key) for key in (f"{what}_noise_{unit}", f"{what}_step_{unit}"))
             for what, unit in (("position", "m"), ("velocity", "m_per_s"))}
    used = {"position": gains["position_gain_N_per_m"], "velocity": gains["velocity_gain_Ns_per_m"]}
    if not any(wrong.values()):
        yield Oddity(section, numbers, "has no effect: it measures exactly", "a noise or a step above 0")
    elif not any(wrong[what] and used[what] for what in wrong):
        why = "has no effect: the gains of what it measures wrongly are 0"
        yield Oddity(section, numbers, why, f"gains of {side}_feedback that are not 0")


EFFECTS = tuple(
    Effect(
        f"{side}_sensor", f"the {side} controller measures its arm with noise and in steps", PARAMETERS,
        partial(_build, side), "no certificate: wrong measurements do work through the feedback",
        needs=(f"{side}_feedback", "loop"), node=f"{side}_controller", oddities=partial(_odd, side),
        example={
            "noise_seed": 1, "position_noise_m": 1e-4, "velocity_noise_m_per_s": 1e-3, "position_step_m": 1e-4,
            "velocity_step_m_per_s": 1e-3,
        },
    )
    for side in SIDES
)

"""Sensors of an arm: seeded noise, then quantisation."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.control import Column
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
COLUMNS = (  # of the law, and the numbers of the scene that stand in them
    (Column.POSITION_NOISE, "position_noise_m"), (Column.VELOCITY_NOISE, "velocity_noise_m_per_s"),
    (Column.POSITION_STEP, "position_step_m"), (Column.VELOCITY_STEP, "velocity_step_m_per_s"),
)

GAINS = {"position": "position_gain_N_per_m", "velocity": "velocity_gain_Ns_per_m"}  # of what is measured


def _build(side: str, sections: Sections, system: System) -> None:
    numbers, law = sections[f"{side}_sensor"], system.laws[SIDES[side]]
    for column, key in COLUMNS:
        law.row[column] = numbers.get(key, 0.0)
    if law.row[[Column.POSITION_NOISE, Column.VELOCITY_NOISE]].any():
        law.seed = numbers["noise_seed"], int(SIDES[side])
        system.caveats.append(f"the {side} arm is measured with noise")
    if law.row[[Column.POSITION_STEP, Column.VELOCITY_STEP]].any():
        system.caveats.append(f"the {side} arm is measured in steps")


def _odd(side: str, sections: Sections, system: System) -> Iterable[Oddity]:
    section = f"{side}_sensor"
    numbers, gains = sections[section], sections[f"{side}_feedback"]
    wrong = {key: numbers[key] for _, key in COLUMNS if numbers.get(key)}
    unused = {key: value for key, value in wrong.items() if gains[GAINS[key.partition("_")[0]]] == 0.0}
    if not wrong:
        yield Oddity(section, numbers, "has no effect: it measures exactly", "a noise or a step above 0")
    elif unused == wrong:
        why = "has no effect: the gains of what it measures wrongly are 0"
        yield Oddity(section, numbers, why, f"gains of {side}_feedback that are not 0")
    else:
        for key, value in unused.items():
            gain = f"{side}_feedback.{GAINS[key.partition('_')[0]]}"
            yield Oddity(f"{section}.{key}", value, f"has no effect: {gain} is 0", "a gain that is not 0")
        reach = max(map(abs, (*system.state[0::2].tolist(), system.laws[SIDES[side]].set_point)))
        if reach > 0.0 and wrong.get("position_step_m", 0.0) > 2.0 * reach:
            why = f"measures 0 everywhere within {reach:g} m, where all bodies start"
            yield Oddity(f"{section}.position_step_m", wrong["position_step_m"], why, "a smaller step")


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

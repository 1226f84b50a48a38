"""Sensors of an arm: seeded noise, then quantisation."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.control import Column
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Sections, oddity

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
        system.caveats.append(f"the {side} sensor quantises")


def _odd(side: str, sections: Sections, system: System) -> Iterable[str]:
    """Numbers of what no gain uses, and a step that measures nothing."""
    section = f"{side}_sensor"
    wrong = {key: value for _, key in COLUMNS if (value := sections[section].get(key))}
    for key, value in wrong.items():
        if sections[f"{side}_feedback"][gain := GAINS[key.partition("_")[0]]] == 0.0:
            why = f"has no effect: {side}_feedback.{gain} is 0"
            yield oddity(f"{section}.{key}", value, why, "a gain that is not 0")
    reach = max(map(abs, (*system.state[0::2].tolist(), float(system.laws[SIDES[side]].row[Column.SET_POINT]))))
    if wrong.get("position_step_m", 0.0) > 2.0 * reach > 0.0:
        why = f"measures 0 everywhere within {reach:g} m, where all bodies start"
        yield oddity(f"{section}.position_step_m", wrong["position_step_m"], why, "a smaller step")


EFFECTS = tuple(
    Effect(
        f"{side}_sensor", f"the {side} controller measures its arm with noise and in steps", PARAMETERS,
        partial(_build, side), "no certificate: wrong measurements do work through the feedback",
        needs=(f"{side}_feedback", "loop"), node=f"{side}_controller", oddities=partial(_odd, side),
        acts_by=tuple(key for _, key in COLUMNS),
        example={
            "noise_seed": 1, "position_noise_m": 1e-4, "velocity_noise_m_per_s": 1e-3, "position_step_m": 1e-4,
            "velocity_step_m_per_s": 1e-3,
        },
    )
    for side in SIDES
)

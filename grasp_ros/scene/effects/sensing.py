"""Sensors of an arm: seeded noise, then quantisation."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.control import Column
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Sections, oddity

SEED = Parameter("noise_seed", 0, 2**31 - 1, "seed of the noise", whole=True)
MEASURED = (
    Parameter("position_noise_m", 0.0, 1e3, "standard deviation of the measured position", optional=True,
              target=("laws", Column.POSITION_NOISE)),
    Parameter("velocity_noise_m_per_s", 0.0, 1e3, "standard deviation of the measured velocity", optional=True,
              target=("laws", Column.VELOCITY_NOISE)),
    Parameter("position_step_m", 1e-12, 1e3, "resolution of the measured position", optional=True,
              target=("laws", Column.POSITION_STEP)),
    Parameter("velocity_step_m_per_s", 1e-12, 1e3, "resolution of the measured velocity", optional=True,
              target=("laws", Column.VELOCITY_STEP)),
)
GAINS = {"position": "position_gain_N_per_m", "velocity": "velocity_gain_Ns_per_m"}  # of what is measured


def _build(side: str, sections: Sections, system: System) -> None:
    law = system.laws[SIDES[side]]
    if law.row[[Column.POSITION_NOISE, Column.VELOCITY_NOISE]].any():
        law.seed = sections[f"{side}_sensor"]["noise_seed"], int(SIDES[side])
        system.caveats.append(f"the {side} arm is measured with noise")
    if law.row[[Column.POSITION_STEP, Column.VELOCITY_STEP]].any():
        system.caveats.append(f"the {side} sensor quantises")


def _odd(side: str, sections: Sections, system: System) -> Iterable[str]:
    """Numbers of what no gain uses, and a step that measures nothing."""
    section = f"{side}_sensor"
    wrong = {key: value for key, value in sections[section].items() if value and key != SEED.key}
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
        f"{side}_sensor", f"the {side} controller measures its arm with noise and in steps", (SEED, *MEASURED),
        partial(_build, side), "no certificate: wrong measurements do work through the feedback",
        needs=(f"{side}_feedback", "loop"), node=f"{side}_controller", oddities=partial(_odd, side),
        acts_by=tuple(parameter.key for parameter in MEASURED), row=SIDES[side],
        example={
            "noise_seed": 1, "position_noise_m": 1e-4, "velocity_noise_m_per_s": 1e-3, "position_step_m": 1e-4,
            "velocity_step_m_per_s": 1e-3,
        },
    )
    for side in SIDES
)

"""The bodies: arms with or without spring and damper, and the object. A scene has at least one."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.layout import OBJECT, Of
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Relation, Sections, nothing, problem

MASS_KG = Parameter("mass_kg", *RANGES["mass"].bounds, "mass", target=("bodies", Of.MASS))
MOTION = (
    Parameter("position_m", *RANGES["position, set-point"].bounds, "initial position", smallest=0.0,
              target=("state", 0)),
    Parameter("velocity_m_per_s", *RANGES["velocity"].bounds, "initial velocity", smallest=0.0, target=("state", 1)),
)
SPRING = Parameter("stiffness_N_per_m", *RANGES["stiffness of an arm"].bounds, "spring of the arm, k", optional=True,
                   target=("bodies", Of.STIFFNESS))
DAMPER = Parameter("damping_Ns_per_m", *RANGES["damping, drag"].bounds, "damper of the arm, c", optional=True,
                   target=("bodies", Of.DAMPING))
NEGATIVE = "a negative one drives an arm away, or adds energy"
SUMS = {"stiffness_N_per_m": "position_gain_N_per_m", "damping_Ns_per_m": "velocity_gain_Ns_per_m"}


def _negative_sum(side: str, own: str, gain: str, sections: Sections) -> Iterable[str]:
    total = sections[f"{side}_arm"].get(own, 0.0) + sections.get(f"{side}_feedback", {}).get(gain, 0.0)
    if total < 0.0:
        yield problem(f"{side}_arm, {side}_feedback: {own} + {gain}", total, "a sum >= 0")


EFFECTS = (
    *(
        Effect(
            f"{side}_arm", f"{side} arm: a mass, with a spring and a damper to the ground where they are named",
            (MASS_KG, SPRING, DAMPER, *MOTION), nothing, "m x'^2 + k x^2; the damper takes 2 c x'^2", row=body,
            relations=tuple(
                Relation(f"`{own}` + `{gain}` of its feedback >= 0", NEGATIVE, partial(_negative_sum, side, own, gain))
                for own, gain in SUMS.items()),
        )
        for side, body in SIDES.items()
    ),
    Effect("object", "the object: a free mass", (MASS_KG, *MOTION), nothing, "m x'^2", row=OBJECT),
)

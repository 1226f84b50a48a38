"""The bodies: arms with or without spring and damper, and the object. A scene has at least one."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.layout import OBJECT, Of
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene.effects.base import SIDES, Effect, Problem, Sections
from grasp_ros.scene.parameter import Parameter

MASS_KG = Parameter("mass_kg", *RANGES["mass"].bounds, "mass")
MOTION = (
    Parameter("position_m", *RANGES["position, set-point"].bounds, "initial position", smallest=0.0),
    Parameter("velocity_m_per_s", *RANGES["velocity"].bounds, "initial velocity", smallest=0.0),
)
SPRING = Parameter("stiffness_N_per_m", *RANGES["stiffness of an arm"].bounds, "spring of the arm, k", optional=True)
DAMPER = Parameter("damping_Ns_per_m", *RANGES["damping, drag"].bounds, "damper of the arm, c", optional=True)


def _build(section: str, body: int, sections: Sections, system: System) -> None:
    """m x'' + c x' + k x = ..., (1) to (3)."""
    numbers = sections[section]
    system.bodies[body, Of.MASS] = numbers["mass_kg"]
    system.bodies[body, Of.STIFFNESS] = numbers.get("stiffness_N_per_m", 0.0)
    system.bodies[body, Of.DAMPING] = numbers.get("damping_Ns_per_m", 0.0)
    column = COLUMN[body]
    system.state[column : column + 2] = numbers["position_m"], numbers["velocity_m_per_s"]


def _negative_sums(side: str, sections: Sections) -> Iterable[Problem]:
    arm, gains = sections[f"{side}_arm"], sections.get(f"{side}_feedback", {})
    for own, gain in (
        ("stiffness_N_per_m", "position_gain_N_per_m"),
        ("damping_Ns_per_m", "velocity_gain_Ns_per_m"),
    ):
        total = arm.get(own, 0.0) + gains.get(gain, 0.0)
        if total < 0.0:
            yield Problem(f"{side}_arm, {side}_feedback: {own} + {gain}", total, "a sum >= 0")


EFFECTS = (
    *(
        Effect(
            f"{side}_arm", f"{side} arm: a mass, with a spring and a damper to the ground where they are named",
            (MASS_KG, SPRING, DAMPER, *MOTION), partial(_build, f"{side}_arm", body),
            "m x'^2 + k x^2; the damper takes 2 c x'^2", problems=partial(_negative_sums, side),
        )
        for side, body in SIDES.items()
    ),
    Effect("object", "the object: a free mass", (MASS_KG, *MOTION), partial(_build, "object", OBJECT), "m x'^2"),
)

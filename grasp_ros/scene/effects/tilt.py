"""A tilted line: gravity pulls every body along it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.layout import Of
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import Effect, Parameter, Sections, oddity


def _build(sections: Sections, system: System) -> None:
    """m x'' = ... - m g sin(angle)."""
    numbers = sections["tilt"]
    pull = numbers["gravity_m_per_s2"] * math.sin(numbers["angle_rad"])
    for body in system.present:
        system.bodies[body, Of.FORCE] -= system.bodies[body, Of.MASS] * pull


def _odd(sections: Sections, _: System) -> Iterable[str]:
    for key, value in sections["tilt"].items():
        if value == 0.0:
            yield oddity(f"tilt.{key}", value, "leaves the whole section without effect", "a number that is not 0")


EFFECTS = (
    Effect(
        "tilt", "the line is tilted: gravity pulls every body along it",
        (
            Parameter("angle_rad", -math.pi / 2, math.pi / 2, "angle of the line, positive if the right end is higher"),
            Parameter("gravity_m_per_s2", *RANGES["gravity"].bounds, "gravitational acceleration"),
        ),
        _build, "2 m g sin(angle) x of every body: V_c is known up to a constant", oddities=_odd,
        example={"angle_rad": 0.02, "gravity_m_per_s2": 9.81},
    ),
)

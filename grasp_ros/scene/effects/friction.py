"""Friction of the object on its line: viscous, and dry with sticking (Coulomb)."""

from __future__ import annotations

from collections.abc import Iterable

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.layout import OBJECT, Of
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import Effect, Oddity, Sections
from grasp_ros.scene.parameter import Parameter


def _build(sections: Sections, system: System) -> None:
    """m_o x_o'' = ... - c x_o' - F sign(x_o'); at x_o' = 0 the friction balances up to F."""
    numbers = sections["object_friction"]
    system.bodies[OBJECT, Of.DAMPING] += numbers.get("viscous_Ns_per_m", 0.0)
    system.coulomb += numbers.get("coulomb_N", 0.0)


def _odd(sections: Sections, _: System) -> Iterable[Oddity]:
    numbers = sections["object_friction"]
    if not any(numbers.values()):
        yield Oddity("object_friction", numbers, "has no effect", "viscous_Ns_per_m or coulomb_N above 0")


EFFECTS = (
    Effect(
        "object_friction", "friction of the object on its line, viscous and dry",
        (
            Parameter("viscous_Ns_per_m", *RANGES["damping, drag"].bounds, "drag of the object", optional=True),
            Parameter("coulomb_N", 0.0, RANGES["force"].high, "dry friction, sliding and sticking alike",
                      optional=True),
        ),
        _build, "takes 2 c x_o'^2 + 2 F |x_o'|", needs=("object",), oddities=_odd,
        example={"viscous_Ns_per_m": 0.2, "coulomb_N": 0.2},
    ),
)

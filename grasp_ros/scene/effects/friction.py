"""Friction of the object on its line: viscous, and dry with sticking (Coulomb)."""

from __future__ import annotations

from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.layout import OBJECT, Of
from grasp_ros.scene.effects.base import Effect, Parameter, nothing

EFFECTS = (
    Effect(
        "object_friction", "friction of the object on its line, viscous and dry",
        (
            Parameter("viscous_Ns_per_m", *RANGES["damping, drag"].bounds, "drag of the object", optional=True,
                      target=("bodies", Of.DAMPING)),
            Parameter("coulomb_N", 0.0, RANGES["force"].high, "dry friction, sliding and sticking alike",
                      optional=True, target=("coulomb", 0)),
        ),
        nothing, "takes 2 c x_o'^2 + 2 F |x_o'|", needs=("object",), row=OBJECT,
        acts_by=("viscous_Ns_per_m", "coulomb_N"), example={"viscous_Ns_per_m": 0.2, "coulomb_N": 0.2},
    ),
)

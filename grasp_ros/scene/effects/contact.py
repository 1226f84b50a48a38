"""The contact of one pair of arm and object: the Hunt-Crossley law (6), (7), with or without dissipation."""

from __future__ import annotations

from functools import partial

from grasp_ros.physics.layout import DISSIPATION, HERTZIAN, LEFT
from grasp_ros.physics.model import Array, Contact, impact_force, penetration
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Output, Sections
from grasp_ros.scene.parameter import Parameter
from grasp_ros.scene.topics import CONTACTS

PARAMETERS = (
    Parameter("hertz_N_per_m1_5", 0.0, 1e15, "Hertzian stiffness of the impact, H", open_low=True),
    Parameter("dissipation_s_per_m", 0.0, 1e12, "Hunt-Crossley dissipation of the impact, p", optional=True),
)


def _build(side: str, sections: Sections, system: System) -> None:
    numbers = sections[f"{side}_contact"]
    row = system.pairs[SIDES[side]]
    row[HERTZIAN], row[DISSIPATION] = numbers["hertz_N_per_m1_5"], numbers.get("dissipation_s_per_m", 0.0)


def _force(side: int, system: System, _: int, state: Array) -> float:
    """Impact force fw at a tick."""
    u_l, d_l, u_r, d_r = penetration(state)
    u, d = (u_l, d_l) if side == LEFT else (u_r, d_r)
    return float(impact_force(Contact(*system.pairs[side]), u, d))


EFFECTS = tuple(
    Effect(
        f"{side}_contact", f"the {side} arm hits the object", PARAMETERS, partial(_build, side),
        "4/5 H u^(5/2) while u >= 0; an impact takes 2 p H u^(3/2) u'^2", needs=(f"{side}_arm", "object"),
        outputs=(Output(CONTACTS[side], partial(_force, SIDES[side])),),
    )
    for side in SIDES
)

"""An actuator that cannot push or pull harder than its limit."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.control import Column
from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Sections, oddity

PARAMETERS = (
    Parameter("limit_N", 0.0, RANGES["force"].high, "largest force of the actuator in both directions", live=True,
              target=("laws", Column.LIMIT)),
)


def _build(side: str, _: Sections, system: System) -> None:
    system.caveats.append(f"the {side} command is limited, so that less damping may act than V_c assumes")


def _odd(side: str, sections: Sections, _: System) -> Iterable[str]:
    section = f"{side}_actuator"
    limit, constant = sections[section]["limit_N"], abs(sections[f"{side}_feedback"].get("feed_forward_N", 0.0))
    if limit == 0.0:
        yield oddity(f"{section}.limit_N", 0.0, f"lets no force of the {side} feedback through", "a limit above 0")
    elif limit < constant:
        why = f"is less than {side}_feedback.feed_forward_N alone"
        yield oddity(f"{section}.limit_N", limit, why, f"a limit above {constant!r}, or a smaller force")


EFFECTS = tuple(
    Effect(
        f"{side}_actuator", f"the force of the {side} actuator is limited", PARAMETERS, partial(_build, side),
        "V_c keeps the energy of the unlimited feedback and may rise while the limit acts",
        needs=(f"{side}_feedback", "loop"), row=SIDES[side], node=f"{side}_controller", example={"limit_N": 1.0},
        oddities=partial(_odd, side),
    )
    for side in SIDES
)

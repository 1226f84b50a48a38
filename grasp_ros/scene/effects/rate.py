"""A controller with a rate of its own, slower than that of the loop."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from grasp_ros.physics.control import Column
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Sections, oddity
from grasp_ros.scene.effects.time import ticks_of

PARAMETERS = (
    Parameter("period_ticks", 1, 1_000_000, "control periods from an answer of the controller to its next one",
              whole=True, target=("laws", Column.PERIOD)),
)


def _build(side: str, sections: Sections, system: System) -> None:
    if (ticks := sections[f"{side}_rate"]["period_ticks"]) > 1:
        system.caveats.append(f"the {side} controller answers every {ticks} control periods")


def _odd(side: str, sections: Sections, _: System) -> Iterable[str]:
    key, period = f"{side}_rate.period_ticks", sections[f"{side}_rate"]["period_ticks"]
    ticks = ticks_of(sections)
    if period == 1:
        yield oddity(key, 1, "has no effect", "2 or more, or no such section")
    if period >= ticks > 1:
        why = f"is the whole run of {ticks} control periods or more: one answer is held to its end"
        yield oddity(key, period, why, f"less than {ticks}")


EFFECTS = tuple(
    Effect(
        f"{side}_rate", f"the {side} controller answers at a rate of its own; between its answers the last one is held",
        PARAMETERS, partial(_build, side), "V_c may rise by the work of the held commands, as with loop",
        needs=(f"{side}_feedback", "loop"), row=SIDES[side], node=f"{side}_controller", example={"period_ticks": 5},
        oddities=partial(_odd, side),
    )
    for side in SIDES
)

"""The sampled loop: commands are held over control periods, as over topics, and may answer late."""

from __future__ import annotations

from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import Effect, Sections
from grasp_ros.scene.parameter import Parameter

HELD = "commands are held over control periods and do work of their own"


def _build(sections: Sections, system: System) -> None:
    system.sampled = True
    system.delay = sections["loop"].get("delay_ticks", 0)
    system.caveats.append(HELD)
    if system.delay:
        system.caveats.append(f"commands come {system.delay} control periods late")


EFFECTS = (
    Effect(
        "loop", "commands are held over control periods; without it the feedback is continuous, as in the paper",
        (
            Parameter("delay_ticks", 0, 10_000, "control periods from a state to the command that answers it",
                      optional=True, whole=True),
        ),
        _build, "V_c may rise by the work of the held commands; the energy balance with that work is exact",
        example={"delay_ticks": 2},
    ),
)

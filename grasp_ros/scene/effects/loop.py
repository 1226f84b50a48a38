"""The sampled loop: commands are held over control periods, as over topics, and may answer late."""

from __future__ import annotations

from collections.abc import Iterable

from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import Effect, Oddity, Sections, period_ns, run_ns
from grasp_ros.scene.parameter import Parameter

HELD = "commands are held over control periods and do work of their own"


def _build(sections: Sections, system: System) -> None:
    system.sampled = True
    system.delay = sections["loop"].get("delay_ticks", 0)
    system.caveats.append(HELD)
    if system.delay:
        system.caveats.append(f"commands come {system.delay} control periods late")


def _odd(sections: Sections, system: System) -> Iterable[Oddity]:
    numbers, ticks = sections["loop"], run_ns(sections) // period_ns(sections)
    if not system.laws:
        yield Oddity("loop", numbers, "holds no command: no side has feedback", "left_feedback or right_feedback too")
    if ticks == 1:
        period = sections["time"]["control_period_s"]
        why = "is as long as the run: no command answers a later state than the first"
        yield Oddity("time.control_period_s", period, why, "a part of time.duration_s")
    if numbers.get("delay_ticks") == 0:
        yield Oddity("loop.delay_ticks", 0, "has no effect", "a delay above 0, or loop: {}")
    if system.delay >= ticks:
        why = f"is the whole run of {ticks} control periods or more: no command arrives"
        yield Oddity("loop.delay_ticks", system.delay, why, f"less than {ticks}")


EFFECTS = (
    Effect(
        "loop", "commands are held over control periods; without it the feedback is continuous, as in the paper",
        (
            Parameter("delay_ticks", 0, 10_000, "control periods from a state to the command that answers it",
                      optional=True, whole=True),
        ),
        _build, "V_c may rise by the work of the held commands; the energy balance with that work is exact",
        example={"delay_ticks": 2}, oddities=_odd,
    ),
)

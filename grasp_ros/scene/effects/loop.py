"""The sampled loop: commands are held over control periods, as over topics, and may answer late."""

from __future__ import annotations

import math
from collections.abc import Iterable

from grasp_ros.physics.control import Column
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Sections, oddity
from grasp_ros.scene.effects.time import nanoseconds, period_ns

HELD = "commands are held over control periods and do work of their own"
FAR = 6.0  # decades that a motion may grow in a run: studies of the limit of stability need fewer
MOST_DELAY = 50  # control periods; the eigenvalues of longer loops take longer than the run


def _build(sections: Sections, system: System) -> None:
    system.sampled = True
    system.delay = sections["loop"].get("delay_ticks", 0)
    if system.laws:
        system.caveats.append(HELD)
    if system.laws and system.delay:
        system.caveats.append(f"commands are delayed by {system.delay} control periods")


def _odd(sections: Sections, system: System) -> Iterable[str]:
    numbers, ticks = sections["loop"], nanoseconds(sections["time"]["duration_s"]) // period_ns(sections)
    if not system.laws:
        yield oddity("loop", numbers, "holds no command: no side has feedback", "left_feedback or right_feedback too")
    if ticks == 1:
        period = sections["time"]["control_period_s"]
        why = "is as long as the run: no command answers a later state than the first"
        yield oddity("time.control_period_s", period, why, "a part of time.duration_s")
    if numbers.get("delay_ticks") == 0:
        yield oddity("loop.delay_ticks", 0, "has no effect", "a delay above 0, or loop: {}")
    if system.delay >= ticks:
        why = f"is the whole run of {ticks} control periods or more: no command arrives"
        yield oddity("loop.delay_ticks", system.delay, why, f"less than {ticks}")
    elif system.delay <= MOST_DELAY:
        yield from _unstable(sections, system, ticks)


def _unstable(sections: Sections, system: System, ticks: int) -> Iterable[str]:
    """Held feedback that overshoots more from tick to tick, in an arm that no contact stops nor its limit."""
    period = sections["time"]["control_period_s"]
    for name, side in SIDES.items():
        if side not in system.laws or system.laws[side].row[Column.LIMIT] < math.inf:
            continue
        factor = spectral_radius(system.arm(side), period, system.delay)
        decades = ticks * math.log10(factor) if factor > 0.0 else 0.0
        if decades > FAR:
            why = (f"is too long for {name}_feedback: while the {name} arm touches nothing, it swings {factor:.3g}"
                   f" times as far every period, 1e{decades:.0f} times as far in this run")
            meant = "a shorter period, less delay or smaller gains"
            yield oddity("time.control_period_s", period, why, meant)


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

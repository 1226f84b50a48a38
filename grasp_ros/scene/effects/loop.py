"""The sampled loop: commands are held over control periods, as over topics, and may answer late."""

from __future__ import annotations

import math
from collections.abc import Iterable

from grasp_ros.physics.control import Column
from grasp_ros.physics.domain import RANGES
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.physics.system import System
from grasp_ros.scene.effects.base import SIDES, Effect, Parameter, Relation, Sections, oddity, problem
from grasp_ros.scene.effects.time import is_tick, nanoseconds, period_ns, ticks_of

HELD = "commands are held over control periods and do work of their own"
FAR = 6.0  # decades that a motion may grow in a run: studies of the limit of stability need fewer
LONGEST = 10_000  # control periods of a delay
MOST_DELAY = 50  # control periods; the eigenvalues of longer loops take longer than the run


def _delay(sections: Sections) -> int:
    """Control periods from a state to the command that answers it."""
    numbers = sections["loop"]
    return numbers.get("delay_ticks") or nanoseconds(numbers.get("delay_s", 0.0)) // period_ns(sections)


def _both(sections: Sections) -> Iterable[str]:
    numbers = sections["loop"]
    if numbers.get("delay_s") and numbers.get("delay_ticks"):
        yield problem("loop.delay_s", numbers["delay_s"], "one of delay_s and delay_ticks")


def _off_tick(sections: Sections) -> Iterable[str]:
    seconds = sections["loop"].get("delay_s", 0.0)
    if not is_tick(seconds, sections) or _delay(sections) > LONGEST:
        period = sections["time"]["control_period_s"]
        allowed = f"a whole number of control periods of {period!r} s, at most {LONGEST}"
        yield problem("loop.delay_s", seconds, allowed)


def _build(sections: Sections, system: System) -> None:
    system.sampled = True
    system.delay = _delay(sections)
    if system.laws:
        system.caveats.append(HELD)
    if system.laws and system.delay:
        system.caveats.append(f"commands are delayed by {system.delay} control periods")


def _odd(sections: Sections, system: System) -> Iterable[str]:
    numbers, ticks = sections["loop"], ticks_of(sections)
    if not system.laws:
        yield oddity("loop", numbers, "holds no command: no side has feedback", "left_feedback or right_feedback too")
    if ticks == 1:
        period = sections["time"]["control_period_s"]
        why = "is as long as the run: no command answers a later state than the first"
        yield oddity("time.control_period_s", period, why, "a part of time.duration_s")
    for key, delay in numbers.items():
        if delay == 0:
            yield oddity(f"loop.{key}", delay, "has no effect", "a delay above 0, or loop: {}")
        elif system.delay >= ticks:
            why = f"is the whole run of {ticks} control periods or more: no command arrives"
            yield oddity(f"loop.{key}", delay, why, f"less than {ticks} control periods")
    if system.delay <= min(ticks - 1, MOST_DELAY):
        yield from _unstable(sections, system, ticks)


def _unstable(sections: Sections, system: System, ticks: int) -> Iterable[str]:
    """Held feedback that overshoots more from tick to tick, in an arm that no contact stops nor its limit."""
    period = sections["time"]["control_period_s"]
    for name, side in SIDES.items():
        if side not in system.laws or system.laws[side].row[Column.LIMIT] < math.inf:
            continue
        every = int(system.laws[side].row[Column.PERIOD])
        if every > 1 and system.delay:
            continue
        factor = spectral_radius(system.arm(side), every * period, system.delay)
        decades = ticks / every * math.log10(factor) if factor > 0.0 else 0.0
        if decades > FAR:
            why = (f"is too long for {name}_feedback: while the {name} arm touches nothing, it swings {factor:.3g}"
                   f" times as far from answer to answer, 1e{decades:.0f} times as far in this run")
            meant = "a shorter period, less delay or smaller gains"
            yield oddity("time.control_period_s", period, why, meant)


EFFECTS = (
    Effect(
        "loop", "commands are held over control periods; without it the feedback is continuous, as in the paper",
        (
            Parameter("delay_ticks", 0, LONGEST, "control periods from a state to the command that answers it",
                      optional=True, whole=True),
            Parameter("delay_s", 0.0, RANGES["duration"].high,
                      "the same in seconds, a whole number of control periods, in place of delay_ticks", optional=True),
        ),
        _build, "V_c may rise by the work of the held commands; the energy balance with that work is exact",
        example={"delay_ticks": 2}, oddities=_odd,
        relations=(
            Relation("only one of `delay_ticks` and `delay_s` is there, or not 0", "both are the same delay", _both),
            Relation(f"`delay_s` is a whole number of control periods, at most {LONGEST}",
                     "commands arrive at ticks only", _off_tick),
        ),
    ),
)

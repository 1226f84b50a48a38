"""Length of a run and its control period, which every scene has; times in nanoseconds."""

from __future__ import annotations

from collections.abc import Iterable

from grasp_ros.physics.domain import RANGES
from grasp_ros.scene.effects.base import NANOSECONDS, Effect, Parameter, Sections, nothing, problem


def nanoseconds(seconds: float) -> int:
    """A time in ns, rounded."""
    return round(seconds * NANOSECONDS)


def period_ns(sections: Sections) -> int:
    """Control period of a scene in ns."""
    return nanoseconds(sections["time"]["control_period_s"])


def _problems(sections: Sections) -> Iterable[str]:
    numbers = sections["time"]
    for key in ("control_period_s", "duration_s"):
        if nanoseconds(numbers[key]) / NANOSECONDS != numbers[key]:
            yield problem(f"time.{key}", numbers[key], "whole nanoseconds")
            return
    if nanoseconds(numbers["duration_s"]) % period_ns(sections):
        allowed = f"a whole number of control periods of {numbers['control_period_s']!r} s"
        yield problem("time.duration_s", numbers["duration_s"], allowed)


EFFECTS = (
    Effect(
        "time", "length of the run and control period",
        (
            Parameter("duration_s", *RANGES["duration"].bounds, "length of the run", open_low=True),
            Parameter("control_period_s", *RANGES["control period"].bounds,
                      "how long a command is held if the feedback is sampled, and an external force stays the same",
                      open_low=True),
        ),
        nothing, "none", problems=_problems,
    ),
)

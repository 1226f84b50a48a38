"""Length of a run and its control period, which every scene has; times in nanoseconds."""

from __future__ import annotations

from collections.abc import Iterable

from grasp_ros.physics.domain import RANGES
from grasp_ros.scene.effects.base import NANOSECONDS, Effect, Parameter, Relation, Sections, nothing, problem


def nanoseconds(seconds: float) -> int:
    """A time in ns, rounded."""
    return round(seconds * NANOSECONDS)


def period_ns(sections: Sections) -> int:
    """Control period of a scene in ns."""
    return nanoseconds(sections["time"]["control_period_s"])


def ticks_of(sections: Sections) -> int:
    """Control periods of a run."""
    return nanoseconds(sections["time"]["duration_s"]) // period_ns(sections)


def is_tick(seconds: float, sections: Sections) -> bool:
    """Whether a time is a whole number of control periods, in whole nanoseconds."""
    time = nanoseconds(seconds)
    return time / NANOSECONDS == seconds and time % period_ns(sections) == 0


def _fractions(sections: Sections) -> Iterable[str]:
    for key in ("control_period_s", "duration_s"):
        seconds = sections["time"][key]
        if nanoseconds(seconds) / NANOSECONDS != seconds:
            yield problem(f"time.{key}", seconds, "whole nanoseconds")


def _rest_of_period(sections: Sections) -> Iterable[str]:
    numbers = sections["time"]
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
        nothing, "none",
        relations=(
            Relation("both times are whole nanoseconds", "as in the stamps of messages", _fractions),
            Relation("`duration_s` is a whole number of control periods", "a run ends at a tick", _rest_of_period),
        ),
    ),
)

"""The compensated clock of an interval: its time, and beside it what the roundings of that sum left out."""

from __future__ import annotations

from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.records import Array


@kernel
def until(clock: Array, time: float) -> float:
    """Seconds from now to a time of the interval."""
    return (time - clock[0]) - clock[1]


@kernel
def tick(clock: Array, step: float) -> None:
    """Add a step in s (two-sum), so that long runs do not drift."""
    total = clock[0] + step
    back = total - clock[0]
    clock[1] += (clock[0] - (total - back)) + (step - back)
    clock[0] = total

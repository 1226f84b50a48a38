"""How a degenerate scene starts: at rest in contact, in a chain, on a switch, with gaps that are zero or tiny.

Nearly every error of an event-driven integrator sits where something is exactly equal or exactly zero, which numbers
drawn at random never are.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from lab.cases.draw import Draw

SIDES = ("left", "right")
Sections = dict[str, dict[str, Any]]


class Sketch:
    """A scene while it is drawn: bodies at x = (left, object, right) with v, and what the degeneracies so far are."""

    def __init__(self, draw: Draw) -> None:
        self.draw = draw
        self.degeneracies: list[str] = []
        self.size, self.speed = draw.decades(-5.0, 1.0), draw.decades(-4.0, 3.0)
        self.x, self.v = [-self.size, 0.0, self.size], [0.0, 0.0, 0.0]
        self.mass = [draw.decades(-6.0, 9.0) if draw.chance(0.15) else draw.decades(-3.0, 3.0) for _ in range(3)]
        self.hertz = [1e15 if draw.chance(0.1) else draw.decades(-3.0, 15.0) for _ in SIDES]
        self.loss = [draw.decades(-8.0, 9.0) if draw.chance(0.1) else draw.decades(-4.0, 1.0, zero=0.25) / self.speed
                     for _ in SIDES]
        rates = [(draw.decades(-4.0, 2.0, zero=0.3), draw.decades(-4.0, 2.0, zero=0.3)) for _ in SIDES]
        losses = [(draw.decades(-4.0, 2.0, zero=0.4), draw.decades(-4.0, 2.0, zero=0.4)) for _ in SIDES]
        clock = self.speed / self.size
        self.springs = [[self.mass[2 * k] * (rate * clock) ** 2 for rate in rates[k]] for k in range(2)]
        self.dampers = [[self.mass[2 * k] * loss * clock for loss in losses[k]] for k in range(2)]
        self.extra: Sections = {}
        self.targets: list[dict[str, float]] = [{}, {}]

    def some_speed(self) -> float:
        """A speed of the scene's size, or none."""
        return 0.0 if self.draw.chance(0.3) else self.speed * self.draw.between(-1.0, 1.0)


def ulps(draw: Draw, value: float) -> float:
    """The value, or one a few roundings beside it; 0 stays 0, beside which numbers are denormal."""
    steps = int(draw.between(-3.0, 4.0)) if draw.chance(0.5) and value != 0.0 else 0
    for _ in range(abs(steps)):
        value = math.nextafter(value, math.copysign(math.inf, steps))
    return value


def _chain(sketch: Sketch) -> None:
    """All touch at rest, one of them moves."""
    position = 0.0 if sketch.draw.chance(0.7) else sketch.size * sketch.draw.between(-1.0, 1.0)
    sketch.x = [position] * 3
    who = int(sketch.draw.between(0.0, 3.0))
    sketch.v[who] = sketch.speed * sketch.draw.between(-1.0, 1.0)


def _rest(sketch: Sketch) -> None:
    """All move alike, touching or pressed in."""
    draw = sketch.draw
    position = 0.0 if draw.chance(0.5) else sketch.size * draw.between(-1.0, 1.0)
    sketch.x, sketch.v = [position] * 3, [0.0 if draw.chance(0.6) else sketch.some_speed()] * 3
    if draw.chance(0.3):
        sketch.x[2 * int(draw.between(0.0, 2.0))] += sketch.size * draw.between(-1.0, 1.0)


def _zero_gaps(sketch: Sketch) -> None:
    """One or both gaps are zero, with any speeds."""
    draw = sketch.draw
    position = sketch.size * draw.between(-1.0, 1.0)
    sketch.x = [position, position, position]
    if draw.chance(0.5):
        side = int(draw.between(0.0, 2.0))
        sketch.x[2 * side] += (2 * side - 1) * sketch.size * draw.between(-0.1, 1.0)
    sketch.v = [sketch.some_speed() for _ in range(3)]


def _tiny_gap(sketch: Sketch) -> None:
    """Gaps or penetrations far smaller than the scene."""
    draw = sketch.draw
    position = 0.0 if draw.chance(0.6) else sketch.size * draw.between(-1.0, 1.0)
    sketch.x = [position] * 3
    for side in (0, 1):
        gap = sketch.size * draw.decades(-18.0, -3.0, zero=0.2)
        sketch.x[2 * side] += (2 * side - 1) * (gap if draw.chance(0.8) else -gap)
    sketch.v = [sketch.some_speed() for _ in range(3)]


def _symmetric(sketch: Sketch) -> None:
    """Both sides are the same, mirrored or shifted; the object rests or goes with them."""
    draw = sketch.draw
    for numbers in (sketch.springs, sketch.dampers, sketch.hertz, sketch.loss):
        numbers[1] = numbers[0]  # type: ignore[assignment]
    sketch.mass[2] = sketch.mass[0]
    gap = sketch.size * (draw.between(-0.3, 1.0) if draw.chance(0.7) else 0.0)
    sketch.x = [-gap, 0.0, gap]
    towards = sketch.some_speed()
    sketch.v = [towards, 0.0, -towards] if draw.chance(0.7) else [towards, towards, towards]


def _clamp_surface(sketch: Sketch) -> None:
    """One pair or both start in the contact, separating at exactly 1/p, or a few roundings from it."""
    draw = sketch.draw
    depth = sketch.size * draw.decades(-6.0, 0.0)
    sketch.x = [depth, 0.0, -depth if draw.chance(0.5) else sketch.size]
    sketch.v[1] = 0.0 if draw.chance(0.6) else sketch.some_speed()
    sketch.loss = [loss or 1.0 / sketch.speed for loss in sketch.loss]
    sketch.v[0] = ulps(draw, sketch.v[1] - 1.0 / sketch.loss[0])
    sketch.v[2] = ulps(draw, sketch.v[1] + 1.0 / sketch.loss[1]) if draw.chance(0.5) else sketch.some_speed()


def _deep(sketch: Sketch) -> None:
    """Both pairs start pressed in, at any speed."""
    draw = sketch.draw
    sketch.x = [sketch.size * draw.decades(-6.0, 0.0), 0.0, -sketch.size * draw.decades(-6.0, 0.0)]
    sketch.v = [sketch.some_speed() for _ in range(3)]


def _apart(sketch: Sketch) -> None:
    """Any positions and speeds."""
    draw = sketch.draw
    sketch.x = [-sketch.size * draw.between(-0.02, 1.0), 0.0, sketch.size * draw.between(-0.02, 1.0)]
    sketch.v = [sketch.some_speed() for _ in range(3)]


STARTS: tuple[tuple[str, Callable[[Sketch], None]], ...] = (
    ("chain", _chain), ("rest in contact", _rest), ("zero gaps", _zero_gaps), ("tiny gap", _tiny_gap),
    ("symmetric", _symmetric), ("clamp surface", _clamp_surface), ("both deep", _deep), ("apart", _apart),
)

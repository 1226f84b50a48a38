"""The transitions between the modes of the reference."""

from __future__ import annotations

from typing import NamedTuple

import gmpy2
from gmpy2 import mpfr

from lab.reference.gaps import Gap
from lab.reference.motion import Motion, Pair, Slide
from lab.reference.plant import OBJECT, SIDES, Plant, Real, Reals

SLOW_BITS = 40  # a slower touch is one without speed


class Event(NamedTuple):
    """A change of mode."""

    t: Real  # s
    body: int  # LEFT, RIGHT: its pair; OBJECT
    kind: str  # touch, release, clamp, reentry, stop, slip


class Automaton(Motion):
    """A motion that can change its modes, and remembers when."""

    def __init__(self, plant: Plant, x: Reals, v: Reals, tolerance: Real) -> None:
        super().__init__(plant, x, v, tolerance)
        self.events: list[Event] = []

    def enter(self, plant: Plant) -> None:
        """Let other constant forces act from now on."""
        self.plant = plant
        for side in SIDES:
            if self.pairs[side] is Pair.LEAVING:
                self._press(side)
        if self.slide is Slide.STUCK and self.sliding() is not Slide.STUCK:
            self.slide = self.sliding()
            self.events.append(Event(self.state.t, OBJECT, "slip"))

    def fire(self, fired: list[Gap]) -> None:
        """Make the transitions of one instant."""
        touches = sum(gap.event == "touch" for gap in fired)
        for gap in fired:
            self.events.append(Event(self.state.t, gap.body, gap.event))
            if gap.event == "touch":
                self._touch(gap.body, touches > 1)
            elif gap.event == "release":
                self.pairs[gap.body] = Pair.OPEN
                self._meet(gap.body)
            elif gap.event == "clamp":
                self.pairs[gap.body] = Pair.CLAMPED
            elif gap.event == "reentry":
                self._press(gap.body)
            elif gap.event == "stop":
                self._stop()
            else:
                self.slide = Slide(gap.sign)

    def finish(self) -> None:
        """The end of a step without an event: flights end that were too short for an impact force to matter."""
        for side in SIDES:
            if self.pairs[side] is Pair.STARTING:
                self._press(side)
        if len(self.pressed) == 2:  # one pair alone reaches u = 0; of two, none might reach it first
            for side in [side for side in self.pressed if self.spent(side)]:
                self.pairs[side] = Pair.LEAVING
                self.state.w[side] = mpfr(0)

    def _meet(self, side: int) -> None:
        """u is exactly zero."""
        self.state.x[side] = self.state.x[OBJECT]
        self.state.w[side] = mpfr(0)

    def _touch(self, side: int, together: bool) -> None:
        """At once under its force, unless the other pair is at u = 0, too, or there is no speed."""
        self._meet(side)
        other = self.pairs[1 - side]
        corner = together or other is Pair.STARTING or (other is Pair.PRESSED and not self.state.w[1 - side])
        speed = max(abs(self.state.v[side]), abs(self.state.v[OBJECT]))
        slow = self.rate(side) <= gmpy2.exp2(-SLOW_BITS) * speed
        self.pairs[side] = Pair.STARTING if corner or slow else Pair.PRESSED

    def _press(self, side: int) -> None:
        """The impact force acts from now on, from the depth that there is."""
        u = self.depth(side)
        self.pairs[side] = Pair.PRESSED if u > 0 else Pair.OPEN
        self.state.w[side] = gmpy2.sqrt(max(u, 0))

    def _stop(self) -> None:
        """The object comes to rest: it sticks, or turns around."""
        self.state.v[OBJECT] = mpfr(0)
        before = self.slide
        self.slide = self.sliding()
        if self.slide is before:  # what pushes it on is no more than rounding
            self.slide = Slide.STUCK

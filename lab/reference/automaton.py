"""What ends a mode of the reference, the first root of a polynomial on a step, and the transition to the next."""

from __future__ import annotations

from typing import NamedTuple

import gmpy2
from gmpy2 import mpfr

from lab.reference.motion import Motion, Pair, Slide
from lab.reference.plant import OBJECT, SIDES, SIGN, Plant, Real, Reals
from lab.reference.roots import sizes
from lab.reference.series import Expansion

SLOW_BITS = 40  # a slower touch is one without speed
SPARE_BITS = 48  # between the unit roundoff and what counts as a difference


class Event(NamedTuple):
    """A change of mode."""

    t: Real  # s
    body: int  # LEFT, RIGHT: its pair; OBJECT
    kind: str  # touch, release, clamp, reentry, stop, slip


class Gap(NamedTuple):
    """A polynomial that is not negative until its event."""

    row: Reals
    noise: Real  # coefficients times powers of the step below this are zero
    event: str
    body: int
    sign: int = 0  # of the direction in which the object slips


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


def gaps(motion: Motion, series: Expansion, h: Real, far: list[int]) -> list[Gap]:
    """All of them for a step h, but those of arms that are far from the object."""
    found = []
    for side in SIDES:
        if side not in far and motion.pairs[side] is not Pair.ABSENT:
            found += _of_depth(motion, series, h, side) + _of_rate(motion, series, h, side)
    if motion.wall:
        found += _of_push(motion, series, h)
    elif motion.slide is not None:
        row = [motion.slide.value * a for a in series.v[OBJECT]]
        found.append(Gap(row, _noise(sizes([series.v[OBJECT]], h)), "stop", OBJECT))
    return found


def _noise(size: Real) -> Real:
    """What rounding may come to in numbers of some size."""
    return size * gmpy2.exp2(SPARE_BITS - gmpy2.get_context().precision)


def _of_depth(motion: Motion, series: Expansion, h: Real, side: int) -> list[Gap]:
    """u = 0, from both sides."""
    noise = _noise(sizes([series.x[side], series.x[OBJECT]], h))
    mode = motion.pairs[side]
    if mode is Pair.OPEN:
        return [Gap([-a for a in series.depth(side)], noise, "touch", side)]
    if mode is not Pair.PRESSED:
        return [Gap(series.depth(side), noise, "release", side)]
    if side in series.rooted:
        noise = _noise(sizes([series.w[side]], h))
    return [Gap(series.w[side], noise, "release", side)]


def _of_rate(motion: Motion, series: Expansion, h: Real, side: int) -> list[Gap]:
    """u' = -1/p, from both sides."""
    p, mode = motion.plant.law(side).dissipation, motion.pairs[side]
    if not p or mode not in (Pair.PRESSED, Pair.CLAMPED):
        return []
    row = [p * a for a in series.rate(side)]
    row[0] += 1
    noise = _noise(max(p * sizes([series.v[side], series.v[OBJECT]], h), 1))
    if mode is Pair.PRESSED:
        return [Gap(row, noise, "clamp", side)]
    return [Gap([-a for a in row], noise, "reentry", side)]


def _of_push(motion: Motion, series: Expansion, h: Real) -> list[Gap]:
    """A stuck object is pushed by as much as its friction."""
    thing, limit = motion.plant.body(OBJECT), motion.plant.coulomb
    push = [thing.drive * thing.mass] + [mpfr(0)] * (len(series.t) - 1)
    for side in motion.pressed:
        push = [a + SIGN[side] * b for a, b in zip(push, series.force[side], strict=True)]
    noise = _noise(max(sizes([*(row for row in series.force if row), push], h), limit))
    rows = [(sign, [-sign * a for a in push]) for sign in (1, -1)]
    return [Gap([limit + row[0], *row[1:]], noise, "slip", OBJECT, sign) for sign, row in rows]

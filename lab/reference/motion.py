"""Where the reference is: state and modes, and what follows from them without a step."""

from __future__ import annotations

from enum import Enum

import gmpy2
from gmpy2 import mpfr

from lab.reference.plant import OBJECT, SIDES, SIGN, Plant, Real, Reals, State


class Pair(Enum):
    """What a pair does; its impact force acts only while it is pressed."""

    ABSENT = 0
    OPEN = 1  # u <= 0
    PRESSED = 2  # u >= 0 and u' >= -1/p
    CLAMPED = 3  # u > 0, but u' < -1/p
    STARTING = 4  # from u = 0, in a flight too short for the impact force to matter
    LEAVING = 5  # to u = 0, in such a flight


class Slide(Enum):
    """What the object does where there is dry friction."""

    LEFTWARD = -1
    STUCK = 0
    RIGHTWARD = 1


class Motion:
    """State and modes, from x and v by body at t = 0; `tolerance` is the relative size of what is left out."""

    def __init__(self, plant: Plant, x: Reals, v: Reals, tolerance: Real) -> None:
        self.plant, self.tolerance = plant, tolerance
        self.state = State(mpfr(0), list(x), list(v), [mpfr(0), mpfr(0)])
        self.pairs = [self._first(side) for side in SIDES]
        self.slide = self.sliding()

    @property
    def wall(self) -> bool:
        """Whether the object is stuck."""
        return self.slide is Slide.STUCK

    @property
    def pressed(self) -> list[int]:
        """Sides whose impact force acts."""
        return [side for side in SIDES if self.pairs[side] is Pair.PRESSED]

    @property
    def arms(self) -> list[int]:
        """Arms that are there."""
        return [side for side in SIDES if self.plant.bodies[side] is not None]

    @property
    def free(self) -> list[int]:
        """The object, if it is there and not stuck."""
        return [OBJECT] if self.plant.bodies[OBJECT] is not None and not self.wall else []

    @property
    def acting(self) -> Plant:
        """The plant with the dry friction that acts on the object."""
        if self.slide is None:
            return self.plant
        left, right, _ = self.plant.bodies
        thing = self.plant.body(OBJECT)
        force = thing.drive * thing.mass - self.slide.value * self.plant.coulomb
        return self.plant._replace(bodies=(left, right, thing.pushed(force)))

    def depth(self, side: int) -> Real:
        """u of a pair, m."""
        return SIGN[side] * (self.state.x[side] - self.state.x[OBJECT])

    def rate(self, side: int) -> Real:
        """u' of a pair, m/s."""
        return SIGN[side] * (self.state.v[side] - self.state.v[OBJECT])

    def impact(self, side: int) -> Real:
        """The impact force of a pressed pair, N."""
        law = self.plant.law(side)
        return law.hertzian * self.state.w[side] ** 3 * (1 + law.dissipation * self.rate(side))

    def acceleration(self, body: int) -> Real:
        """Of a body without impact forces, m/s^2."""
        if body == OBJECT and self.wall:
            return mpfr(0)
        return self.acting.body(body).acceleration(self.state.x[body], self.state.v[body])

    def _first(self, side: int) -> Pair:
        """The mode of a pair at the start; at u = 0 the next step decides."""
        law, u = self.plant.laws[side], self.depth(side)
        if law is None:
            return Pair.ABSENT
        if u <= 0:
            return Pair.OPEN
        self.state.w[side] = gmpy2.sqrt(u)
        return Pair.PRESSED if 1 + law.dissipation * self.rate(side) >= 0 else Pair.CLAMPED

    def sliding(self) -> Slide | None:
        """The mode of the object from its velocity, or at rest from what pushes it; None without friction."""
        if not self.plant.coulomb:
            return None
        v = self.state.v[OBJECT]
        if not v:
            thing = self.plant.body(OBJECT)
            v = thing.drive * thing.mass + sum(SIGN[side] * self.impact(side) for side in self.pressed)
            if abs(v) <= self.plant.coulomb:
                return Slide.STUCK
        return Slide.RIGHTWARD if v > 0 else Slide.LEFTWARD

    def spent(self, side: int) -> bool:
        """Whether a pressed pair is so near its release that the rest of its impulse has no effect."""
        law, w, rate = self.plant.law(side), self.state.w[side], self.rate(side)
        if rate >= 0:
            return False
        t, mass = -w * w / rate, self.plant.reduced_mass(side, self.wall)
        pull = max(abs(self.acceleration(side)), abs(self.acceleration(OBJECT)))
        for other in self.pressed:
            if other != side:
                pull += abs(self.impact(other)) / self.acting.body(OBJECT).mass
        return bool(law.hertzian * w**3 * t <= -self.tolerance * mass * rate and 8 * pull * t < -rate)

    # Flights: no impact force acts on these bodies.

    def drifted(self, t: Real, bodies: list[int]) -> State:
        """The state after a flight of some bodies; the others stay."""
        x, v = list(self.state.x), list(self.state.v)
        for body in bodies:
            x[body], v[body] = self.acting.body(body).drift(x[body], v[body], t)
        return State(self.state.t + t, x, v, [mpfr(0), mpfr(0)])

    def bounds(self, body: int) -> tuple[Real, Real]:
        """Bounds of the second and the third derivative of a position for the rest of a flight."""
        if body == OBJECT and self.wall:
            return mpfr(0), mpfr(0)
        return self.acting.body(body).bounds(self.state.x[body], self.state.v[body])

    def quiet(self) -> Real:
        """A time within which no event can end a flight, s."""
        waits = [self._quiet_pair(side) for side in SIDES if self.pairs[side] is not Pair.ABSENT]
        if self.slide is not None and not self.wall:
            sign, jerk = self.slide.value, self.bounds(OBJECT)[1]
            waits.append(_wait(sign * self.state.v[OBJECT], sign * self.acceleration(OBJECT), jerk))
        return min(waits, default=gmpy2.inf())

    def _quiet_pair(self, side: int) -> Real:
        bound, jerk = (a + b for a, b in zip(self.bounds(side), self.bounds(OBJECT), strict=True))
        u, rate = self.depth(side), self.rate(side)
        if self.pairs[side] is Pair.OPEN:
            return max(_wait(-u, -rate, bound), self._out_of_reach(side))
        least = _wait(u, rate, bound)
        if self.pairs[side] is Pair.CLAMPED:
            a = SIGN[side] * (self.acceleration(side) - self.acceleration(OBJECT))
            least = min(least, _wait(-1 / self.plant.law(side).dissipation - rate, -a, jerk))
        return least

    def _out_of_reach(self, side: int) -> Real:
        """How long the object stays beyond the whole swing of an arm."""
        arm = self.acting.body(side)
        if not arm.stiffness:
            return mpfr(0)
        rest = arm.drive / arm.stiffness
        swing = gmpy2.sqrt((self.state.x[side] - rest) ** 2 + self.state.v[side] ** 2 / arm.stiffness)
        gap = -(SIGN[side] * (rest - self.state.x[OBJECT]) + swing)
        if gap <= 0:
            return mpfr(0)
        v = mpfr(0) if self.wall else self.state.v[OBJECT]
        return _wait(gap, SIGN[side] * v, self.bounds(OBJECT)[0])

    def may_meet(self, side: int, t: Real, way: Real) -> bool:
        """Whether a flying arm can come to the object within a time in which that moves by less than `way`."""
        if self.pairs[side] is Pair.ABSENT:
            return False
        own = abs(self.state.v[side]) * t + self.bounds(side)[0] * t * t / 2
        return bool(own + way >= -self.depth(side))


def _wait(value: Real, slope: Real, bound: Real) -> Real:
    """How long a positive function stays positive for certain if its second derivative is at least -bound."""
    value = max(value, 0)
    root = gmpy2.sqrt(slope * slope + 2 * bound * value)
    if slope > 0:
        return (slope + root) / bound if bound else gmpy2.inf()
    return 2 * value / (root - slope) if root - slope else gmpy2.inf() if not bound else mpfr(0)

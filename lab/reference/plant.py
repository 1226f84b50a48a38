"""Bodies and pairs in high precision: their numbers, their flight in closed form, and what they can do at most.

Flights are matrix exponentials by scaling and squaring, in the ring of the polynomials of the 2 x 2 system matrix, so
that K = 0, C = 0 and critical damping are no special cases.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gmpy2
from gmpy2 import mpfr

Real = Any  # mpfr, or what `number` turns into one
Reals = list[Real]
LEFT, RIGHT, OBJECT = 0, 1, 2
SIDES = (LEFT, RIGHT)
SIGN = (1, -1)  # u = SIGN (x - x_o)
FEW = 2.0**-9  # how much of a time scale a power series of the propagator covers


def number(value: Real, decimal: bool = False) -> Real:
    """An mpfr of the current precision; a float stands for its shortest decimal form if `decimal`."""
    if isinstance(value, float):
        value = repr(float(value)) if decimal else float(value)
    return mpfr(value)


def propagator(trace: Real, det: Real, t: Real) -> tuple[tuple[Real, Real], tuple[Real, Real]]:
    """exp(A t) and its integral over [0, t] as a + b A, for A of given trace and determinant: A^2 = trace A - det."""
    doublings = max(0, int(gmpy2.ceil(gmpy2.log2(max(abs(trace), gmpy2.sqrt(det)) * t + FEW))) + 8)
    t = t / mpfr(2) ** doublings
    a, b = mpfr(1), mpfr(0)  # (A t)^k / k!
    flow, integral = (a, b), (t, b)
    for k in range(1, gmpy2.get_context().precision // 9 + 3):
        a, b = -det * b * t / k, (a + trace * b) * t / k
        flow = flow[0] + a, flow[1] + b
        integral = integral[0] + a * t / (k + 1), integral[1] + b * t / (k + 1)
    for _ in range(doublings):
        (a, b), (c, d) = flow, integral
        integral = c + a * c - b * d * det, d + a * d + b * c + b * d * trace
        flow = a * a - b * b * det, 2 * a * b + b * b * trace
    return flow, integral


class Body(NamedTuple):
    """m x'' = -K x - C x' + f, as x'' = drive - stiffness x - damping x'."""

    mass: Real  # kg
    stiffness: Real  # K / m, 1/s^2
    damping: Real  # C / m, 1/s
    drive: Real  # f / m, m/s^2

    @staticmethod
    def of(mass: Real, stiffness: Real, damping: Real, force: Real) -> Body:
        """From m in kg, K in N/m, C in N s/m and f in N."""
        return Body(mass, stiffness / mass, damping / mass, force / mass)

    @property
    def rate(self) -> Real:
        """A bound of the natural rates, 1/s."""
        return max(gmpy2.sqrt(self.stiffness), self.damping)

    def pushed(self, force: Real) -> Body:
        """The body under another constant force in N."""
        return self._replace(drive=force / self.mass)

    def acceleration(self, x: Real, v: Real) -> Real:
        """Without impact force, m/s^2."""
        return self.drive - self.stiffness * x - self.damping * v

    def drift(self, x: Real, v: Real, t: Real) -> tuple[Real, Real]:
        """Position and velocity after a time without impact forces."""
        if not (self.stiffness or self.damping):
            return x + t * (v + t * self.drive / 2), v + t * self.drive
        trace = -self.damping
        (a, b), (c, d) = propagator(trace, self.stiffness, t)
        return (
            a * x + b * v + d * self.drive,
            a * v + b * (trace * v - self.stiffness * x) + (c + d * trace) * self.drive,
        )

    def bounds(self, x: Real, v: Real) -> tuple[Real, Real]:
        """Bounds of |x''| and |x'''| for the rest of a flight, in which m a^2 + K v^2 never grows."""
        a = self.acceleration(x, v)
        jerk = -self.stiffness * v - self.damping * a
        return gmpy2.sqrt(a * a + self.stiffness * v * v), gmpy2.sqrt(jerk * jerk + self.stiffness * a * a)


class Law(NamedTuple):
    """The impact law of a pair, H and p; None stands for no pair."""

    hertzian: Real
    dissipation: Real


class Plant(NamedTuple):
    """Bodies LEFT, RIGHT, OBJECT (None: absent), pairs LEFT, RIGHT (None: absent), and dry friction of the object."""

    bodies: tuple[Body | None, Body | None, Body | None]
    laws: tuple[Law | None, Law | None]
    coulomb: Real  # N

    def body(self, body: int) -> Body:
        """A body that is there."""
        row = self.bodies[body]
        assert row is not None
        return row

    def law(self, side: int) -> Law:
        """The impact law of a pair that is there."""
        law = self.laws[side]
        assert law is not None
        return law

    def reduced_mass(self, side: int, wall: bool) -> Real:
        """Reduced mass of a pair in kg; beside a wall that of the arm."""
        arm, thing = self.body(side), self.body(OBJECT)
        return arm.mass if wall else arm.mass * thing.mass / (arm.mass + thing.mass)


class State(NamedTuple):
    """Where everything is; lists by body, w by side."""

    t: Real  # s
    x: Reals  # m
    v: Reals  # m/s
    w: Reals  # sqrt(u) of a pressed pair, sqrt(m)

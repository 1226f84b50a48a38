"""An independent high-precision oracle for the grasp: slow, and right to as many digits as asked for.

It shares nothing with the integrators of this package but the records of `physics.model`. Flights are matrix
exponentials by scaling and squaring, in the ring of the polynomials of the 2 x 2 system matrix, so that K = 0
and critical damping are no special cases. Contacts are extrapolated midpoint steps (Gragg, Bulirsch, Stoer).

The impact force contains u^(3/2), which is not smooth at u = 0. So w = sqrt(u) is carried along, and the
independent variable is s with dt = 2 w ds for one pressed pair and dt = 2 w_l w_r ds for two. Then dw/ds is u',
or u' times the other w, all right-hand sides are polynomials, and w crosses zero at a release. If both pairs
touch or release at one instant, the product never reaches it; there, and only there, the impact force is left
out while its impulse is below the target accuracy.

References
----------
E. Hairer, S. P. Norsett, G. Wanner: Solving Ordinary Differential Equations I, section II.9.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal
from enum import Enum
from itertools import pairwise
from typing import Any, NamedTuple

import gmpy2
import numpy as np
from gmpy2 import mpfr
from numpy.typing import NDArray

from grasp_ros.physics.model import Arm, Contact, Grasp

Real = Any  # mpfr, or what `_number` turns into one
Vector = list[Real]  # t, x_l, v_l, x_o, v_o, x_r, v_r, w_l, w_r
T, X_O, V_O = 0, 3, 4
GROUPS = (slice(0, 1), slice(1, 6, 2), slice(2, 7, 2), slice(7, 9))  # components of one dimension
GUARD_BITS = 72  # against rounding, above all in the repeated squaring
EVENT_BUDGET = 100_000


class Reference(NamedTuple):
    """A solution on a grid of times, and its contacts in the sense of (10), at u = 0 or at u' = -1/p."""

    t: list[Real]  # s
    state: list[tuple[Real, ...]]  # x_l, v_l, x_o, v_o, x_r, v_r in m and m/s
    touches: tuple[list[Real], list[Real]]  # begin of contact, left and right, s
    releases: tuple[list[Real], list[Real]]  # end of contact, left and right, s

    def as_array(self) -> NDArray[np.float64]:
        """The states rounded to doubles, shape (N, 6), m and m/s."""
        return np.array([[float(value) for value in row] for row in self.state]).reshape(-1, 6)


class Phase(Enum):
    """What a pair does: its impact force acts only while it is pressed."""

    APART = 0
    PRESSED = 1
    CLAMPED = 2  # u > 0, but u' < -1/p


class _Gap(NamedTuple):
    """An affine function of the vector that is positive until its event: offset + sum of factor * component."""

    offset: Real
    terms: tuple[tuple[int, Real], ...]
    side: int = 0
    after: Phase = Phase.APART
    of_rate: bool = False  # made of velocities, not of positions

    def value(self, y: Vector) -> Real:
        return self.offset + sum(factor * y[i] for i, factor in self.terms)

    def slope(self, f: Vector) -> Real:
        return sum(factor * f[i] for i, factor in self.terms)


class _Side(NamedTuple):
    """One arm and its pair with the object; sign is +1 on the left, -1 on the right, u = sign (x - x_o)."""

    side: int
    sign: int
    stiffness: Real  # K / m, 1/s^2
    damping: Real  # C / m, 1/s
    drive: Real  # f / m, m/s^2
    mass: Real
    hertzian: Real
    dissipation: Real

    def depth(self, y: Vector) -> Real:
        return self.sign * (y[1 + 4 * self.side] - y[X_O])

    def rate(self, y: Vector) -> Real:
        return self.sign * (y[2 + 4 * self.side] - y[V_O])

    def bounds(self, y: Vector) -> tuple[Real, Real]:
        """Bounds of |x''| and |x'''| for the rest of a flight, in which m a^2 + K v^2 never grows."""
        x, v = y[1 + 4 * self.side : 3 + 4 * self.side]
        a = self.drive - self.stiffness * x - self.damping * v
        jerk = -self.stiffness * v - self.damping * a
        return gmpy2.sqrt(a * a + self.stiffness * v * v), gmpy2.sqrt(jerk * jerk + self.stiffness * a * a)

    def gaps(self, phase: Phase) -> list[_Gap]:
        """The events that can end a phase."""
        if not self.hertzian:
            return []
        one, p = self.sign * mpfr(1), self.sign * self.dissipation
        depth, rate = ((1 + 4 * self.side, one), (X_O, -one)), ((2 + 4 * self.side, p), (V_O, -p))
        negative = [tuple((i, -factor) for i, factor in terms) for terms in (depth, rate)]
        if phase is Phase.APART:
            return [_Gap(mpfr(0), negative[0], self.side, Phase.PRESSED)]
        if phase is Phase.CLAMPED:
            back = _Gap(mpfr(-1), negative[1], self.side, Phase.PRESSED, of_rate=True)
            return [_Gap(mpfr(0), depth, self.side, Phase.APART), back]
        release = _Gap(mpfr(0), ((7 + self.side, mpfr(1)),), self.side, Phase.APART)
        return [release, _Gap(mpfr(1), rate, self.side, Phase.CLAMPED, of_rate=True)][: 2 if p else 1]


def _number(value: Real, decimal: bool) -> Real:
    """An mpfr of the current precision; a float stands for its shortest decimal form if `decimal`."""
    if isinstance(value, float):
        value = repr(float(value)) if decimal else float(value)
    result = mpfr(str(value) if isinstance(value, Decimal) else value)
    if not gmpy2.is_finite(result):
        raise ValueError(f"not a finite number: {value!r}")
    return result


def _propagator(trace: Real, det: Real, t: Real) -> tuple[tuple[Real, Real], tuple[Real, Real]]:
    """exp(A t) and its integral over [0, t] as a + b A, for A of given trace and determinant: A^2 = trace A - det."""
    doublings = max(0, math.ceil(gmpy2.log2(max(abs(trace), gmpy2.sqrt(det)) * t + mpfr(2) ** -9)) + 8)
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


def _wait(value: Real, slope: Real, bound: Real) -> Real:
    """How long a positive function stays positive for certain if its second derivative is at least -bound."""
    value = max(value, 0)
    root = gmpy2.sqrt(slope * slope + 2 * bound * value)
    if slope > 0:
        return (slope + root) / bound if bound else gmpy2.inf()
    return 2 * value / (root - slope) if root - slope else gmpy2.inf() if not bound else mpfr(0)


class _Run:
    """One integration: the vector `y`, the phases of both pairs, and what is recorded."""

    def __init__(self, sides: list[_Side], object_mass: Real, start: Vector, times: Vector, digits: int) -> None:
        self.sides, self.object_mass, self.times = sides, object_mass, times
        self.y = [mpfr(0), *start, mpfr(0), mpfr(0)]
        self.tolerance, self.tiny = mpfr(10) ** -(digits + 4), mpfr(10) ** -(digits + 7)
        self.columns = digits // 3 + 2  # the step is steered to converge in this column of the table
        self.weights = [
            [mpfr(j * j) / (k * k - j * j) for j in range(k - 1, 0, -1)] for k in range(self.columns * 3 // 2)
        ]
        self.states: list[tuple[Real, ...]] = []
        self.touches: tuple[Vector, Vector] = ([], [])
        self.releases: tuple[Vector, Vector] = ([], [])
        self.phases = [Phase.APART, Phase.APART]
        self.step = mpfr(0)
        fired = []
        for side in sides:
            u, rate = side.depth(self.y), side.rate(self.y)
            if u > 0 and side.hertzian:
                self.phases[side.side] = Phase.PRESSED if 1 + side.dissipation * rate >= 0 else Phase.CLAMPED
                self.y[7 + side.side] = gmpy2.sqrt(u)
            elif u == 0 and rate >= 0:
                fired += side.gaps(Phase.APART)
        self.transition(fired)

    def pressed(self) -> list[_Side]:
        return [side for side in self.sides if self.phases[side.side] is Phase.PRESSED]

    def gaps(self) -> list[_Gap]:
        return [gap for side in self.sides for gap in side.gaps(self.phases[side.side])]

    def rates(self, y: Vector) -> Vector:
        """dy/ds; the clock dt/ds is 1 in flight."""
        pressed = self.pressed()
        clock = mpfr(1)
        for side in pressed:
            clock *= y[7 + side.side]
        f = [mpfr(0)] * 9
        for side in pressed:
            w, rate = y[7 + side.side], side.rate(y)
            force = side.sign * side.hertzian * w * w * w * (1 + side.dissipation * rate)
            f[2 + 4 * side.side] = -force / side.mass
            f[V_O] += force / self.object_mass
            f[7 + side.side] = rate if len(pressed) == 1 else rate * y[8 - side.side]
        clock = 2 * clock if pressed else clock
        for side in self.sides:
            x, v = 1 + 4 * side.side, 2 + 4 * side.side
            f[v] = (f[v] + side.drive - side.stiffness * y[x] - side.damping * y[v]) * clock
            f[x] = y[v] * clock
        f[T], f[X_O], f[V_O] = clock, y[V_O] * clock, f[V_O] * clock
        return f

    def drift(self, y: Vector, t: Real) -> Vector:
        """The vector after a time t without impact forces, exactly."""
        result = list(y)
        result[T], result[X_O] = y[T] + t, y[X_O] + y[V_O] * t
        for side in self.sides:
            i, trace = 1 + 4 * side.side, -side.damping
            x, v = y[i], y[i + 1]
            (a, b), (c, d) = _propagator(trace, side.stiffness, t)
            result[i] = a * x + b * v + d * side.drive
            result[i + 1] = a * v + b * (trace * v - side.stiffness * x) + (c + d * trace) * side.drive
        return result

    def extrapolate(self, y: Vector, h: Real) -> tuple[Vector, int]:
        """A step from s to s + h and the column in which it converged; 0: it did not."""
        f0 = self.rates(y)
        previous: list[Vector] = []
        for k in range(1, len(self.weights)):
            part = h / (2 * k)
            old, new = y, [a + part * b for a, b in zip(y, f0, strict=True)]
            for _ in range(2 * k - 1):
                f = self.rates(new)
                old, new = new, [a + 2 * part * b for a, b in zip(old, f, strict=True)]
            row = [new]
            for weight, coarse in zip(self.weights[k], previous, strict=True):
                row.append([a + weight * (a - b) for a, b in zip(row[-1], coarse, strict=True)])
            if k > 1 and all(
                max(abs(a - b) for a, b in zip(row[-1][group], row[-2][group], strict=True))
                <= self.tolerance * max(map(abs, row[-1][group] + y[group]))
                for group in GROUPS
            ):
                return row[-1], k
            previous = row
        return y, 0

    def advance(self, y: Vector, h: Real) -> Vector:
        """The vector at s + h, in as many steps as it takes."""
        result, column = self.extrapolate(y, h)
        return result if column else self.advance(self.advance(y, h / 2), h / 2)

    def locate(self, gap: _Gap, y: Vector, h: Real, end: Vector) -> tuple[Real, Vector]:
        """Where in (0, h] a gap vanishes that has another sign at the end: safeguarded Newton in short steps."""
        low, high, last = mpfr(0), h, gap.value(end)
        s = h * (1 - min(1, last / (last - gap.value(y))))
        z = self.advance(y, s)
        while True:
            value, slope = gap.value(z), gap.slope(self.rates(z))
            low, high = (low, s) if value * last > 0 else (s, high)
            goal = s - value / slope if slope else low
            goal = goal if low <= goal <= high else (low + high) / 2
            if abs(goal - s) <= self.tiny * h:
                return s, z
            s, z = goal, self.advance(z, goal - s)

    def emit(self, y: Vector, end: Vector, h: Real | None = None) -> None:
        """Record the grid up to the time of `end`, from y on, in flight or within a contact step h."""
        while len(self.states) < len(self.times) and self.times[len(self.states)] <= end[T]:
            now = self.times[len(self.states)]
            if h is None:
                z = self.drift(y, now - y[T])
            elif now == end[T]:
                z = end
            else:
                s, z = self.locate(_Gap(-now, ((T, mpfr(1)),)), y, h, end)
                y, h = z, h - s
            self.states.append(tuple(z[1:7]))

    def fly(self) -> None:
        """Up to the first event, in steps that no event can be within."""
        y, horizon = self.y, self.times[-1]
        while True:
            bounds = [side.bounds(y) for side in self.sides]
            f = self.rates(y)
            waits = [
                (_wait(gap.value(y), gap.slope(f), abs(gap.terms[0][1]) * bounds[gap.side][gap.of_rate]), gap)
                for gap in self.gaps()  # in flight the object has no acceleration, so the arm's bounds are the gap's
            ]
            wait = min([wait for wait, _ in waits], default=gmpy2.inf())
            if y[T] + wait > horizon:
                y, fired = self.drift(y, horizon - y[T]), []
                break
            y = self.drift(y, wait)
            if wait <= self.tiny:
                fired = [gap for wait, gap in waits if wait <= 1000 * self.tiny]
                break
        self.emit(self.y, y)
        self.y = y
        self.transition(fired)

    def press(self) -> None:
        """One step of a contact, cut at the first event."""
        y, h = self.y, self.step
        end, column = self.extrapolate(y, h)
        if not column or self.dips(y, end, h):
            self.step = h / 2
            return
        self.step = h * gmpy2.exp2(min(1, mpfr(self.columns - column) / 4))
        crossed = [gap for gap in self.gaps() if gap.value(end) < 0]
        for gap in crossed:
            if gap.after is Phase.PRESSED and not gap.of_rate and gap.value(y) <= 0:
                self.creep(self.sides[gap.side], end, h)
                return
        roots = [(*self.locate(gap, y, h, end), gap) for gap in crossed]
        if roots:
            first, end, _ = min(roots, key=lambda root: root[0])
            roots = [root for root in roots if root[0] <= first + 1000 * self.tiny * h]
            h = first
        self.emit(y, end, h)
        self.y = end
        pressed = self.pressed()
        if not roots and len(pressed) == 2 and all(self.negligible(side) for side in pressed):
            self.transition([side.gaps(Phase.PRESSED)[0] for side in pressed])
        elif roots:
            self.transition([gap for _, _, gap in roots])

    def creep(self, side: _Side, end: Vector, h: Real) -> None:
        """Begin a touch that the other pair's force grows from rest: a step too short for its own to matter."""
        u, rate = side.depth(end), side.rate(end)
        if rate <= 0 or self.impulse(side, u, rate, end[T] - self.y[T]) > self.tiny:
            self.step = h / 2
            return
        self.emit(self.y, end, h)
        self.touches[side.side].append(self.y[T])
        self.y, self.phases[side.side] = end, Phase.PRESSED
        end[7 + side.side] = gmpy2.sqrt(u)
        self.step = self.first_step()

    def dips(self, y: Vector, end: Vector, h: Real) -> bool:
        """Whether a gap may vanish twice within a step: whether its tangents at the ends meet below zero."""
        f, g = self.rates(y), self.rates(end)
        for gap in self.gaps():
            falls, rises = gap.slope(f), gap.slope(g)
            if falls < 0 < rises and gap.value(end) >= 0:
                s = (gap.value(end) - rises * h - gap.value(y)) / (falls - rises)
                if gap.value(y) + falls * s < -self.tiny * max(map(abs, end[1:7])):
                    return True
        return False

    def impulse(self, side: _Side, u: Real, rate: Real, t: Real) -> Real:
        """A bound on the speed that a penetration below u gives in a time t, relative to the rate."""
        force = side.hertzian * u * gmpy2.sqrt(u) * (1 + side.dissipation * rate)
        return force * t / (min(side.mass, self.object_mass) * rate)

    def negligible(self, side: _Side) -> bool:
        """Whether a pair is so near its release that the rest of the contact has no effect."""
        w, rate = self.y[7 + side.side], side.rate(self.y)
        return bool(rate < 0 and self.impulse(side, w * w, -rate, -w * w / rate) < self.tiny)

    def transition(self, fired: list[_Gap]) -> None:
        """Let pairs change phase; the vector is at their event."""
        for gap in fired:
            side, now = self.sides[gap.side], self.y[T]
            w = 7 + side.side
            before, self.phases[side.side] = self.phases[side.side], gap.after
            if gap.after is Phase.PRESSED:
                self.touches[side.side].append(now)
                self.y[w] = mpfr(0) if before is Phase.APART else gmpy2.sqrt(side.depth(self.y))
            elif before is Phase.PRESSED:
                if gap.after is Phase.APART:
                    now -= self.y[w] ** 2 / side.rate(self.y)
                self.releases[side.side].append(now)
        pressed = self.pressed()
        if fired and pressed:
            flat = all(self.y[7 + side.side] <= self.tiny for side in pressed)
            slow = gmpy2.sqrt(self.tiny) * max(abs(v) for v in self.y[2:7:2])
            if flat and (len(pressed) == 2 or pressed[0].rate(self.y) <= slow):
                self.settle(pressed)
        self.step = self.first_step()

    def settle(self, touching: list[_Side]) -> None:
        """Pass a double touch, or one without speed, in a flight too short for the impact force to matter."""
        t = self.tiny ** mpfr(0.2)
        for side in touching:
            rate, bound = max(side.rate(self.y), 0), side.bounds(self.y)[0]
            while (top := rate + bound * t) > 0 and self.impulse(side, top * t, top, t) > self.tiny:
                t /= 2
        y = self.drift(self.y, t)
        self.emit(self.y, y)
        self.y = y
        for side in touching:
            u = side.depth(y)
            if u > 0:
                y[7 + side.side] = gmpy2.sqrt(u)
            else:
                self.phases[side.side] = Phase.APART
                self.touches[side.side].pop()

    def first_step(self) -> Real:
        """A third of a Hertz contact's time scale, in s."""
        clock, spans = mpfr(1), []
        for side in self.pressed():
            mass, w = min(side.mass, self.object_mass), self.y[7 + side.side]
            speed = max(abs(side.rate(self.y)), gmpy2.sqrt(side.hertzian * w**5 / mass))
            scale = gmpy2.root(mass * speed * speed / side.hertzian, 5)
            clock *= scale
            spans.append(scale * scale / speed)
        return min(spans) / (6 * clock) if spans else mpfr(0)


def _side(side: int, arm: Arm, contact: Contact, force: float, feedback: bool, decimal: bool) -> _Side:
    """The parameters of one side, checked."""
    mass, k, c, kp, kv = (_number(value, decimal) for value in arm)
    hertzian, dissipation = (_number(value, decimal) for value in contact)
    stiffness, damping = (k + kp, c + kv) if feedback else (k, c)
    if mass <= 0 or min(stiffness, damping, hertzian, dissipation) < 0:
        raise ValueError(f"a mass must be positive, stiffness, damping, H and p must not be negative: {arm}, {contact}")
    drive = _number(force, decimal) / mass
    return _Side(side, 1 - 2 * side, stiffness / mass, damping / mass, drive, mass, hertzian, dissipation)


def integrate(
    grasp: Grasp,
    state0: Sequence[float],
    times: Sequence[float],
    digits: int = 30,
    force: Sequence[float] = (0.0, 0.0),
    feedback: bool = True,
    decimal: bool = False,
) -> Reference:
    """The motion of a grasp in high precision.

    Every number may be a float, an int, a str, a Decimal or an mpfr.

    Parameters
    ----------
    grasp : Grasp
        Impact forces of a side with H = 0 do not exist, and its contacts are not recorded.
    state0 : sequence (6,), m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r at t = 0. A pair may start in contact; that is no touch.
    times : sequence (N,), s
        Ascending, from 0; the states are given here.
    digits : int
        Each step keeps this many digits; a scene that amplifies errors ends with fewer.
    force : sequence (2,), N
        Constant forces on the left and the right arm, added to the feedback if there is one.
    feedback : bool
        Whether the continuous feedback (4), (5) acts.
    decimal : bool
        A float stands for its shortest decimal form, 0.2 for one fifth, rather than for its binary value.

    Returns
    -------
    Reference

    Raises
    ------
    ValueError
        If a number is not finite, a mass is not positive, K, C, H or p is negative, `state0` has not six
        components, or the times are not ascending from 0.
    RuntimeError
        If the motion has more phases and contact steps than EVENT_BUDGET.
    """
    with gmpy2.context(precision=math.ceil(digits * math.log2(10)) + GUARD_BITS):
        grid, start = ([_number(value, decimal) for value in values] for values in (times, state0))
        if not grid or grid[0] != 0 or any(b <= a for a, b in pairwise(grid)):
            raise ValueError("times must ascend from 0")
        object_mass = _number(grasp.object_mass, decimal)
        if len(start) != 6 or object_mass <= 0:
            raise ValueError("state0 needs six components, and the object a positive mass")
        sides = [
            _side(0, grasp.left, grasp.left_contact, force[0], feedback, decimal),
            _side(1, grasp.right, grasp.right_contact, force[1], feedback, decimal),
        ]
        run = _Run(sides, object_mass, start, grid, digits)
        for _ in range(EVENT_BUDGET):
            if len(run.states) == len(grid):
                return Reference(grid, run.states, run.touches, run.releases)
            if run.pressed():
                run.press()
            else:
                run.fly()
    raise RuntimeError(f"more than {EVENT_BUDGET} phases and contact steps before t = {float(run.y[T])} s")

"""Taylor series of the motion within one mode.

The impact force contains u^(3/2), which is not smooth at u = 0. So w = sqrt(u) is carried along, and the independent
variable is s with dt = 2 w ds for one such pair and dt = 2 w_l w_r ds for two. Then dw/ds is u', or u' times the
other w, all right-hand sides are polynomials, and w crosses zero at a release. Such a pair is called rooted. For a
pair far from u = 0 the series of u^(3/2) follows from that of u, and s can be the time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from operator import mul
from typing import NamedTuple

import gmpy2
from gmpy2 import mpfr

from lab.reference.plant import OBJECT, SIDES, SIGN, Law, Plant, Real, Reals, State
from lab.reference.roots import value_at

FIRST, LAST = 6, 4  # terms of a series whose sizes are compared


class Expansion(NamedTuple):
    """Coefficients of powers of s; empty for bodies and pairs that take no part."""

    t: Reals
    x: list[Reals]
    v: list[Reals]
    w: list[Reals]  # of a pressed pair; u where it is not rooted
    force: list[Reals]  # of a pressed pair, N
    rooted: tuple[int, ...]  # sides whose w is in the clock

    def depth(self, side: int) -> Reals:
        """u of a pair."""
        return [SIGN[side] * (a - b) for a, b in zip(self.x[side], self.x[OBJECT], strict=True)]

    def rate(self, side: int) -> Reals:
        """u' of a pair."""
        return [SIGN[side] * (a - b) for a, b in zip(self.v[side], self.v[OBJECT], strict=True)]

    def at(self, s: Real, state: State) -> State:
        """The state at s; what takes no part stays as it is in `state`."""
        x, v = (
            [value_at(row, s) if row else old for row, old in zip(rows, before, strict=True)]
            for rows, before in ((self.x, state.x), (self.v, state.v))
        )
        w = [value_at(row, s) if row else mpfr(0) for row in self.w]
        w = [value if side in self.rooted else gmpy2.sqrt(max(value, 0)) for side, value in enumerate(w)]
        return State(state.t + value_at(self.t, s), x, v, w)


def product(a: Sequence[Real], b: Sequence[Real]) -> Real:
    """The coefficient of the last power in the product of two series of equal length."""
    return sum(map(mul, a, b[::-1]))


def expand(plant: Plant, state: State, moving: Sequence[int], wall: bool, pressed: Sequence[int],
           rooted: Sequence[int], order: int) -> Expansion:
    """Series of the time, of all bodies that move and of the pressed pairs.

    The object may take part as a wall. Rooted are those of the pressed sides whose w is in the clock.
    """
    zero = mpfr(0)
    x: list[Reals] = [[], [], []]
    v: list[Reals] = [[], [], []]
    for body in moving:
        x[body], v[body] = [state.x[body]], [state.v[body]]
    if wall:
        x[OBJECT], v[OBJECT] = [state.x[OBJECT]] + [zero] * order, [zero] * (order + 1)
    rows = {side: (_Rooted if side in rooted else _Deep)(plant.law(side), SIGN[side], state, side) for side in pressed}
    t, clock = [zero], []
    a: list[Reals] = [[], [], []]
    for k in range(order + 1):
        for side, row in rows.items():
            row.extend(x[side], v[side], x[OBJECT], v[OBJECT], k)
        if rooted:
            clock.append(2 * _of_all([rows[side].w for side in rooted], k))
        if k == order:
            break
        t.append((clock[k] if rooted else mpfr(k == 0)) / (k + 1))
        for body in moving:
            a[body].append(_acceleration(plant, rows, body, x[body][k], v[body][k], k))
            x[body].append((product(v[body], clock) if rooted else v[body][k]) / (k + 1))
        for body in moving:
            v[body].append((product(a[body], clock) if rooted else a[body][k]) / (k + 1))
        slopes = [_of_all([rows[side].rate, *(rows[other].w for other in rooted if other != side)], k)
                  for side in rooted]
        for side, slope in zip(rooted, slopes, strict=True):
            rows[side].w.append(slope / (k + 1))
    empty: Reals = []
    depths = [rows[side].event if side in rows else empty for side in SIDES]
    forces_of = [rows[side].force if side in rows else empty for side in SIDES]
    return Expansion(t, x, v, depths, forces_of, tuple(rooted))


class _Rooted:
    """Series of a pressed pair by w, a variable of its own."""

    def __init__(self, law: Law, sign: int, state: State, side: int) -> None:
        self.law, self.sign = law, sign
        self.w = self.event = [state.w[side]]
        self.rate: Reals = []
        self.square: Reals = []
        self.cube: Reals = []
        self.factor: Reals = []
        self.force: Reals = []

    def extend(self, x: Reals, v: Reals, x_o: Reals, v_o: Reals, k: int) -> None:
        """The next power."""
        self.rate.append(self.sign * (v[k] - v_o[k]))
        self.square.append(product(self.w, self.w))
        self.cube.append(product(self.w, self.square))
        self.push(k)

    def push(self, k: int) -> None:
        """H u^(3/2) (1 + p u')."""
        if self.law.dissipation:
            self.factor.append(self.law.dissipation * self.rate[k] + (k == 0))
            self.force.append(self.law.hertzian * product(self.cube, self.factor))
        else:
            self.force.append(self.law.hertzian * self.cube[k])


class _Deep(_Rooted):
    """Series of a pressed pair far from u = 0, by the differential equation of u^(3/2): u P' = 3/2 u' P."""

    def __init__(self, law: Law, sign: int, state: State, side: int) -> None:
        super().__init__(law, sign, state, side)
        self.u: Reals = []
        self.event = self.u
        self.scaled: Reals = []  # k u_k

    def extend(self, x: Reals, v: Reals, x_o: Reals, v_o: Reals, k: int) -> None:
        self.rate.append(self.sign * (v[k] - v_o[k]))
        self.u.append(self.sign * (x[k] - x_o[k]))
        self.scaled.append(k * self.u[k])
        if k == 0:
            self.cube.append(self.u[0] * gmpy2.sqrt(self.u[0]))
        else:
            part = 5 * product(self.scaled[1:], self.cube) / 2 - k * product(self.u[1:], self.cube)
            self.cube.append(part / (k * self.u[0]))
        self.push(k)


def _of_all(rows: Sequence[Reals], k: int) -> Real:
    """Coefficient k of the product of one or two series."""
    return rows[0][k] if len(rows) == 1 else product(rows[0][: k + 1], rows[1][: k + 1])


def _acceleration(plant: Plant, rows: Mapping[int, _Rooted], body: int, x: Real, v: Real, k: int) -> Real:
    """Coefficient k of the acceleration of a body."""
    own = plant.body(body)
    push = -own.stiffness * x - own.damping * v
    if k == 0:
        push += own.drive
    for side, row in rows.items():
        if body in (side, OBJECT):
            push -= (row.sign if body == side else -row.sign) * row.force[k] / own.mass
    return push


def reach(expansion: Expansion, tolerance: Real) -> Real:
    """How far the series hold: there the last terms are below the tolerance, relative to the first ones."""
    groups = [[row for row in rows if row] for rows in (expansion.x, expansion.v)]
    groups += [[row] for row in expansion.w if row]
    goal, best = gmpy2.get_exp(tolerance), math.inf
    for group in groups:
        # binary exponents of the largest coefficient of each power
        sizes = [max(gmpy2.get_exp(a) if a else -math.inf for a in column) for column in zip(*group, strict=True)]
        for k in range(len(sizes) - LAST, len(sizes)):
            if sizes[k] > -math.inf:
                first = [(goal + sizes[j] - sizes[k]) / (k - j) for j in range(FIRST) if sizes[j] > -math.inf]
                best = min(best, max(first, default=best))
    return gmpy2.exp2(mpfr(best))

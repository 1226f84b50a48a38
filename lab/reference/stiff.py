"""Radau collocation for squeezed contacts with a large p, where a Taylor step is a few relaxation times long.

The stages are the accelerations: position and velocity at the nodes are integrals of their polynomial. The method is
L-stable, so that a step need resolve only what still moves.

References
----------
E. Hairer, G. Wanner: Solving Ordinary Differential Equations II, sections IV.5 and IV.8.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from operator import mul
from typing import NamedTuple

import gmpy2
import numpy as np
from gmpy2 import mpfr

from lab.reference.plant import OBJECT, SIGN, Plant, Real, Reals, State
from lab.reference.series import Expansion

STAGES = 20
ITERATIONS = 25
Matrix = list[Reals]


class _Table(NamedTuple):
    """The method for one precision: nodes, integrals over [0, c_i] once and twice, and nodes to powers."""

    nodes: Reals
    once: Matrix
    twice: Matrix
    powers: Matrix  # values at the nodes to coefficients


def _solve(matrix: Matrix, right: Matrix) -> Matrix:
    """Gauss elimination with partial pivoting; `right` holds columns side by side."""
    rows = [[*a, *b] for a, b in zip(matrix, right, strict=True)]
    n = len(rows)
    for i in range(n):
        pivot = max(range(i, n), key=lambda k: abs(rows[k][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        top = rows[i][i:]
        for k in range(i + 1, n):
            if rows[k][i]:
                factor = rows[k][i] / top[0]
                rows[k][i:] = [a - factor * b for a, b in zip(rows[k][i:], top, strict=True)]
    found: Matrix = [[] for _ in range(n)]
    for i in range(n - 1, -1, -1):
        tail = rows[i][n:]
        for k in range(i + 1, n):
            if rows[i][k]:
                tail = [a - rows[i][k] * b for a, b in zip(tail, found[k], strict=True)]
        found[i] = [a / rows[i][i] for a in tail]
    return found


def _legendre(n: int, x: Real) -> tuple[Real, Real]:
    """P_(n-1) and P_n."""
    before, now = mpfr(1), x
    for k in range(2, n + 1):
        before, now = now, ((2 * k - 1) * x * now - (k - 1) * before) / k
    return before, now


@lru_cache(maxsize=4)
def _table(precision: int) -> _Table:
    with gmpy2.context(gmpy2.get_context(), precision=precision):
        starts = np.polynomial.legendre.legroots([0.0] * (STAGES - 1) + [-1.0, 1.0])
        nodes = []
        for start in sorted(starts)[:-1]:
            x, h = mpfr(float(start)), gmpy2.exp2(-precision // 3)
            for _ in range(40):  # secant steps of quadratic quality
                (a, b), (c, d) = _legendre(STAGES, x), _legendre(STAGES, x + h)
                x -= (b - a) * h / ((d - c) - (b - a))
            nodes.append((1 + x) / 2)
        nodes.append(mpfr(1))
        vander = [[c**k for k in range(STAGES)] for c in nodes]
        unit = [[mpfr(i == k) for k in range(STAGES)] for i in range(STAGES)]
        powers = _solve(vander, unit)
        columns = list(zip(*powers, strict=True))
        once = [[sum(a * c ** (k + 1) / (k + 1) for k, a in enumerate(column)) for column in columns] for c in nodes]
        twice = [[sum(a * c ** (k + 2) / ((k + 1) * (k + 2)) for k, a in enumerate(column)) for column in columns]
                 for c in nodes]
        return _Table(nodes, once, twice, powers)


class Squeeze(NamedTuple):
    """The equations of motion of one mode, as the collocation needs them."""

    plant: Plant
    state: State
    moving: Sequence[int]
    pressed: Sequence[int]

    def accelerations(self, x: Reals, v: Reals) -> tuple[Reals, Matrix, Matrix]:
        """Of the moving bodies, with their derivatives by x and by v; x, v by body."""
        place = {body: i for i, body in enumerate(self.moving)}
        n = len(place)
        a, by_x, by_v = [], [[mpfr(0)] * n for _ in range(n)], [[mpfr(0)] * n for _ in range(n)]
        for i, body in enumerate(self.moving):
            row = self.plant.body(body)
            a.append(row.acceleration(x[body], v[body]))
            by_x[i][i] -= row.stiffness
            by_v[i][i] -= row.damping
        for side in self.pressed:
            law, u = self.plant.law(side), SIGN[side] * (x[side] - x[OBJECT])
            if u <= 0:
                raise ArithmeticError("an iterate parts the pair")
            root, q = gmpy2.sqrt(u), 1 + law.dissipation * SIGN[side] * (v[side] - v[OBJECT])
            force = law.hertzian * u * root * q
            slope_x, slope_v = law.hertzian * root * q * 3 / 2, law.hertzian * u * root * law.dissipation
            for body, sign in ((side, -1), (OBJECT, 1)):
                if body not in place:
                    continue
                mass = self.plant.body(body).mass
                a[place[body]] += sign * SIGN[side] * force / mass
                for other, way in ((side, 1), (OBJECT, -1)):
                    if other in place:
                        by_x[place[body]][place[other]] += sign * way * slope_x / mass
                        by_v[place[body]][place[other]] += sign * way * slope_v / mass
        return a, by_x, by_v

    def collocate(self, h: Real, tolerance: Real) -> Expansion | None:
        """Polynomials in the time over a step h, None if it is too long. In place of w they hold u."""
        table = _table(gmpy2.get_context().precision)
        n = len(self.moving)
        stages: Matrix = [[mpfr(0)] * n for _ in range(STAGES)]
        last = None
        for _ in range(ITERATIONS):
            try:
                change = self._newton(table, h, stages)
            except (ArithmeticError, ZeroDivisionError):
                return None
            stages = [[a + b for a, b in zip(row, more, strict=True)] for row, more in zip(stages, change, strict=True)]
            size = max(abs(a) for row in change for a in row)
            if last is not None and size <= tolerance * max(abs(a) for row in stages for a in row):
                return self._polynomials(table, h, stages, tolerance)
            last = size
        return None

    def _at(self, table: _Table, h: Real, stages: Matrix, i: int) -> tuple[Reals, Reals]:
        """Positions and velocities at a node, by body."""
        x, v = list(self.state.x), list(self.state.v)
        for b, body in enumerate(self.moving):
            column = [row[b] for row in stages]
            x[body] += h * (table.nodes[i] * v[body] + h * sum(map(mul, table.twice[i], column)))
            v[body] += h * sum(map(mul, table.once[i], column))
        return x, v

    def _newton(self, table: _Table, h: Real, stages: Matrix) -> Matrix:
        """A Newton correction of the stages."""
        n = len(self.moving)
        matrix: Matrix = []
        right: Matrix = []
        for i in range(STAGES):
            a, by_x, by_v = self.accelerations(*self._at(table, h, stages, i))
            for b in range(n):
                row = []
                for k in range(STAGES):
                    one, two = h * table.once[i][k], h * h * table.twice[i][k]
                    row += [(i == k and b == c) - one * by_v[b][c] - two * by_x[b][c] for c in range(n)]
                matrix.append(row)
                right.append([a[b] - stages[i][b]])
        flat = [row[0] for row in _solve(matrix, right)]
        return [flat[i : i + n] for i in range(0, len(flat), n)]

    def _polynomials(self, table: _Table, h: Real, stages: Matrix, tolerance: Real) -> Expansion | None:
        """Coefficients of powers of the time, None if the last ones are too large."""
        empty: Matrix = [[], [], []]
        x, v = list(empty), list(empty)
        speeds = [max(abs(a) for a in self.state.v)]
        for b, body in enumerate(self.moving):
            column = [row[b] for row in stages]
            powers = [sum(map(mul, row, column)) for row in table.powers]
            speed = [self.state.v[body], *(a * h / (k + 1) for k, a in enumerate(powers))]
            way = [self.state.x[body], *(a * h / (k + 1) for k, a in enumerate(speed))]
            v[body], x[body] = [[a / h**k for k, a in enumerate(row)] for row in ([*speed, mpfr(0)], way)]
            speeds.append(max(map(abs, speed)))
            # on [0, 1] a Chebyshev coefficient is a power's over 2^(2 k - 1)
            if max(abs(a) / 4**k for k, a in enumerate(speed) if k >= STAGES - 2) > tolerance * max(speeds):
                return None
        if OBJECT not in self.moving:
            x[OBJECT] = [self.state.x[OBJECT]] + [mpfr(0)] * (STAGES + 1)
            v[OBJECT] = [mpfr(0)] * (STAGES + 2)
        w: Matrix = [[], []]
        force: Matrix = [[], []]
        t = [mpfr(0), mpfr(1)] + [mpfr(0)] * STAGES
        for side in self.pressed:
            w[side] = [SIGN[side] * (a - b) for a, b in zip(x[side], x[OBJECT], strict=True)]
            force[side] = self._force(side, table, h, stages)
        return Expansion(t, x, v, w, force, ())

    def _force(self, side: int, table: _Table, h: Real, stages: Matrix) -> Reals:
        """The impact force of a pair, from the momentum of its arm."""
        row = self.plant.body(side)
        values = []
        for i in range(STAGES):
            x, v = self._at(table, h, stages, i)
            free = row.acceleration(x[side], v[side])
            values.append(-SIGN[side] * row.mass * (stages[i][self.moving.index(side)] - free))
        powers = [sum(map(mul, line, values)) for line in table.powers]
        return [*(a / h**k for k, a in enumerate(powers)), mpfr(0), mpfr(0)]

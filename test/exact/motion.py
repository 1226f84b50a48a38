"""A motion with contacts in 50 digits, by extrapolation in the logarithm of the time, along which u is like a power."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import gmpy2
from exact.bench import Bench
from gmpy2 import mpfr

from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of, Pair, U

BITS, COLUMNS = 166, 12  # 50 digits
Rates = Callable[[list[Any]], list[Any]]


def motion_of(b: Bench) -> Rates:
    """The right-hand side (1) to (3), for x and v of the left arm, the object and the right arm."""
    rows = [[mpfr(value) for value in b.plant.bodies[body].tolist()] for body in (LEFT, OBJECT, RIGHT)]
    pairs = [[mpfr(value) for value in b.plant.pairs[side].tolist()] for side in (LEFT, RIGHT)]
    pushing = [b.mode(side) is Pair.CONTACT for side in (LEFT, RIGHT)]

    def rates(y: list[Any]) -> list[Any]:
        forces = []
        for side, (u, d) in enumerate(((y[0] - y[2], y[1] - y[3]), (y[2] - y[4], y[3] - y[5]))):
            factor = 1 + pairs[side][Law.DISSIPATION] * d
            active = pushing[side] and u > 0 and factor > 0
            forces.append(pairs[side][Law.HERTZIAN] * u * gmpy2.sqrt(u) * factor if active else mpfr(0))
        found = []
        for row, x, v, f in zip(rows, y[::2], y[1::2], (-forces[0], forces[0] - forces[1], forces[1]), strict=True):
            total = row[Of.FORCE] - row[Of.STIFFNESS] * x - row[Of.DAMPING] * v + f
            found += [v, mpfr(0) if gmpy2.is_infinite(row[Of.MASS]) else total / row[Of.MASS]]
        return found

    return rates


def extrapolated(rates: Rates, y: list[Any], begin: Any, end: Any, *, log: bool) -> list[Any]:
    """One step by extrapolated midpoint rules, in the time or in its logarithm."""
    a, h = (gmpy2.log(begin), gmpy2.log(end / begin)) if log else (begin, end - begin)

    def slope(tau: Any, z: list[Any]) -> list[Any]:
        stretch = gmpy2.exp(tau) if log else mpfr(1)
        return [stretch * value for value in rates(z)]

    row: list[list[Any]] = []
    for k in range(1, COLUMNS + 1):
        part = h / (2 * k)
        old, new = y, [p + part * q for p, q in zip(y, slope(a, y), strict=True)]
        for j in range(1, 2 * k):
            old, new = new, [p + 2 * part * q for p, q in zip(old, slope(a + j * part, new), strict=True)]
        previous, row = row, [new]
        for j, coarse in enumerate(previous):
            weight = mpfr((k - 1 - j) ** 2) / (k**2 - (k - 1 - j) ** 2)
            row.append([p + weight * (p - q) for p, q in zip(row[-1], coarse, strict=True)])
    return row[-1]


def states_at(b: Bench, times: list[float]) -> Iterator[list[Any]]:
    """x and v of left arm, object and right arm at ascending times, and u of both pairs behind them."""
    rates, y = motion_of(b), [mpfr(float(value)) for value in b.state.y[:6]]
    for side, (front, back) in ((LEFT, (0, 2)), (RIGHT, (2, 4))):  # u has digits that the positions have not
        y[4 * side] = y[2] + (1 if side == LEFT else -1) * mpfr(float(b.state.y[U.L + side]))
        assert front < back
    t = mpfr(times[0]) * mpfr("1e-9")
    y = extrapolated(rates, y, mpfr(0), t, log=False)
    for end in times:
        steps = max(math.ceil(2 * gmpy2.log(mpfr(end) / t)), 1)
        knots = [t * (mpfr(end) / t) ** (mpfr(j) / steps) for j in range(steps + 1)]
        for first, last in pairwise(knots):
            y = extrapolated(rates, y, first, last, log=True)
        t = knots[-1]
        yield [*y, y[0] - y[2], y[2] - y[4]]

"""Polynomials: their values, their sizes, and the first point where one becomes negative."""

from __future__ import annotations

from collections.abc import Sequence

import gmpy2
from gmpy2 import mpfr

from lab.reference.plant import Real, Reals

DEPTH = 100  # halvings after which two roots are one


def value_at(row: Sequence[Real], s: Real) -> Real:
    """A polynomial by Horner's rule."""
    value = row[-1]
    for a in row[-2::-1]:
        value = value * s + a
    return value


def bound_at(row: Sequence[Real], s: Real) -> Real:
    """What the absolute values of a polynomial's terms add up to."""
    return value_at([abs(a) for a in row], s)


def sizes(rows: Sequence[Sequence[Real]], h: Real) -> Real:
    """The largest term of some polynomials on [0, h]."""
    powers = [mpfr(1)]
    for _ in range(max(map(len, rows), default=0)):
        powers.append(powers[-1] * h)
    return max((abs(a) * power for row in rows for a, power in zip(row, powers, strict=False)), default=mpfr(0))


def first_crossing(row: Sequence[Real], h: Real, noise: Real) -> Real | None:
    """Where in [0, h] a polynomial that must not be negative becomes negative.

    Leading coefficients that are noise are zero, so that the first derivative that differs decides at 0; a polynomial
    that is noise altogether is zero for ever.
    """
    scaled, power = [], mpfr(1)
    for a in row:
        scaled.append(a * power)
        power *= h
    while scaled and abs(scaled[0]) <= noise:
        scaled.pop(0)
    if not scaled:
        return None
    if scaled[0] < 0:
        return mpfr(0)
    root = _search(scaled, DEPTH)
    return None if root is None else root * h


def _search(row: Reals, depth: int) -> Real | None:
    """The first root of a polynomial in (0, 1] that is positive at 0."""
    end = sum(row)
    if row[0] > sum(map(abs, row[1:])):
        return None
    if abs(row[1]) > sum(k * abs(a) for k, a in enumerate(row) if k > 1):
        return None if row[1] > 0 or end > 0 else _newton(row)
    if depth == 0:
        return mpfr(1) if end < 0 else None
    half = [a / 2**k for k, a in enumerate(row)]
    root = _search(half, depth - 1)
    if root is not None:
        return root / 2
    half = _shifted(half)
    if half[0] <= 0:
        return mpfr(1) / 2
    root = _search(half, depth - 1)
    return None if root is None else (1 + root) / 2


def _shifted(row: Reals) -> Reals:
    """The polynomial around 1."""
    row = list(row)
    for i in range(len(row) - 1):
        for k in range(len(row) - 2, i - 1, -1):
            row[k] += row[k + 1]
    return row


def _newton(row: Reals) -> Real:
    """The root of a decreasing polynomial in [0, 1]: Newton, kept within the bracket."""
    slopes = [k * a for k, a in enumerate(row)][1:]
    low, high, s = mpfr(0), mpfr(1), row[0] / (row[0] - sum(row))
    tiny = gmpy2.exp2(6 - gmpy2.get_context().precision)
    for _ in range(4 * gmpy2.get_context().precision):
        value, slope = value_at(row, s), value_at(slopes, s)
        low, high = (s, high) if value > 0 else (low, s)
        goal = s - value / slope if slope else low
        goal = goal if low <= goal <= high else (low + high) / 2
        if abs(goal - s) <= tiny * max(goal, tiny):
            return goal
        s = goal
    return s

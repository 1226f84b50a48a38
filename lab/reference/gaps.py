"""The polynomials whose first root ends a step."""

from __future__ import annotations

from typing import NamedTuple

import gmpy2
from gmpy2 import mpfr

from lab.reference.motion import Motion, Pair
from lab.reference.plant import OBJECT, SIDES, SIGN, Real, Reals
from lab.reference.roots import sizes
from lab.reference.series import Expansion

SPARE_BITS = 48  # between the unit roundoff and what counts as a difference


class Gap(NamedTuple):
    """A polynomial that is not negative until its event."""

    row: Reals
    noise: Real  # coefficients times powers of the step below this are zero
    event: str
    body: int
    sign: int = 0  # of the direction in which the object slips


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

"""Derivatives of a motion by differences of the high-precision reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

import gmpy2
import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.reference.plant import Real, Reals
from lab.reference.solve import integrate

STEP = 2.0**-50  # of a number, whose neighbours are 2^-53 to 2^-52 of it apart
FROM_ZERO = 2.0**-60  # the step of a number that is 0, whose neighbours are as near as one likes
DIGITS = 25


class Derivative(NamedTuple):
    """Derivatives by one number, at fixed times; those of the times of contacts by side.

    They are empty where the two motions have not as many: mirror images, say.
    """

    state: Array  # (m, 6)
    touches: tuple[list[float], list[float]]  # s
    releases: tuple[list[float], list[float]]


def difference(scene: Scene, key: str, times: Sequence[float]) -> Derivative:
    """Central differences, or one-sided ones of a number at 0 that cannot be negative, extrapolated to a step of 0.

    Those of two steps are, one of them twice the other (L. F. Richardson, Phil. Trans. R. Soc. A 210 (1911) 307): where
    a motion grows by 1e11, even the smallest step of a float is too long for one difference.
    """
    section, _, name = key.partition(".")
    value = scene.values[section][name]
    step = STEP * 2.0 ** round(math.log2(abs(value))) if value else FROM_ZERO
    central = value != 0.0 or "position" in name or "velocity_m" in name or "set_point" in name
    with gmpy2.context(precision=4 * DIGITS):
        near, far = (_slopes(scene, key, times, value - width if central else value, value + width)
                     for width in (step, 2.0 * step))
        order = 2 if central else 1  # of the error in the step
        *state, left, right, later_left, later_right = _pairwise(lambda a, b: a + (a - b) / (2**order - 1), near, far)
    return Derivative(np.array(state, dtype=float), _floats(left, right), _floats(later_left, later_right))


def _slopes(scene: Scene, key: str, times: Sequence[float], low: float, high: float) -> list[Reals]:
    """Differences of states, one after another, and of the times of touches and releases, left and right."""
    first, second = (
        (*run.state, *run.touches, *run.releases)
        for run in (integrate(scene.changed({key: at}), times, DIGITS) for at in (low, high)))
    width = gmpy2.mpq(Fraction(high) - Fraction(low))
    return _pairwise(lambda a, b: (b - a) / width, first, second)


def _pairwise(
    combine: Callable[[Real, Real], Real], first: Iterable[Sequence[Real]], second: Iterable[Sequence[Real]],
) -> list[Reals]:
    """Combine the numbers of two sequences of lists; those of unequal lengths make an empty one."""
    return [[combine(a, b) for a, b in zip(*pair, strict=True)] if len(pair[0]) == len(pair[1]) else []
            for pair in zip(first, second, strict=True)]


def _floats(left: Reals, right: Reals) -> tuple[list[float], list[float]]:
    return [float(value) for value in left], [float(value) for value in right]

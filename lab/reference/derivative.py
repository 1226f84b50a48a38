"""Derivatives of a motion by differences of the high-precision reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import gmpy2
import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.reference.plant import SIDES
from lab.reference.solve import Reference, integrate

STEP = 2.0**-44  # of a number near 1: so small that no derivative changes over it; sums in a scene stay exact
DIGITS = 30


class Derivative(NamedTuple):
    """Derivatives by one number, at fixed times; those of the times of contacts by side.

    They are empty where the two motions have not as many: mirror images, say.
    """

    state: Array  # (m, 6)
    touches: tuple[list[float], list[float]]  # s
    releases: tuple[list[float], list[float]]


def difference(scene: Scene, key: str, times: Sequence[float]) -> Derivative:
    """A central difference, or a one-sided one of a number at 0 that cannot be negative."""
    section, _, name = key.partition(".")
    value = scene.values[section][name]
    step = STEP * max(1.0, 2.0 ** round(math.log2(abs(value) or 1.0)))
    signed = "position" in name or "velocity_m" in name or "set_point" in name
    low, high = value - step if value >= step or signed else value, value + step
    first, second = (integrate(scene.changed({key: at}), times, DIGITS) for at in (low, high))
    with gmpy2.context(precision=4 * DIGITS):
        width = gmpy2.mpq(Fraction(high) - Fraction(low))
        state = [[float((b - a) / width) for a, b in zip(*rows, strict=True)]
                 for rows in zip(first.state, second.state, strict=True)]
        return Derivative(np.array(state), _times(first, second, width, 2), _times(first, second, width, 3))


def _times(first: Reference, second: Reference, width: float, place: int) -> tuple[list[float], list[float]]:
    left, right = ([float((b - a) / width) for a, b in zip(first[place][side], second[place][side], strict=True)]
                   if len(first[place][side]) == len(second[place][side]) else [] for side in SIDES)
    return left, right

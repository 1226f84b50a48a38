"""P(x), V and its parts written out from the numbers of a scene as (12), (14) to (16), (21), (28) and (29) print them.

The functions of `physics` do the same from arrays, for any system, in another order. These share no line with them, so
that the two can be held against each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.paper.cases import value_of


class Side(NamedTuple):
    """Numbers of one side, in SI units."""

    m: float
    k: float
    c: float
    Kp: float
    Kv: float
    H: float
    p: float


def side_of(scene: Scene, name: str) -> Side:
    """The numbers of the left or the right side."""
    return Side(*(value_of(scene, f"{letter}_{name[0]}") for letter in Side._fields))


def pairs(scene: Scene, y: Array) -> tuple[tuple[Side, float, float], tuple[Side, float, float]]:
    """Left and right side at one state (6,), each with its u and u' of (8)."""
    x_l, v_l, x_o, v_o, x_r, v_r = y.tolist()
    return (side_of(scene, "left"), x_l - x_o, v_l - v_o), (side_of(scene, "right"), x_o - x_r, v_o - v_r)


def touching(side: Side, u: float, rate: float) -> bool:
    """(10)."""
    return u >= 0.0 and (side.p == 0.0 or rate >= -1.0 / side.p)


def matrix(scene: Scene, y: Array) -> Array:
    """(12) at one state (6,), entry by entry, with (14), (15)."""
    left, right, m_o = side_of(scene, "left"), side_of(scene, "right"), value_of(scene, "m_o")
    k_l, k_r = (4.0 / 5.0 * side.H * u**0.5 if touching(side, u, d) else 0.0 for side, u, d in pairs(scene, y))
    return np.array(
        [
            [left.k + left.Kp + k_l, 0.0, -k_l, 0.0, 0.0, 0.0],
            [0.0, left.m, 0.0, 0.0, 0.0, 0.0],
            [-k_l, 0.0, k_l + k_r, 0.0, -k_r, 0.0],
            [0.0, 0.0, 0.0, m_o, 0.0, 0.0],
            [0.0, 0.0, -k_r, 0.0, right.k + right.Kp + k_r, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, right.m],
        ]
    )


def parts(scene: Scene, y: Array) -> Array:
    """(29) at one state: V_l, V_o, V_r in J."""
    left, right = side_of(scene, "left"), side_of(scene, "right")
    x_l, v_l, _, v_o, x_r, v_r = y.tolist()
    return np.array(
        [
            (left.k + left.Kp) * x_l**2 + left.m * v_l**2,
            value_of(scene, "m_o") * v_o**2,
            (right.k + right.Kp) * x_r**2 + right.m * v_r**2,
        ]
    )


def level(scene: Scene, y: Array) -> float:
    """(16), (21) or (28) at one state, whichever its condition of contact asks for, in J."""
    total = float(parts(scene, y).sum())
    for side, u, d in pairs(scene, y):
        if touching(side, u, d):
            total += 4.0 / 5.0 * side.H * u**2.5
    return total


def rate(scene: Scene, y: Array) -> float:
    """(18) or (23) with a = b = 4/5, or the sum of (31), (32) and (34), at one state, in W."""
    left, right = side_of(scene, "left"), side_of(scene, "right")
    _, v_l, _, _, _, v_r = y.tolist()
    total = -2.0 * (left.c + left.Kv) * v_l**2 - 2.0 * (right.c + right.Kv) * v_r**2
    for side, u, d in pairs(scene, y):
        if touching(side, u, d):
            total -= 2.0 * side.p * side.H * u**1.5 * d**2
    return float(total)

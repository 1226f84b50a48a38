"""What a solver must look like to be measured: its settings, and its answer.

No outside peer knows condition (10)'s second surface u' = -1/p as an event: it would only cost time in the scenes
that are measured. Tried and not available as a wheel for these Python versions: numbalsoda.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from grasp_ros.physics.layout import LEFT, V, X
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene

TOGETHER_M = 1e-13  # a gap below this at the other side's touch is a touch of both


class Answer(NamedTuple):
    """What a solver delivers."""

    state: Array  # (n, 6), m and m/s; fewer rows than asked for if it failed
    touches: tuple[int, int] | None  # left and right; None: it does not look for them
    status: str
    steps: int | None  # None: the solver does not say
    right_hand_sides: int | None


Solve = Callable[[Array], Answer]  # from the output times, of which the last is the horizon


class Contender(NamedTuple):
    """A solver with the settings to try."""

    family: str
    name: str
    knob: str
    ladder: tuple[float, ...]  # loose to tight
    build: Callable[[Scene, float], Solve]  # raises ImportError if the solver is not installed


def other_side_touches(y: Array, side: int) -> bool:
    """Whether the other side touches with this one: equal arms at rest reach the object at the same instant."""
    if side == LEFT:
        return bool(abs(y[X.O] - y[X.R]) < TOGETHER_M and y[V.O] > y[V.R])
    return bool(abs(y[X.L] - y[X.O]) < TOGETHER_M and y[V.L] > y[V.O])

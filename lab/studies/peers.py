"""What the outside peers have in common.

No outside peer knows the clamp surface u' = -1/p as an event: it would only cost time in the scenes that are
measured. Tried and not available as a wheel for these Python versions: numbalsoda.
"""

from __future__ import annotations

from grasp_ros.physics.layout import LEFT, V, X
from grasp_ros.physics.model import Array

TOGETHER_M = 1e-13  # a gap below this at the other side's touch is a touch of both


def other_side_touches(y: Array, side: int) -> bool:
    """Whether the other side touches with this one: equal arms at rest reach the object at the same instant."""
    if side == LEFT:
        return bool(abs(y[X.O] - y[X.R]) < TOGETHER_M and y[V.O] > y[V.R])
    return bool(abs(y[X.L] - y[X.O]) < TOGETHER_M and y[V.L] > y[V.O])

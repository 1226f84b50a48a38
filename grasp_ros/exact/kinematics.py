"""How an arm stands to the object: u and u', and what changes them while nothing pushes."""

from __future__ import annotations

from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.records import Array, Plant
from grasp_ros.physics.layout import (
    DAMPING,
    FORCE,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Body,
)


@kernel
def other(side: Body) -> Body:
    """The other side."""
    return RIGHT if side == LEFT else LEFT


@kernel
def arm_of(y: Array, side: Body) -> tuple[float, float, float]:
    """x and v of an arm, and the sign with which they enter u and u'."""
    return (y[X_L], y[V_L], 1.0) if side == LEFT else (y[X_R], y[V_R], -1.0)


@kernel
def rate_lanes(side: Body) -> tuple[int, int]:
    """Places of the two velocities whose difference is u', (8)."""
    return (V_L, V_O) if side == LEFT else (V_O, V_R)


@kernel
def approach(y: Array, side: Body) -> float:
    """u' of a pair, m/s."""
    front, back = rate_lanes(side)
    return y[front] - y[back]


@kernel
def write_penetrations(y: Array) -> None:
    """Write u of both pairs, (8), from the positions."""
    y[U_L] = y[X_L] - y[X_O]
    y[U_R] = y[X_O] - y[X_R]


@kernel
def own_acceleration(body: Array, x: float, v: float) -> float:
    """x'' of a body, m/s^2, without impact forces: (1) to (3)."""
    return (body[FORCE] - body[STIFFNESS] * x - body[DAMPING] * v) / body[MASS]


@inlined
def relative_motion(plant: Plant, y: Array, side: Body) -> tuple[float, float]:
    """u' and the u'' that both bodies would have without impact forces."""
    x, v, sign = arm_of(y, side)
    a = own_acceleration(plant.bodies[side], x, v)
    a_o = own_acceleration(plant.bodies[OBJECT], y[X_O], y[V_O])
    return approach(y, side), sign * (a - a_o)

"""Dry friction of the object: it slides against a constant force, or sticks and is a wall.

A sliding object has the friction in its constant force. A stuck one gets an infinite mass: whatever pushes it moves it
as little as a wall, in the same equations. Both are the row OBJECT of the bodies, see `rub`; the true mass and the
force without friction are kept beside it.
"""

import math
from typing import Any

import numpy as np

from grasp_ros.exact.jit import kernel
from grasp_ros.exact.modes import CONTACT, SLIP, STICK, record
from grasp_ros.exact.polynomial import first_rise
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZIAN,
    LANES,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    U_L,
    V_L,
    V_O,
    V_R,
    Z_L,
    Slide,
)

FREE, RIGHTWARD, LEFTWARD, STUCK = (np.int64(s) for s in Slide)  # typed, see `layout`
COULOMB, TRUE_MASS, PUSH = 0, 1, 2  # entries of `friction`: N, kg, and the force on the object without friction, N


@kernel
def rub(bodies: Any, friction: Any, mode: Any) -> None:
    """Put the mode of the object into its row of the bodies."""
    slide = mode[OBJECT]
    if slide == FREE:
        return
    bodies[OBJECT, MASS] = math.inf if slide == STUCK else friction[TRUE_MASS]
    against = -friction[COULOMB] if slide == RIGHTWARD else friction[COULOMB]
    bodies[OBJECT, FORCE] = 0.0 if slide == STUCK else friction[PUSH] + against


@kernel
def impact_on_object(pairs: Any, y: Any, mode: Any) -> float:
    """Sum of the impact forces on the object, (3)."""
    total = 0.0
    for side in (LEFT, RIGHT):
        if mode[side] == CONTACT:
            u = y[U_L + side]
            d = y[V_L] - y[V_O] if side == LEFT else y[V_O] - y[V_R]
            force = pairs[side, HERTZIAN] * u * math.sqrt(u) * (1.0 + pairs[side, DISSIPATION] * d)
            total += force if side == LEFT else -force
    return total


@kernel
def judge_slide(bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any) -> None:
    """Mode of the object from its state: at rest it sticks if friction can balance what pushes it."""
    if friction[COULOMB] == 0.0:
        return
    direction = y[V_O]
    if direction == 0.0:
        push = impact_on_object(pairs, y, mode) + friction[PUSH]
        direction = push if abs(push) > friction[COULOMB] else 0.0
    mode[OBJECT] = STUCK if direction == 0.0 else (RIGHTWARD if direction > 0.0 else LEFTWARD)
    rub(bodies, friction, mode)


@kernel
def flight_stop(bodies: Any, y: Any, mode: Any) -> float:
    """Time at which a sliding object stops in flight, inf if it does not: v' = a - c v is solved exactly."""
    if mode[OBJECT] == FREE or mode[OBJECT] == STUCK:
        return math.inf
    v = y[V_O]
    a, c = bodies[OBJECT, FORCE] / bodies[OBJECT, MASS], bodies[OBJECT, DAMPING] / bodies[OBJECT, MASS]
    if v == 0.0 or a == 0.0 or (a > 0.0) == (v > 0.0):
        return math.inf
    return -v / a if c == 0.0 else math.log1p(-c * v / a) / c


@kernel
def impact_series(tables: Any, pairs: Any, mode: Any, n: int, row: Any) -> None:
    """Write the series of the impact forces on the object, H w^3 (1 + p u'), up to the order n.

    The table of factors is free after the expansion and holds the series on the way.
    """
    f = tables.f
    w, e, square, cube = np.int64(0), n + 1, 2 * (n + 1), 3 * (n + 1)
    for k in range(n + 1):
        row[k] = 0.0
    for side in (LEFT, RIGHT):
        if mode[side] != CONTACT:
            continue
        front, back = (V_L, V_O) if side == LEFT else (V_O, V_R)
        for k in range(n + 1):
            f[w + k] = tables.c[LANES * k + Z_L + side]
            f[e + k] = pairs[side, DISSIPATION] * (tables.c[LANES * k + front] - tables.c[LANES * k + back])
        f[e] += 1.0
        product(f, w, w, square, n)
        product(f, square, w, cube, n)
        product(f, cube, e, square, n)
        hertzian = pairs[side, HERTZIAN] if side == LEFT else -pairs[side, HERTZIAN]
        for k in range(n + 1):
            row[k] += hertzian * f[square + k]


@kernel
def product(f: Any, a: int, b: int, out: int, n: int) -> None:
    """Cauchy product up to the order n of two series that begin at a and b in f."""
    for k in range(n + 1):
        total = 0.0
        for j in range(k + 1):
            total += f[a + j] * f[b + k - j]
        f[out + k] = total


@kernel
def contact_slide(tables: Any, pairs: Any, friction: Any, mode: Any, n: int, h: float, work: Any) -> Any:
    """First s in a Taylor step of length h at which the object stops or slips, and its next mode; inf if it does not.

    After a stop the next mode is left to `judge_slide`.
    """
    slide, row = mode[OBJECT], tables.row
    if slide != STUCK:
        factor = -1.0 if slide == RIGHTWARD else 1.0
        for k in range(n + 1):
            row[k] = factor * tables.c[LANES * k + V_O]
        return first_rise(row, n, h, 0.0, work), STUCK
    impact_series(tables, pairs, mode, n, row)
    push = row[0] + friction[PUSH]
    row[0] = push - friction[COULOMB]
    to_right = first_rise(row, n, h, 0.0, work)
    for k in range(1, n + 1):
        row[k] = -row[k]
    row[0] = -push - friction[COULOMB]
    to_left = first_rise(row, n, h, 0.0, work)
    if math.isnan(to_right) or math.isnan(to_left):
        return math.nan, STUCK
    return (to_right, RIGHTWARD) if to_right <= to_left else (to_left, LEFTWARD)


@kernel
def fire_slide(bodies: Any, pairs: Any, friction: Any, y: Any, mode: Any, following: int, now: float, events: Any,
               filled: Any) -> None:
    """Stop the object, or let it slip into the mode that follows; record which."""
    stopped = mode[OBJECT] != STUCK
    y[V_O] = 0.0
    if stopped:
        judge_slide(bodies, pairs, friction, y, mode)
    else:
        mode[OBJECT] = following
        rub(bodies, friction, mode)
    if stopped and mode[OBJECT] != STUCK:  # it turns without a rest
        return
    record(now, OBJECT, STICK if stopped else SLIP, 0.0, 0.0, events, filled)

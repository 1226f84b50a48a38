"""Positions, velocities and times as pairs of doubles: what a rounding leaves out stands in a low word.

A shallow penetration is a small difference of two large positions. With some 106 bits in each position the difference
has digits of its own, so that u is no state beside them: `write_penetrations` derives it. The low words also keep many
short steps from adding up their roundings.

Source: D. E. Knuth, The Art of Computer Programming, vol. 2, section 4.2.2, theorem B (two-sum).
"""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.records import Array, Flown, State
from grasp_ros.exact.tolerances import SHORT_WAY
from grasp_ros.physics.layout import LEFT, OBJECT, Body, U, V, X


@kernel
def two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b, rounded, and what the rounding leaves out."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


@kernel
def velocity_lane(body: Body) -> int:
    """Index of a body's velocity in the state; its position stands before it."""
    return V.O if body == OBJECT else (V.L if body == LEFT else V.R)


@inlined
def add(state: State, lane: int, change: float) -> None:
    """Add a change to a number of the state."""
    high, low = two_sum(state.y[lane], change)
    low += state.low[lane]
    state.y[lane] = high + low
    state.low[lane] = low - (state.y[lane] - high)


@kernel
def until(clock: Array, time: float) -> float:
    """Seconds from now to a time of an interval; its clock holds the time since its begin and the low word."""
    return (time - clock[0]) - clock[1]


@kernel
def tick(clock: Array, step: float) -> None:
    """Add a step in s to the clock, so that long runs do not drift."""
    clock[0], low = two_sum(clock[0], step)
    clock[1] += low


@inlined
def put(state: State, lane: int, value: float) -> None:
    """Set a number of the state, with the low word 0."""
    state.y[lane], state.low[lane] = value, 0.0


@inlined
def copy(state: State, lane: int, source: int) -> None:
    """Make a number of the state equal to another one."""
    state.y[lane], state.low[lane] = state.y[source], state.low[source]


@inlined
def move_in_flight(state: State, body: Body, flown: Flown) -> None:
    """Move a body on by a flight; of a long one only where it ends may be known."""
    v = velocity_lane(body)
    if math.isnan(flown.way):
        put(state, v - 1, flown.x)
    else:
        add(state, v - 1, flown.way)
    if math.isnan(flown.change):
        put(state, v, flown.v)
    else:
        add(state, v, flown.change)


@inlined
def move_arm_in_contact(state: State, side: Body, way_o: float, w: float, way_w: float) -> None:
    """Move an arm after the object has moved by `way_o` m; w = sqrt(u) at the end, `way_w` its change."""
    x, way, sign = velocity_lane(side) - 1, way_w * (2.0 * w - way_w), 1.0 if side == LEFT else -1.0
    if abs(way) <= SHORT_WAY * (w * w):
        add(state, x, way_o + sign * way)
    else:
        copy(state, x, X.O)
        add(state, x, sign * (w * w))


@inlined
def meet(state: State, side: Body) -> None:
    """Put an arm where the object is: u = 0."""
    copy(state, velocity_lane(side) - 1, X.O)
    state.y[U.L + side] = 0.0


@inlined
def keep_together(state: State, side: Body) -> None:
    """Arm and object move alike: what they differ by after a segment is rounding."""
    meet(state, side)
    copy(state, velocity_lane(side), V.O)


@inlined
def write_penetrations(state: State) -> None:
    """Derive u of both pairs, (8), from the positions."""
    y, low = state.y, state.low
    y[U.L] = (y[X.L] - y[X.O]) + (low[X.L] - low[X.O])
    y[U.R] = (y[X.O] - y[X.R]) + (low[X.O] - low[X.R])

"""Tangents of what acts on the bodies: numbers of the scene, held commands on their way, external forces, friction."""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.driver.intervals import feedback
from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Of, Slide
from grasp_ros.sensitivity.tangents import Tangents


@kernel
def act(t: Tangents) -> None:
    """Write how the directions change what acts on the bodies in a segment."""
    for body in (LEFT, RIGHT, OBJECT):
        for j in range(t.force.shape[1]):
            for column in range(3):
                t.acting[body, column, j] = t.given[body, column, j]
            t.acting[body, Of.FORCE, j] = t.given[body, Of.FORCE, j] + t.force[body, j]
    slide = t.mode[OBJECT]
    if slide in (Slide.RIGHTWARD, Slide.LEFTWARD):
        against = -1.0 if slide == Slide.RIGHTWARD else 1.0
        for j in range(t.force.shape[1]):
            t.acting[OBJECT, Of.FORCE, j] += against * t.coulomb[j]


@kernel
def answer(t: Tangents, side: Body, tick: int, j: int) -> tuple[float, bool]:
    """Derivative of what a sampled controller answers to the state of a tick, N by the unit of a direction.

    Beyond its limit an actuator hands on nothing of the state. Just at it one-sided derivatives differ: the second
    answer.
    """
    row, rates, lane = t.control[side], t.control_rates[side], velocity_lane(side)
    first, second = t.normals[min(tick, t.normals.shape[0] - 1), side]
    x = t.before[lane - 1] + row[Column.POSITION_NOISE] * first
    v = t.before[lane] + row[Column.VELOCITY_NOISE] * second
    force = feedback(row, x, v)
    limited = math.copysign(1.0, force) * rates[Column.LIMIT, j] if force != 0.0 else 0.0
    if abs(force) > row[Column.LIMIT] or row[Column.LIMIT] == 0.0:
        return limited, False
    away = t.x[lane - 1, j] + rates[Column.POSITION_NOISE, j] * first - rates[Column.SET_POINT, j]
    faster = t.x[lane, j] + rates[Column.VELOCITY_NOISE, j] * second
    free = (rates[Column.FEED_FORWARD, j] - row[Column.POSITION_GAIN] * away - row[Column.VELOCITY_GAIN] * faster
            - rates[Column.POSITION_GAIN, j] * (x - row[Column.SET_POINT]) - rates[Column.VELOCITY_GAIN, j] * v)
    return free, abs(force) == row[Column.LIMIT] and free != limited


@kernel
def enter_tick(t: Tangents, tick: int) -> bool:
    """Let the inputs of a control period act, answers that arrive and external forces; whether one is at its limit."""
    corner, delay = False, t.waiting.shape[0]
    slot = tick % delay if delay > 0 else 0
    for body in (LEFT, RIGHT, OBJECT):
        for j in range(t.force.shape[1]):
            force, edge = answer(t, body, tick, j) if body != OBJECT else (0.0, False)
            corner = corner or edge
            if delay > 0 and body != OBJECT:
                force, t.waiting[slot, body, j] = t.waiting[slot, body, j], force
            if tick < t.external.shape[0]:
                force += t.external[tick, body, j]
            t.force[body, j] = force
    return corner

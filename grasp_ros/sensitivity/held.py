"""Tangents of what acts on the bodies: numbers of the scene, held commands on their way, external forces, friction."""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.driver.intervals import feedback
from grasp_ros.exact.records import Array, Integers
from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Of, Slide
from grasp_ros.sensitivity.tangents import Inputs, TangentRates


@kernel
def act(mode: Integers, rates: TangentRates, inputs: Inputs) -> None:
    """Write how the directions change what acts on the bodies in a segment."""
    for body in (LEFT, RIGHT, OBJECT):
        for j in range(inputs.force.shape[1]):
            for column in range(3):
                rates.acting[body, column, j] = inputs.given[body, column, j]
            rates.acting[body, Of.FORCE, j] = inputs.given[body, Of.FORCE, j] + inputs.force[body, j]
    slide = mode[OBJECT]
    if slide in (Slide.RIGHTWARD, Slide.LEFTWARD):
        against = -1.0 if slide == Slide.RIGHTWARD else 1.0
        for j in range(inputs.force.shape[1]):
            rates.acting[OBJECT, Of.FORCE, j] += against * inputs.coulomb[j]


@kernel
def answer(inputs: Inputs, before: Array, moved: Array, side: Body, tick: int, j: int) -> tuple[float, bool]:
    """Derivative of what a sampled controller answers to the state of a tick, N by the unit of a direction.

    Beyond its limit an actuator hands on nothing of the state. Just at it one-sided derivatives differ: the second
    answer.
    """
    row, rates, lane = inputs.control[side], inputs.control_rates[side], velocity_lane(side)
    first, second = inputs.normals[min(tick, inputs.normals.shape[0] - 1), side]
    x = before[lane - 1] + row[Column.POSITION_NOISE] * first
    v = before[lane] + row[Column.VELOCITY_NOISE] * second
    force = feedback(row, x, v)
    limited = math.copysign(1.0, force) * rates[Column.LIMIT, j] if force != 0.0 else 0.0
    if abs(force) > row[Column.LIMIT] or row[Column.LIMIT] == 0.0:
        return limited, False
    away = moved[lane - 1, j] + rates[Column.POSITION_NOISE, j] * first - rates[Column.SET_POINT, j]
    faster = moved[lane, j] + rates[Column.VELOCITY_NOISE, j] * second
    free = (rates[Column.FEED_FORWARD, j] - row[Column.POSITION_GAIN] * away - row[Column.VELOCITY_GAIN] * faster
            - rates[Column.POSITION_GAIN, j] * (x - row[Column.SET_POINT]) - rates[Column.VELOCITY_GAIN, j] * v)
    return free, abs(force) == row[Column.LIMIT] and free != limited


@kernel
def enter_tick(inputs: Inputs, before: Array, moved: Array, tick: int) -> bool:
    """Let the inputs of a control period act, answers that arrive and external forces; whether one is at its limit."""
    corner, delay = False, inputs.waiting.shape[0]
    slot = tick % delay if delay > 0 else 0
    for body in (LEFT, RIGHT, OBJECT):
        for j in range(inputs.force.shape[1]):
            force, edge = answer(inputs, before, moved, body, tick, j) if body != OBJECT else (0.0, False)
            corner = corner or edge
            if delay > 0 and body != OBJECT:
                force, inputs.waiting[slot, body, j] = inputs.waiting[slot, body, j], force
            if tick < inputs.external.shape[0]:
                force += inputs.external[tick, body, j]
            inputs.force[body, j] = force
    return corner

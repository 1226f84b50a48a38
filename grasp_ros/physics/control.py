"""The law of one controller: from the state of its arm to its command.

A law is a row of numbers, `Column`, and three functions of it: what is measured, what the paper's feedback (4), (5)
answers, and what the actuator makes of that. Every effect of a scene fills in its columns; those that none has named
do nothing. `exact.driver.intervals` compiles the same source for the kernels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import plain
from grasp_ros.physics.layout import BLOCK
from grasp_ros.physics.model import Array

Law = Callable[..., float]  # tick, time in s, measured x in m and v in m/s, what it observes, see `observation`, to N
FIXED = "allowed: the scene's own number; with a controller of the user's it is fixed for the run"
NO_NOISE = np.zeros(2)
WHOLE = 2.0**53  # from here on every number is a whole one


class Column(IntEnum):
    """Columns of a law."""

    POSITION_GAIN = 0  # Kp, N/m
    VELOCITY_GAIN = 1  # Kv, N s/m
    SET_POINT = 2  # m
    FEED_FORWARD = 3  # N
    POSITION_NOISE = 4  # standard deviation of the measured position, m
    VELOCITY_NOISE = 5  # m/s
    POSITION_STEP = 6  # resolution of the measured position, m; 0: measured exactly
    VELOCITY_STEP = 7  # m/s
    LIMIT = 8  # largest force of the actuator, N; inf: none
    PERIOD = 9  # control periods from an answer to the next one, a whole number


def is_due(row: Any, tick: int) -> bool:
    """Whether the controller answers the state of a tick; after any other it repeats its last command."""
    period = row[Column.PERIOD]
    return bool(period == 1.0 or tick % period == 0.0)  # the first for speed


def measured(row: Any, normals: Any, x: float, v: float) -> tuple[float, float]:
    """What the sensor makes of x and v: noise, from two standard normal numbers, then the nearest step.

    A number whose own rounding is wider than the step stays as it is.
    """
    noise_x, noise_v = row[Column.POSITION_NOISE], row[Column.VELOCITY_NOISE]
    step_x, step_v = row[Column.POSITION_STEP], row[Column.VELOCITY_STEP]
    if noise_x != 0.0 or noise_v != 0.0:
        x, v = x + noise_x * normals[0], v + noise_v * normals[1]
    if step_x != 0.0 and abs(x / step_x) < WHOLE:  # neither infinity nor NaN is
        x = step_x * round(x / step_x)
    if step_v != 0.0 and abs(v / step_v) < WHOLE:
        v = step_v * round(v / step_v)
    return x, v


def feedback(row: Any, x: Any, v: Any) -> Any:
    """Linear state feedback around a set-point, (4), (5), in N; of floats or arrays."""
    force = -row[Column.POSITION_GAIN] * (x - row[Column.SET_POINT]) - row[Column.VELOCITY_GAIN] * v
    if row[Column.FEED_FORWARD] != 0.0:  # adding 0.0 would turn a command of -0.0 into another bit pattern
        force = force + row[Column.FEED_FORWARD]
    return force


def command_of(answer: object, who: str, tick: int, time: float) -> float:
    """The command in N that a user controller has answered with.

    A value that is no finite number is refused; `who` begins the message.
    """
    found = plain(answer)
    try:
        force = math.nan if found is None else float(found)
    except OverflowError:
        force = answer = math.inf if answer > 0 else -math.inf  # type: ignore[operator]  # too long to be printed
    if not math.isfinite(force):
        raise Refused(f"{who}: it returned {answer!r} at tick {tick}, t = {time!r} s; allowed: a finite number of N")
    return force


def limited(row: Any, force: float) -> Any:
    """What the actuator can do of a command in N."""
    limit = row[Column.LIMIT]
    if force < -limit:
        return -limit
    return limit if force > limit else force


@lru_cache(maxsize=64)
def normals(seed: int, side: int, block: int) -> Array:
    """Standard normal numbers (BLOCK, 2) of one block of ticks: the same in whatever order they are drawn."""
    return np.random.default_rng([seed, side, block]).standard_normal((BLOCK, 2))


class ControlLaw:
    """Linear state feedback around a set-point, with the sensor and the actuator of its arm.

    `row` holds all of its numbers, see `Column`; `seed`, (seed, side), is that of its noise; None: no noise.
    """

    def __init__(self, position_gain: float = 0.0, velocity_gain: float = 0.0) -> None:
        self.row: Array = np.zeros(len(Column))
        self.row[: Column.SET_POINT] = position_gain, velocity_gain
        self.row[Column.LIMIT], self.row[Column.PERIOD] = np.inf, 1.0
        self.seed: tuple[int, int] | None = None

    def noise(self, tick: int) -> Array:
        """Standard normal numbers (2,) of a tick; 0 without noise."""
        return NO_NOISE if self.seed is None else normals(*self.seed, tick // BLOCK)[tick % BLOCK]

    def measured(self, tick: int, x: float, v: float) -> tuple[float, float]:
        """What its sensor makes of the state (x, v) of a tick."""
        return measured(self.row.tolist(), self.noise(tick).tolist(), x, v)  # plain floats overflow without a warning

    def command(self, tick: int, x: Any, v: Any) -> Any:
        """Command in N that answers the state (x, v) of a tick, in the arithmetic of x and v."""
        row = self.row.tolist()  # once: this is called at every tick of a graph
        if any(row[Column.POSITION_NOISE : Column.LIMIT]):
            x, v = measured(row, self.noise(tick).tolist(), x, v)
        return limited(row, feedback(row, x, v))


def normals_of(laws: Mapping[int, ControlLaw], first: int, count: int) -> Array:
    """Standard normal numbers (2, count, 2) of the ticks from the first on, by side; 0 without noise."""
    found, blocks = np.zeros((2, count, 2)), range(first // BLOCK, (first + count - 1) // BLOCK + 1)
    for side, law in laws.items():
        if law.seed is not None:
            found[side] = np.concatenate([normals(*law.seed, block) for block in blocks])[first % BLOCK :][:count]
    return found

"""Control periods and output times, and what went through a sampled loop at them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS


def tick_times(scene: Scene) -> Array:
    """Times in s of all control periods of a scene, shape (ticks + 1,)."""
    return np.arange(scene.ticks + 1) * scene.period_ns / NANOSECONDS


def tick_of(scene: Scene, t: Array) -> NDArray[np.int64]:
    """The last tick at or before each time in s, shape (n,)."""
    ticks = np.floor(np.asarray(t) * (NANOSECONDS / scene.period_ns)).astype(np.int64)  # rounding may miss it by one
    ticks -= ticks * scene.period_ns / NANOSECONDS > t
    ticks += (ticks + 1) * scene.period_ns / NANOSECONDS <= t
    return np.minimum(ticks, scene.ticks)


class LoopRecord(NamedTuple):
    """What went through a sampled loop, at n output times; see `Trajectory.command` and `Trajectory.inputs`."""

    command: Array  # (n, 2), N
    inputs: Array  # (n, 3), N by body


def new_loop(n: int) -> LoopRecord:
    """A record of n output times, to be filled."""
    return LoopRecord(np.empty((n, 2)), np.full((n, 3), np.nan))

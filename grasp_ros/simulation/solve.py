"""One scene through one method: what `simulate` does and `repeat` does again, without a word about the result."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

from grasp_ros.exact.driver.user_controller import Foreign
from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.closed_loop import Changes, Progress, SampledLoop, drive_external
from grasp_ros.simulation.ticks import Loop


class How(NamedTuple):
    """How a scene is integrated."""

    method: str
    setting: float
    sampled: bool
    max_events: int = MAX_EVENTS
    max_work: int = MAX_WORK


def solve(
    scene: Scene, grid: Array, how: How, changes: Changes = MappingProxyType({}),
    foreign: Mapping[int, Foreign] = MappingProxyType({}), progress: Progress = None,
) -> tuple[Solution, Loop | None]:
    """States at ascending output times (n,), events and counters, and what went through a sampled loop.

    All arguments have been checked. Columns of bodies that are not there are NaN.
    """
    loop = SampledLoop(scene, grid, changes, progress, foreign) if how.sampled else None
    drive = loop.drive if loop else partial(drive_external, scene, grid) if scene.system.external else None
    problem = Problem(scene.system, scene.duration, grid, how.setting, how.max_events, how.max_work, how.sampled, drive,
                      None if loop else progress)
    found = METHODS[how.method].solve(problem)
    found.state[:, scene.system.absent_columns] = float("nan")
    return found, None if loop is None else loop.record()

"""One scene through one method: what `simulate` does and `repeat` does again, without a word about the result."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

from grasp_ros.exact.driver.user_controller import Foreign
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.closed_loop import Changes, Progress, drive_external, drive_sampled
from grasp_ros.simulation.ticks import Loop, new_loop


class How(NamedTuple):
    """How a scene is integrated."""

    method: str
    setting: float
    sampled: bool
    max_events: int
    max_work: int


def solve(
    scene: Scene, grid: Array, how: How, changes: Changes = MappingProxyType({}),
    foreign: Mapping[int, Foreign] = MappingProxyType({}), progress: Progress = None,
) -> tuple[Solution, Loop | None]:
    """States at ascending output times (n,), events and counters, and what went through a sampled loop.

    All arguments have been checked. Columns of bodies that are not there are NaN.
    """
    loop, drive = new_loop(len(grid)) if how.sampled else None, None
    if loop is not None:
        drive = partial(drive_sampled, scene, grid, loop, changes, foreign, progress)
    elif scene.system.external:
        drive = partial(drive_external, scene, grid)
    problem = Problem(scene.system, scene.duration, grid, how.setting, how.max_events, how.max_work, how.sampled, drive,
                      None if how.sampled else progress)
    found = METHODS[how.method].solve(problem)
    found.state[:, scene.system.absent_columns] = float("nan")
    return found, None if loop is None else Loop(*(rows[: len(found.state)] for rows in loop))

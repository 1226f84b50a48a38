"""Runs in pieces: commands and external forces that are held from tick to tick."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.control import DelayLine
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS

Progress = Callable[[float], object] | None
Changes = Mapping[int, Mapping[str, float]]


def check_changes(scene: Scene, held: bool, changes: Changes) -> None:
    """Refuse changes that a running graph would refuse.

    Raises
    ------
    Refused
        Names the first of them.
    """
    if not changes:
        return
    if not held:
        raise Refused("changes: not allowed under continuous feedback; allowed: sampled=True")
    live = scene.live
    for tick, numbers in changes.items():
        for name in numbers:
            if name not in live or not 0 <= tick <= scene.ticks:
                raise Refused(f"changes: {name} at tick {tick}; allowed: {', '.join(live)} at 0 to {scene.ticks}")


def tick_times(scene: Scene) -> Array:
    """Times in s of all control periods of a scene, shape (ticks + 1,)."""
    return np.arange(scene.ticks + 1) * scene.period_ns / NANOSECONDS


def continuous_run(scene: Scene, integrator: Integrator, grid: Array) -> Array:
    """States (n, 6) under continuous feedback and external forces."""
    system = scene.system
    if not system.external:
        return integrator.advance(scene.duration, grid)
    changes = {tick for force in system.external for tick in force.changes(scene.ticks)}
    return _piecewise(scene, integrator, grid, sorted({0, *changes, scene.ticks}), system.external_at)


def sampled_run(
    scene: Scene, integrator: Integrator, grid: Array, changes: Changes, progress: Progress
) -> tuple[Array, Array]:
    """States (n, 6), and the commands (n, 2) that the controllers gave last."""
    system = scene.system
    line = DelayLine(system.delay)
    commands = np.empty((scene.ticks + 1, 2))

    def forces(tick: int) -> Array:
        nonlocal scene, system
        if tick in changes:
            scene = scene.changed(changes[tick])
            system = scene.system
        answers = system.commands(tick, integrator.state)
        commands[tick] = answers[LEFT], answers[RIGHT]
        if progress is not None and tick % 100 == 0:
            progress(scene.time_of(tick))
        acting: Array = line.pass_on(answers) + system.external_at(tick)
        return acting

    with np.errstate(over="ignore", invalid="ignore"):  # a state that overflows ends the run with its status
        states = _piecewise(scene, integrator, grid, range(scene.ticks + 1), forces)
        if integrator.status is Status.DONE:
            forces(scene.ticks)
    latest = np.searchsorted(tick_times(scene), grid[: len(states)], side="right") - 1
    return states, commands[latest]


def _piecewise(scene: Scene, integrator: Integrator, grid: Array, ticks: Sequence[int],
               forces: Callable[[int], Array]) -> Array:
    """Integrate from tick to tick under forces (3,) that are held; each piece [t, t') delivers its own outputs."""
    ends = np.asarray(ticks) * scene.period_ns / NANOSECONDS
    lengths = np.diff(ticks) * scene.period_ns / NANOSECONDS
    bounds = np.searchsorted(grid, ends, side="left")
    last = bounds[-1]
    piece_of = np.searchsorted(ends, grid[:last], side="right") - 1
    offsets = np.clip(grid[:last] - ends[piece_of], 0.0, lengths[piece_of])
    rows = [np.empty((0, 6))]
    pieces = zip(ticks, ends.tolist(), lengths.tolist(), pairwise(bounds.tolist()), strict=False)
    for tick, begin, length, (first, end) in pieces:
        integrator.set_input(forces(tick))
        rows.append(integrator.advance(length, offsets[first:end], begin))
        if integrator.status is not Status.DONE:
            return np.concatenate(rows)
    rows.append(np.repeat(integrator.state[None], len(grid) - last, axis=0))
    return np.concatenate(rows)

"""What closes the loop around `exact`: sampled controllers, and external forces under continuous feedback."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from heapq import merge
from itertools import groupby, islice, pairwise

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation.sampled_plant import SampledPlant
from grasp_ros.simulation.trajectory import Loop, tick_of

Progress = Callable[[float], object] | None
Changes = Mapping[int, Mapping[str, float]]
BLOCK = 4096  # intervals whose output times are found at once


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


class SampledLoop:
    """Controllers that answer at every tick, around a plant.

    Parameters
    ----------
    scene : Scene
    grid : array (n,), s
        Ascending output times within the horizon.
    changes : mapping of int to mapping of str to float
        Numbers of the controllers that are set while it runs, by the tick from which they act.
    progress : callable or None
        Called with the time reached, in s.
    """

    def __init__(self, scene: Scene, grid: Array, changes: Changes, progress: Progress) -> None:
        self._scene, self._grid, self._changes, self._progress = scene, grid, changes, progress
        self._laws = scene.system
        self._answers: list[Array] = []  # (3,) for each tick
        self._inputs: list[Array] = []

    def drive(self, integrator: Integrator) -> Array:
        """States (n, 6) at the output times; only the rows reached, if the integrator stops. To be called once."""
        scene = self._scene
        plant = SampledPlant(scene.system, scene.period_ns, integrator)
        rows = []
        with np.errstate(over="ignore", invalid="ignore"):  # a state that overflows ends the run with its status
            for _, _, within in _intervals(self._grid, range(scene.ticks + 1), scene.period_ns):
                rows.append(plant.step(self._answer(plant), within))
                self._inputs.append(plant.inputs)
                if plant.status is not Status.DONE:
                    return np.concatenate(rows)
            self._answer(plant)
            self._inputs.append(np.full(3, np.nan))  # nothing has acted yet
        return np.concatenate([*rows, _rest(self._grid, scene.ticks, scene.period_ns, plant.state)])

    def _answer(self, plant: SampledPlant) -> Array:
        """Commands (3,) in N by body, from the laws as they are now."""
        tick = plant.tick
        if tick in self._changes:
            self._scene = self._scene.changed(self._changes[tick])
            self._laws = self._scene.system
        answers = self._laws.commands(tick, plant.state)
        self._answers.append(answers)
        if self._progress is not None and tick % 100 == 0:
            self._progress(plant.time)
        return answers

    def record(self, rows: int) -> Loop:
        """What was answered and what acted, at the first output times."""
        ticks = tick_of(self._scene, self._grid[:rows])
        return Loop(np.array(self._answers)[ticks][:, [LEFT, RIGHT]], np.array(self._inputs)[ticks])


def drive_external(scene: Scene, grid: Array, integrator: Integrator) -> Array:
    """States (n, 6) under continuous feedback and external forces; only the rows reached, if the integrator stops.

    An interval lasts until a force changes: cutting it at every tick would only cost time.
    """
    system = scene.system
    changes = (force.changes(scene.ticks) for force in system.external)
    ticks = (tick for tick, _ in groupby(merge([0], *changes, [scene.ticks])))
    rows = []
    for begin, end, within in _intervals(grid, ticks, scene.period_ns):
        integrator.set_input(system.external_at(begin))
        rows.append(integrator.advance((end - begin) * scene.period_ns / NANOSECONDS, within, scene.time_of(begin)))
        if integrator.status is not Status.DONE:
            return np.concatenate(rows)
    return np.concatenate([*rows, _rest(grid, scene.ticks, scene.period_ns, integrator.state)])


def _intervals(grid: Array, ticks: Iterable[int], period_ns: int) -> Iterator[tuple[int, int, Array | None]]:
    """Intervals [t, t') between ascending ticks, and the output times in each from its beginning; None without any.

    The ticks of a run may be more than memory holds: they are taken in blocks.
    """
    following = iter(ticks)
    block = list(islice(following, BLOCK))
    while len(block) > 1:
        times = np.asarray(block) * period_ns / NANOSECONDS
        lengths = np.diff(block) * period_ns / NANOSECONDS
        bounds = np.searchsorted(grid, times, side="left")
        first, last = int(bounds[0]), int(bounds[-1])
        interval = np.searchsorted(times, grid[first:last], side="right") - 1
        offsets = np.clip(grid[first:last] - times[interval], 0.0, lengths[interval])
        for (begin, end), (low, high) in zip(pairwise(block), pairwise((bounds - first).tolist()), strict=True):
            yield begin, end, offsets[low:high] if low < high else None
        block = [block[-1], *islice(following, BLOCK)]


def _rest(grid: Array, tick: int, period_ns: int, state: Array) -> Array:
    """The state (n, 6) at the output times of the last tick and later."""
    later = len(grid) - int(np.searchsorted(grid, tick * period_ns / NANOSECONDS, side="left"))
    return np.repeat(state[None], later, axis=0)

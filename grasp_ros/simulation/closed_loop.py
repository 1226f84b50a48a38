"""What closes the loop around `exact`: sampled controllers, and external forces under continuous feedback."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from heapq import merge
from itertools import groupby, islice

import numpy as np
from numpy.typing import NDArray

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Loop as KernelLoop
from grasp_ros.exact.records import new_place
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import BLOCK, LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation.sampled_plant import NO_INTERVAL, Outputs, Record, SampledPlant
from grasp_ros.simulation.trajectory import Loop

Progress = Callable[[float], object] | None
PATIENCE = 0.1  # s that a block of ticks may take
SHORTEST = 16  # ticks of the first block
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
        self._records: list[Record] = []  # at the output times

    def drive(self, integrator: Integrator) -> Array:
        """States (n, 6) at the output times; only the rows reached, if the integrator stops. To be called once."""
        scene = self._scene
        plant = SampledPlant(scene.system, scene.period_ns, integrator)
        for ticks in self._blocks():
            if plant.tick in self._changes:
                self._scene = self._scene.changed(self._changes[plant.tick])
            outputs, interval = _outputs(self._grid, ticks, scene.period_ns)
            record = plant.run(self._scene.system.laws, outputs)
            reached = interval[: len(record.states)]
            self._records.append(Record(record.states, record.answers[reached], record.inputs[reached]))
            if plant.status is not Status.DONE:
                break
            if self._progress is not None:
                self._progress(plant.time)
        else:
            self._end(plant)
        return np.concatenate([record.states for record in self._records])

    def _blocks(self) -> Iterator[NDArray[np.int64]]:
        """Ticks of the run, ascending, in blocks that end where a law changes, and with the block of the noise.

        Between them the progress shows and Ctrl-C acts: a run whose ticks are slow has shorter ones.
        """
        last, first, size = self._scene.ticks, 0, SHORTEST
        changes = sorted({*self._changes, last})
        while first < last:
            end = min(first + size, first - first % BLOCK + BLOCK, changes[bisect_right(changes, first)])
            begin = time.monotonic()
            yield np.arange(first, end + 1)
            first = end
            size = min(2 * size, BLOCK) if time.monotonic() - begin < PATIENCE else max(size // 2, 1)

    def _end(self, plant: SampledPlant) -> None:
        """The output times of the last tick and later; nothing acts there."""
        if plant.tick in self._changes:
            self._scene = self._scene.changed(self._changes[plant.tick])
        record = plant.run(self._scene.system.laws, NO_INTERVAL)
        states = _rest(self._grid, plant.tick, self._scene.period_ns, plant.state)
        shape = (len(states), 3)
        self._records.append(Record(states, np.broadcast_to(record.answers, shape), np.full(shape, np.nan)))

    def record(self) -> Loop:
        """What was answered and what acted, at the output times that were reached."""
        answers, inputs = (np.concatenate([record[part] for record in self._records]) for part in (1, 2))
        return Loop(answers[:, [LEFT, RIGHT]], inputs)


def drive_external(scene: Scene, grid: Array, integrator: Integrator) -> Array:
    """States (n, 6) under continuous feedback and external forces; only the rows reached, if the integrator stops.

    An interval lasts until a force changes: cutting it at every tick would only cost time. The ticks of a run may be
    more than memory holds: they are taken in blocks.
    """
    system = scene.system
    changes = (force.changes(scene.ticks) for force in system.external)
    following = (tick for tick, _ in groupby(merge([0], *changes, [scene.ticks])))
    rows, block = [], list(islice(following, BLOCK + 1))
    while len(block) > 1:
        ticks = np.array(block)
        outputs, _ = _outputs(grid, ticks, scene.period_ns)
        loop = KernelLoop(
            np.diff(ticks) * scene.period_ns / NANOSECONDS, ticks * scene.period_ns / NANOSECONDS, outputs.bounds,
            new_place(), np.empty((len(ticks) - 1, 3)), system.external_over(ticks[:-1]),
        )
        rows.append(integrator.run(loop, outputs.offsets))
        if integrator.status is not Status.DONE:
            return np.concatenate(rows)
        block = [block[-1], *islice(following, BLOCK)]
    return np.concatenate([*rows, _rest(grid, scene.ticks, scene.period_ns, integrator.state)])


def _outputs(grid: Array, ticks: NDArray[np.int64], period_ns: int) -> tuple[Outputs, NDArray[np.int64]]:
    """Output times within the intervals [t, t') between ascending ticks, and the interval of each."""
    times = ticks * period_ns / NANOSECONDS
    bounds = np.searchsorted(grid, times, side="left")
    within = grid[bounds[0] : bounds[-1]]
    interval = np.searchsorted(times, within, side="right") - 1
    lengths = np.diff(ticks) * period_ns / NANOSECONDS
    offsets = np.clip(within - times[interval], 0.0, lengths[interval])
    return Outputs(offsets, bounds - bounds[0]), interval


def _rest(grid: Array, tick: int, period_ns: int, state: Array) -> Array:
    """The state (n, 6) at the output times of the last tick and later."""
    later = len(grid) - int(np.searchsorted(grid, tick * period_ns / NANOSECONDS, side="left"))
    return np.repeat(state[None], later, axis=0)

"""One scene through one method, and what closes the loop around `exact`: sampled controllers and external forces."""

from __future__ import annotations

import time
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from heapq import merge
from itertools import groupby, islice
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from grasp_ros.exact.driver.user_controller import UserController
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Loop, new_cursor, one_interval
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.control import FIXED, Column, ControlLaw, Law
from grasp_ros.physics.domain import LARGEST_POSITION, LARGEST_SPEED
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import mapping, names, plain
from grasp_ros.physics.layout import OBJECT, Entry, Of
from grasp_ros.physics.model import Array
from grasp_ros.physics.observation import check
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.own_law import begin
from grasp_ros.simulation.sampled_plant import LoopRecord, Outputs, SampledPlant

PATIENCE = 0.1  # s that a block of ticks may take
SHORTEST, LONGEST = 16, 8192  # ticks of the first block, and of any
Changes = Mapping[int, Mapping[str, float]]
NO_CHANGES: Changes = MappingProxyType({})
NO_USER_CONTROLLERS: Mapping[int, UserController] = MappingProxyType({})


def wrap_controllers(scene: Scene, controllers: Mapping[str, Law | type]) -> dict[int, UserController]:
    """Controllers from outside by side, as the kernels call them, at the beginning of a run."""
    found: dict[int, UserController] = {}
    if not controllers:  # most runs are without: for speed
        return found
    arms = [side for side, body in SIDES.items() if scene.system.bodies[body, Of.MASS] > 0.0]
    for side, law in controllers.items():
        if side not in arms:
            allowed = " or ".join(arms) or "none, without an arm"
            raise Refused(f"controllers: {side!r} is not allowed; allowed: {allowed}")
        own = found[int(SIDES[side])] = UserController(side, begin(law, f"controllers: {side}"))
        check(own.asks, scene.system, SIDES[side], f"controllers: {side}")
    return found


def check_changes(scene: Scene, held: bool, changes: Changes, by_user: Iterable[str] = ()) -> None:
    """Refuse changes that a running graph would refuse."""
    if not changes:
        return
    if not held:
        raise Refused("changes: not allowed under continuous feedback; allowed: sampled=True")
    live, replaced = scene.live, scene.numbers_of(*(f"{side}_controller" for side in by_user))
    for tick, numbers in changes.items():
        at, where = plain(tick), f"changes: at tick {tick!r}"
        if at is None or not (0 <= at <= scene.ticks and at == int(at)):
            raise Refused(f"{where} is not allowed; allowed: 0 to {scene.ticks}")
        for name in names(where, [*mapping(where, numbers)]):
            if name in replaced:
                raise Refused(f"changes: {name} at tick {tick!r}: {FIXED}")
            if name not in live:
                raise Refused(f"changes: {name} at tick {tick!r}; allowed: {', '.join(live)}")


def drive_sampled(
    scene: Scene, integrator: Integrator, grid: Array, changes: Changes = NO_CHANGES,
    by_user: Mapping[int, UserController] = NO_USER_CONTROLLERS,
) -> tuple[Array, LoopRecord]:
    """States (n, 6) under controllers that answer at every tick, and what went through the loop.

    Only the rows reached, if the integrator stops. `changes` are numbers of the controllers that are set while it runs,
    by the tick from which they act.
    """
    plant, n, done = SampledPlant(scene.system, scene.period_ns, integrator), len(grid), 0
    states, command, inputs = np.empty((n, 6)), np.empty((n, 2)), np.full((n, 3), np.nan)
    for ticks in _blocks(scene.ticks, changes):
        if plant.tick in changes:
            scene = scene.changed(changes[plant.tick])
        # a user's controller has the sensor and the actuator of the scene
        laws = {**{side: ControlLaw() for side in by_user}, **scene.system.laws}
        outputs = outputs_within(scene, grid, ticks)
        record = plant.run(laws, outputs, by_user, states[done : done + len(outputs.offsets)])
        if len(ticks) == 1:  # the output times of the last tick and later: nothing acts there
            states[done:], command[done:], done = plant.state, record.answers[0, :OBJECT], n
            break
        interval = outputs.interval[: len(record.states)]
        rows = slice(done, done + len(interval))
        command[rows], inputs[rows] = record.answers[interval, :OBJECT], record.inputs[interval]
        done = rows.stop
        if plant.status is not Status.DONE:
            break
        if integrator.progress is not None:
            integrator.progress(plant.time)
    return states[:done], LoopRecord(command[:done], inputs[:done])


def _blocks(last: int, changes: Changes) -> Iterator[NDArray[np.int64]]:
    """Ticks of a run, ascending, in blocks that end where a law changes, and the last one alone.

    Between them the progress shows and Ctrl-C acts: a run whose ticks are slow has shorter ones.
    """
    first, size, ends = 0, SHORTEST, sorted({*changes, last})
    while first < last:
        end = min(first + size, ends[bisect_right(ends, first)])
        begin = time.monotonic()
        yield np.arange(first, end + 1)
        first = end
        size = min(4 * size, LONGEST) if time.monotonic() - begin < PATIENCE else max(size // 4, 1)
    yield np.array([last])


def drive_external(scene: Scene, integrator: Integrator, grid: Array) -> Array:
    """States (n, 6) under continuous feedback and external forces; only the rows reached, if the integrator stops.

    An interval lasts until a force changes: cutting it at every tick would only cost time. The ticks of a run may be
    more than memory holds: they are taken in blocks.
    """
    system = scene.system
    changes = (force.changes(scene.ticks) for force in system.external)
    following = (tick for tick, _ in groupby(merge([0], *changes, [scene.ticks])))
    rows, block = [], list(islice(following, LONGEST + 1))
    while len(block) > 1:
        ticks = np.array(block)
        outputs = outputs_within(scene, grid, ticks)
        loop = Loop(scene.time_of(np.diff(ticks)), scene.time_of(ticks), outputs.bounds, new_cursor(),
                    np.empty((len(ticks) - 1, 3)), system.external_over(ticks[:-1]))
        rows.append(integrator.run(loop, outputs.offsets))
        if integrator.status is not Status.DONE:
            return np.concatenate(rows)
        block = [block[-1], *islice(following, LONGEST)]
    later = len(grid) - sum(map(len, rows))  # the output times of the last tick and later
    return np.concatenate([*rows, np.repeat(integrator.state[None], later, axis=0)])


def outputs_within(scene: Scene, grid: Array, ticks: NDArray[np.int64]) -> Outputs:
    """Output times within the intervals [t, t') between ascending ticks."""
    times, lengths = scene.time_of(ticks), scene.time_of(ticks[1:] - ticks[:-1])
    bounds = np.searchsorted(grid, times, side="left")
    outputs = Outputs(grid[bounds[0] : bounds[-1]], bounds - bounds[0])
    interval = outputs.interval
    return outputs._replace(offsets=np.clip(outputs.offsets - times[interval], 0.0, lengths[interval]))


def drive(scene: Scene, integrator: Integrator, sampled: bool, grid: Array) -> Array:
    """States (n, 6) at the output times of a run to its end; fewer rows if it stops."""
    if sampled:
        return drive_sampled(scene, integrator, grid)[0]
    if scene.system.external:
        return drive_external(scene, integrator, grid)
    return integrator.run(one_interval(scene.duration, 0.0, len(grid)), grid)


def _repeats(scene: Scene, since: float, changes: Changes) -> bool:
    """Whether the controllers of a scene that is at rest since a time in s answer the same for good.

    Without noise they do if the commands that answer this state, by their last numbers, have arrived and moved nothing.
    """
    quiet = all(law.seed is None for law in scene.system.laws.values())
    slowest = int(scene.system.law_rows[:, Column.PERIOD].max())
    answered = max(since, scene.time_of(max(changes, default=0)))
    return quiet and bool(answered <= scene.time_of(scene.ticks - slowest - scene.system.delay))


def solve(
    scene: Scene, method: str, problem: Problem, changes: Changes = NO_CHANGES,
    by_user: Mapping[int, UserController] = NO_USER_CONTROLLERS,
) -> tuple[Solution, LoopRecord | None]:
    """States at ascending output times (n,), events and counters, and what went through a sampled loop.

    All arguments have been checked. Columns of bodies that are not there are NaN.
    """
    loop: LoopRecord | None = None

    def run_sampled(integrator: Integrator) -> Array:
        nonlocal loop
        states, loop = drive_sampled(scene, integrator, problem.grid, changes, by_user)
        return states

    if problem.sampled:
        problem = problem._replace(drive=run_sampled)
    elif scene.system.external:
        problem = problem._replace(drive=lambda integrator: drive_external(scene, integrator, problem.grid))
    found = METHODS[method].solve(problem)
    if problem.sampled and found.at_rest is not None and (by_user or not _repeats(scene, found.at_rest, changes)):
        found = found._replace(at_rest=None)
    if not METHODS[method].energy_check:  # it does not look for the domain itself
        inside = (np.abs(found.state) <= np.tile([LARGEST_POSITION, LARGEST_SPEED], 3)).all(axis=1)  # nan is not
        if not inside.all():
            row = int(np.argmin(inside))
            status = Status.OUTSIDE if np.isfinite(found.state[row]).all() else Status.NOT_FINITE
            early = found.event_table[:, Entry.TIME] < problem.grid[row]
            found = found._replace(state=found.state[:row], event_table=found.event_table[early], status=status)
    for body in scene.system.absent:  # a slice takes a fifth of the time of a list of columns
        found.state[:, COLUMN[body] : COLUMN[body] + 2] = np.nan
    return found, loop

"""Runs integrated again: with other output times, for the dense output, or with an observer, for outcomes.

No state depends on the other output times, not in its last bit, so that the run with the wanted times is the dense
output. It costs as much as the run, and holds for every method. Commands that were recorded at every control period are
used again as they are, whatever gave them; otherwise the laws of the scene answer again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import OBJECT, Entry
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import HORIZONS, SETTLED, Setup, Variants, compute
from grasp_ros.simulation.closed_loop import drive, outputs_within, solve
from grasp_ros.simulation.outcomes import GROUPS
from grasp_ros.simulation.sampled_plant import LoopRecord, SampledPlant, tick_of, tick_times

if TYPE_CHECKING:  # it imports this file
    from grasp_ros.simulation.trajectory import Trajectory

UNLIMITED = 2**62  # budgets of a run that was within its budgets before


def reached(run: Trajectory) -> float:
    """Time in s up to which a run is known."""
    end = run.scene.duration if run.status is Status.DONE else 0.0
    return float(max([end, *run.t[-1:], *run.event_table[-1:, Entry.TIME]]))  # which may be a rounding behind the end


def integrator_of(run: Trajectory) -> Integrator:
    """What integrates an exact run again."""
    return Integrator(run.scene.system, continuous=not run.sampled, accuracy=run.setting, max_events=UNLIMITED,
                      max_work=UNLIMITED)


def states_at(run: Trajectory, times: Array) -> Array:
    """States (..., 6) at any times (...) in s of a run: those of the run with these output times, bit for bit.

    Refused: a time outside the run, commands that were not recorded at every control period, and a run that cannot be
    repeated here to the last bit, as one from another machine.
    """
    end = reached(run)
    outside = times[~((times >= 0.0) & (times <= end))]
    if len(outside):
        raise Refused(f"time {float(outside[0])!r} is not allowed; allowed: 0 to {end!r} s")
    grid, index = np.unique(np.concatenate([times.ravel(), run.t]), return_inverse=True)
    recorded = run.sampled and has_ticks(run, grid[-1:])
    states = with_commands(run, grid, integrator_of(run)) if recorded else _solved(run, grid)[0].state
    check_same(run, grid, states)
    return np.asarray(states[index[: times.size]].reshape(*times.shape, 6))


def check_same(run: Trajectory, grid: Array, states: Array, events: Array | None = None) -> None:
    """Refuse a repetition that is not the run: by its states at times, which hold those of the run, and its events."""
    same = len(states) == len(grid) and (events is None or np.array_equal(events, run.event_table))
    if not same or not np.array_equal(states[np.searchsorted(grid, run.t)], run.state, equal_nan=True):
        raise Refused(f"{run.scene.name}: the run cannot be repeated here to the last bit; allowed: a run of this"
                      " machine and these versions")


def at_every_tick(run: Trajectory) -> Trajectory:
    """A run with every control period among its output times, up to the last of these."""
    if not len(run.t):
        raise Refused(f"{run.scene.name}: the run has no output times; allowed: one or more")
    if has_ticks(run, run.t[-1:]):
        return run
    ticks = tick_times(run.scene)
    grid = np.union1d(ticks[ticks <= run.t[-1]], run.t)
    found, loop = _solved(run, grid)
    check_same(run, grid, found.state)
    return replace(run, t=grid, state=found.state, loop=loop)


def breaks_of(run: Trajectory) -> Array:
    """Times (k,) in s between which a run is smooth: its begin and end, its events, and changes of its inputs."""
    scene, end = run.scene, reached(run)
    times = [np.array([0.0, end]), run.event_table[:, Entry.TIME]]
    if run.sampled:
        times.append(tick_times(scene))
    else:
        times += [scene.time_of(np.array([*force.changes(scene.ticks)])) for force in scene.system.external]
    found = np.unique(np.concatenate(times))
    return np.asarray(found[found <= end])


def _solved(run: Trajectory, grid: Array) -> tuple[Solution, LoopRecord | None]:
    """A run again, with the laws of its scene."""
    if run.controllers:
        raise Refused(f"{run.scene.name}: its controllers cannot be asked again; allowed: output times at every control"
                      " period, as without a grid")
    return solve(run.scene, run.method, Problem(
        run.scene.system, run.scene.duration, grid, run.setting, UNLIMITED, UNLIMITED, run.sampled))


def has_ticks(run: Trajectory, last: Array) -> bool:
    """Whether the output times hold every control period up to the last of some times."""
    ticks = tick_times(run.scene)[: int(tick_of(run.scene, last).max(initial=0)) + 1]
    return bool(np.isin(ticks, run.t).all())


def with_commands(run: Trajectory, grid: Array, integrator: Integrator) -> Array:
    """States (n, 6) at ascending times under the commands that were recorded; fewer if the run stops."""
    scene, last = run.scene, int(tick_of(run.scene, grid[-1:]).max(initial=0))
    count = min(last + 1, scene.ticks)
    answers = np.zeros((count, 3))
    answers[:, :OBJECT] = run.command[np.searchsorted(run.t, tick_times(scene)[:count])]
    plant = SampledPlant(scene.system, scene.period_ns, integrator)
    states = plant.follow(answers, outputs_within(scene, grid, np.arange(count + 1)))
    if plant.status is Status.DONE:
        states = np.concatenate([states, np.repeat(plant.state[None], len(grid) - len(states), axis=0)])
    states[:, scene.system.absent_columns] = np.nan
    return states


def as_row(run: Trajectory, *outcomes: str, horizons: int = HORIZONS) -> dict[str, float] | None:
    """Outcomes of an exact run, those of a row of an ensemble: it is integrated again, with an observer.

    Other controllers than the scene's act by their recorded commands. None for another method, a run that stopped, one
    that ends elsewhere, and where such commands were not recorded at every control period.
    """
    end = np.array([run.scene.duration])
    if run.method != EXACT or run.status is not Status.DONE or (run.controllers and not has_ticks(run, end)):
        return None
    setup = Setup((*outcomes, "last_state"), run.setting, run.sampled, SETTLED, horizons, UNLIMITED, UNLIMITED)

    def again(scene: Scene, integrator: Integrator, sampled: bool, grid: Array) -> Array:
        return with_commands(run, end, integrator) if run.controllers else drive(scene, integrator, sampled, grid)

    columns = compute(Variants(run.scene, {}), setup, move=again).columns
    found = {name: float(own[0]) for name, own in columns.items()}
    last = [found[name] for name in GROUPS["last_state"]]
    if run.sampled and not np.array_equal([[run.scene.duration, *last]], np.c_[run.t, run.state][-1:], equal_nan=True):
        return None
    return found

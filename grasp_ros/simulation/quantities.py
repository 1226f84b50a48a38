"""What a motion amounts to in a few numbers: settling times, contacts and impact forces.

Settled is one definition for the whole package: no mass leaves 2 % of the largest initial displacement any more, for
good, which V_c proves: it never rises, and its level bounds what follows, see `physics.lyapunov`. A run goes on past
its horizon until that is decided. What V_c does not prove within HORIZONS horizons is not settled.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.given import whole
from grasp_ros.physics.lyapunov import displacement_bound
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.simulation.chunk import HORIZONS, SETTLED, Setup, compute
from grasp_ros.simulation.closed_loop import drive
from grasp_ros.simulation.contacts import intervals, side_of
from grasp_ros.simulation.outcomes import GROUPS
from grasp_ros.simulation.repeat import UNLIMITED, has_ticks, with_commands
from grasp_ros.simulation.trajectory import Trajectory, check_run
from grasp_ros.simulation.variants import Variants


def settled_distance(scene: Scene, part: float = SETTLED) -> float:
    """What a mass must not leave any more to be settled, in m: a part of the largest initial displacement."""
    return part * float(np.abs(scene.initial_state[[COLUMN[body] for body in scene.system.present]]).max())


def last_outside(t: Array, position: Array, distance: float) -> Array:
    """Last time at which each mass is farther from 0 than a distance, (3,) in s: left, object, right.

    Between two output times |x| is taken to be linear; 0 for a mass that never is, infinite for one that is at the end.
    """
    found = np.zeros(3)
    for column, x in enumerate(np.abs(position).T):
        outside = np.flatnonzero(x > distance)
        if not len(outside):
            continue
        row = int(outside[-1])
        if row + 1 == len(x):
            found[column] = np.inf
        else:
            share = (x[row] - distance) / (x[row] - x[row + 1])
            found[column] = t[row] + share * (t[row + 1] - t[row])
    return found


def as_row(run: Trajectory, *outcomes: str, horizons: int = HORIZONS) -> dict[str, float] | None:
    """Outcomes of an exact run, those of a row of an ensemble: it is integrated again, and watched.

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


def settling_times(run: Trajectory, horizons: int = HORIZONS) -> Array:
    """When left arm, object and right arm settled for good, (3,) in s.

    Infinite: not proved by V_c within `horizons`, up to which an exact run continues, or within the output times of
    any other. nan: no proof, because V_c can rise here, or some mass is not driven to 0.
    """
    if not may_settle(check_run(run)):
        return np.full(3, np.nan)
    return settled_of(run, as_row(run, "settling_times", horizons=whole("horizons", horizons, 1)))


def settled_of(run: Trajectory, row: Mapping[str, float] | None) -> Array:
    """The same of a run that may settle, from a row that has them, or without one by its output times."""
    system, distance = run.scene.system, settled_distance(run.scene)
    if row is not None:  # 0 for a mass that is not there
        return np.array([row[f"settling_time_{NAMES[body]}"] if body in system.present else 0.0 for body in COLUMN])
    ahead = displacement_bound(system, float(run.energy.V_c[-1])) if len(run.t) else np.full(3, np.inf)
    if not np.isfinite(ahead).all():
        return np.full(3, np.nan)
    return last_outside(run.t, run.state[:, 0::2], distance) if (ahead <= distance).all() else np.full(3, np.inf)


def last_outside_of(run: Trajectory, row: Mapping[str, float] | None) -> Array:
    """Last time within a run at which each mass is outside the bound, (3,) in s; without a row by its output times."""
    if row is not None:  # 0 for a mass that is not there
        return np.nan_to_num([row[f"last_outside_{NAMES[body]}"] for body in COLUMN], posinf=np.inf)
    return last_outside(run.t, run.state[:, 0::2], settled_distance(run.scene))


def may_rise(run: Trajectory) -> bool:
    """Whether V_c may rise, so that it proves nothing of what follows."""
    return bool(run.controllers or run.scene.caveats(run.sampled))


def may_settle(run: Trajectory) -> bool:
    """Whether V_c cannot rise, and there is a distance to come into."""
    return not (run.sampled or may_rise(run)) and settled_distance(run.scene) > 0.0


def contact_intervals(run: Trajectory, side: str) -> Array:
    """Begin and end of every stretch with u > 0 of the "left" or "right" arm, (n, 2) in s."""
    return intervals(check_run(run), side_of(side))[:, :2]

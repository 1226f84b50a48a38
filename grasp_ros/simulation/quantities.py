"""Quantities that summarise a motion: settling times, contacts, and the summary, which `grasp simulate` prints.

Settled is one definition for the whole package: no mass leaves 2 % of the largest initial displacement any more, for
good, which V_c proves: it never rises, and its level bounds what follows, see `physics.lyapunov`. A run goes on past
its horizon until that is decided. What V_c does not prove within HORIZONS horizons is not settled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import METHODS
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.energy import energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.given import whole
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.physics.lyapunov import reach
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation.chunk import HORIZONS, SETTLED
from grasp_ros.simulation.contacts import intervals, side_of
from grasp_ros.simulation.losses import losses_of, needs_ticks
from grasp_ros.simulation.outcomes import GROUPS
from grasp_ros.simulation.repeat import as_row, at_every_tick
from grasp_ros.simulation.trajectory import Trajectory, check_run

MOTION, OUTPUTS, TICKS = "motion", "output times", "control periods"  # what a number is of
MOST_TICKS = 1_000_000  # for which a run is repeated for the sake of a table
FORCES = ("input_left", "input_right", "impact_left", "impact_right")  # as in the columns of `tables`
PEAKS = (*GROUPS["peak_input"], *GROUPS["peak_impact"])  # in the order of FORCES


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


def settling_times(run: Trajectory, horizons: int = HORIZONS) -> Array:
    """Settling times of left arm, object and right arm, (3,) in s.

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
    level = float(run.energy.V_c[-1]) if len(run.t) else np.inf
    ahead = np.array(reach(system.closed_loop, system.pairs, level)[:3])
    if not np.isfinite(ahead).all():
        return np.full(3, np.nan)
    return last_outside(run.t, run.state[:, 0::2], distance) if (ahead <= distance).all() else np.full(3, np.inf)


def may_rise(run: Trajectory) -> bool:
    """Whether V_c may rise, so that it proves nothing of what follows."""
    return bool(run.controllers or run.scene.caveats(run.sampled))


def may_settle(run: Trajectory) -> bool:
    """Whether V_c cannot rise, and there is a distance to come into."""
    return not (run.sampled or may_rise(run)) and settled_distance(run.scene) > 0.0


def contact_intervals(run: Trajectory, side: str) -> Array:
    """Begin and end of every interval with u > 0 of the "left" or "right" arm, (n, 2) in s."""
    return intervals(check_run(run), side_of(side))[:, :2]


@np.errstate(over="ignore", invalid="ignore")
def summary(run: Trajectory) -> dict[str, Any]:
    """Quantities of a run by names that end with the unit; those that the run does not have are left out.

    `settled_s` has infinity where V_c does not prove within `settled_within_s` that a mass has settled. Where V_c may
    rise, `last_outside_s` has the last times outside the same bound in its place.
    `touches` is left out for methods that do not look for them. V_c is twice the energy, at two times: half of
    its decrease is the energy lost minus the work of external forces.
    """
    scene, method = check_run(run).scene, METHODS[run.method]
    found: dict[str, Any] = {
        "scene": scene.name, "title": scene.title, "watch": scene.watch, "warnings": list(scene.warnings),
        "feedback": scene.feedback_in_words(run.sampled, bool(run.controllers)), "controllers": dict(run.controllers),
        "status": run.status.name, "stop": run.stop, "duration_s": scene.duration, "output_times": len(run.t),
        "reached_s": scene.duration if run.status is Status.DONE else float(max([0.0, *run.t[-1:]])),
        "method": method.name, method.knob: run.setting, "work": run.counters,
        "certificate": "none: V_c needs the energy of every controller" if run.controllers
        else scene.certificate_in_words(run.sampled),
    }
    if run.at_rest is not None:
        found["at_rest_s"] = run.at_rest
    if method.events:
        found["touches"] = {name: len(run.times(Transition.TOUCH, side)) for name, side in SIDES.items()}
        found["clamped"] = {name: len(run.times(Transition.CLAMP, side)) for name, side in SIDES.items()}
        found["sticks"] = len(run.times(Transition.STICK, OBJECT))
    if len(run.t):
        found |= _amounts(run)
    return found


def _amounts(run: Trajectory) -> dict[str, Any]:
    """Energies, settling times, largest forces and losses, as far as the scene has them."""
    scene, distance, settles = run.scene, settled_distance(run.scene), may_settle(run)
    row = as_row(run, *PEAKS, "energy", "settling_times" if settles else "last_outside_times")
    dense = None
    if (row is None or needs_ticks(run)) and scene.ticks <= max(MOST_TICKS, len(run.t)):
        with suppress(Refused):  # a run that cannot be repeated
            dense = at_every_tick(run)
    known = run if dense is None else dense
    ends, at = known.state[[0, -1]], known.t[[0, -1]].tolist()
    if row is not None:
        ends, at = np.stack([scene.initial_state, [row[name] for name in GROUPS["last_state"]]]), [0.0, scene.duration]
    level = energy(scene.system, ends, feedback=not run.controllers).V_c
    found: dict[str, Any] = {"energy_of": run.energy_of, "V_c_J": level.tolist(), "V_c_at_s": at}
    if not METHODS[run.method].energy_check or (run.setting > ACCURACY and not may_rise(run)):
        V_c = known.energy.V_c
        found["V_c_rise_J"] = float((V_c - np.minimum.accumulate(V_c)).max())
    if settles and not np.isnan(settled := settled_of(known, row)).any():
        found["settled_s"] = _by_body(run, settled)
        found["settled_within_s"] = float(run.t[-1]) if row is None else HORIZONS * scene.duration
    if may_rise(run) and distance > 0.0 and not (row is None and dense is None):
        found["last_outside_s"] = _by_body(run, last_outside(known.t, known.state[:, 0::2], distance) if row is None
                                           else [row[f"last_outside_{NAMES[body]}"] for body in COLUMN])
    if row is None:
        found["largest_of"] = OUTPUTS if dense is None else TICKS
        acted = np.fmax.reduce(np.abs(known.inputs[:, [LEFT, RIGHT]]), initial=0.0)  # nan: nothing acts from the end on
        largest = [*acted.tolist(), *known.impacts.max(axis=0).tolist()]
    else:
        found["largest_of"], largest = MOTION, [row[name] for name in PEAKS]
    found["largest_N"] = dict(zip(FORCES, largest, strict=True))
    if (dense is not None and len(dense.t) > 1) or (row is not None and not needs_ticks(run)):
        lost, work = losses_of(known, row)
        found["lost_J"] = {cause: float(value) for cause, value in lost._asdict().items()}
        found["lost_by"] = TICKS if row is None else MOTION
        if scene.system.external:
            found["work_external_J"] = work
    return found


def _by_body(run: Trajectory, times: Array | Sequence[float]) -> dict[str, float]:
    return {NAMES[body]: float(times[COLUMN[body] // 2]) for body in run.scene.system.present}

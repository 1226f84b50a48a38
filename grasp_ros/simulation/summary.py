"""What came of a run in a few numbers, as data: what `grasp simulate` prints, with `--json` and as a table."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.observe.sight import Wanted
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.losses import CAUSES, Losses, losses
from grasp_ros.simulation.outcomes import find, of_one, wanted_by
from grasp_ros.simulation.quantities import (
    HORIZONS,
    by_output_times,
    last_outside,
    may_rise,
    settled_distance,
    settling_from,
    settling_times,
    watch_again,
)
from grasp_ros.simulation.repeat import UNLIMITED, at_every_tick
from grasp_ros.simulation.trajectory import Trajectory

MOTION, OUTPUTS, TICKS = "motion", "output times", "control periods"  # what a number is of
MOST_TICKS = 1_000_000  # for which a run is repeated for the sake of a table
ARMS = {LEFT: NAMES[LEFT], RIGHT: NAMES[RIGHT]}
FORCES = ("f_l", "f_r", "fw_l", "fw_r")
PEAKS = find(("peak_input", "peak_impact"))  # in the order of FORCES


class _Observed(NamedTuple):
    """What was seen of a run."""

    settled: Array  # (3,), s: left arm, object, right arm
    lost: Losses | None  # None: not known, or not told
    largest_of: str
    largest: list[float]  # N, see FORCES


@np.errstate(over="ignore", invalid="ignore")
def summary(run: Trajectory) -> dict[str, Any]:
    """Numbers of a run by names that end with their unit; what the run does not have is left out.

    `settled_s` has infinity where V_c does not prove within `settled_within_s` that a mass has settled. Where V_c may
    rise, `last_outside_s` has the last times outside the same bound, at output times and control periods, in its place.
    `touches` is left out for methods that do not look for them. V_c is twice the energy.
    """
    scene, method = run.scene, METHODS[run.method]
    found: dict[str, Any] = {
        "scene": scene.name, "title": scene.title, "watch": scene.watch, "warnings": list(scene.warnings),
        "feedback": scene.feedback_in_words(run.sampled, bool(run.controllers)), "controllers": dict(run.controllers),
        "status": run.status.name, "stop": run.stop, "duration_s": scene.duration, "output_times": len(run.t),
        "reached_s": scene.duration if run.status is Status.DONE else float(max([0.0, *run.t[-1:]])),
        "method": method.name, method.knob: run.setting, "work": run.counters,
    }
    if run.at_rest is not None:
        found["at_rest_s"] = run.at_rest
    if method.events:
        found["touches"] = {name: len(run.times(Transition.TOUCH, side)) for side, name in ARMS.items()}
        found["clamped"] = {name: len(run.times(Transition.CLAMP, side)) for side, name in ARMS.items()}
        found["sticks"] = len(run.times(Transition.STICK, OBJECT))
    if len(run.t):
        found |= _amounts(run)
    return found


def _amounts(run: Trajectory) -> dict[str, Any]:
    """Energies, settling times, largest forces and losses, as far as the scene has them."""
    level = run.energy.V_c
    found: dict[str, Any] = {"energy_of": run.energy_of, "V_c_J": level[[0, -1]].tolist()}
    dense = _dense(run) if by_output_times(run) else run
    known = run if dense is None else dense
    if not METHODS[run.method].energy_check:
        V_c = known.energy.V_c
        found["V_c_rise_J"] = float((V_c - np.minimum.accumulate(V_c)).max())
    observed = _by_states(run, dense) if by_output_times(run) else _of_the_motion(run)
    distance = settled_distance(run.scene)
    if may_rise(run) and distance > 0.0:
        if dense is not None:
            found["last_outside_s"] = _by_body(run, last_outside(dense.t, dense.state[:, 0::2], distance))
    elif not np.isnan(observed.settled).any():
        found["settled_s"] = _by_body(run, observed.settled)
        found["settled_within_s"] = float(run.t[-1]) if by_output_times(run) else HORIZONS * run.scene.duration
    found["largest_of"], found["largest_N"] = observed.largest_of, dict(zip(FORCES, observed.largest, strict=True))
    if observed.lost is not None:
        found["lost_J"] = {cause: float(value) for cause, value in observed.lost._asdict().items()}
        found["lost_by"] = TICKS if by_output_times(run) else MOTION
    return found


def _dense(run: Trajectory) -> Trajectory | None:
    """The run with every control period among its output times; None if it cannot be repeated, or is too long."""
    with suppress(Refused):
        if run.scene.ticks <= max(MOST_TICKS, len(run.t)):
            return at_every_tick(run)
    return None


def _by_body(run: Trajectory, times: Array) -> dict[str, float]:
    return {NAMES[body]: float(times[COLUMN[body] // 2]) for body in run.scene.system.present}


def _of_the_motion(run: Trajectory) -> _Observed:
    """Of an exact run under continuous feedback, from its closed forms and polynomials: it is integrated once more."""
    integrator, watcher = watch_again(run, Wanted.LOSSES | Wanted.SETTLING | wanted_by(PEAKS))
    integrator.advance(run.scene.duration)
    watcher.finish()
    seen = watcher.seen.copy()
    settled, largest = settling_from(run, integrator, watcher), of_one(PEAKS, seen, run.state)
    return _Observed(settled, Losses(*seen[CAUSES]), MOTION, largest)


def _by_states(run: Trajectory, dense: Trajectory | None) -> _Observed:
    """Of any other run; the largest forces are those of the motion where it can be watched once more."""
    known = run if dense is None else dense
    where = OUTPUTS if known is run else TICKS
    largest = [*np.abs(known.command).max(axis=0).tolist(), *known.impacts.max(axis=0).tolist()]
    if run.method == EXACT and run.status is Status.DONE and not run.controllers and run.t[-1] == run.scene.duration:
        setup = Setup(accuracy=run.setting, sampled=run.sampled, max_events=UNLIMITED, max_work=UNLIMITED)
        names = [peak.name for peak in PEAKS] + [outcome.name for outcome in find(("last_state",))]
        columns = [float(column[0]) for column in ensemble(
            run.scene, {}, names, setup=setup, threads=1).columns.values()]
        if np.array_equal(columns[len(PEAKS) :], run.state[-1], equal_nan=True):  # nothing was set on the way
            where, largest = MOTION, columns[: len(PEAKS)]
    told = dense is not None and len(dense.t) > 1 and not run.scene.system.external
    return _Observed(settling_times(known), losses(known) if told else None, where, largest)

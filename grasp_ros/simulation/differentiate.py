"""Derivatives of a run: of its states, of V_c and of the times of its events, by numbers of its scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.energy import energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.frozen import Frozen
from grasp_ros.physics.impact_law import elastic_force, stored_energy
from grasp_ros.physics.layout import Entry, Law, Of
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, PAIR_COLUMNS
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.directions import closing, directions
from grasp_ros.sensitivity.event_times import Moments, event_rates
from grasp_ros.sensitivity.run import Carrier
from grasp_ros.simulation.chunk import Chunk, Setup, Variants
from grasp_ros.simulation.closed_loop import drive
from grasp_ros.simulation.outcomes import DIFFERENTIATED, derivatives_by
from grasp_ros.simulation.repeat import check_same, integrator_of
from grasp_ros.simulation.simulate import simulate
from grasp_ros.simulation.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Sensitivity(Frozen):
    """The derivatives of a run by n numbers.

    Attributes
    ----------
    scene : Scene
    keys : tuple of str
        The numbers, "section.key"; derivatives are per unit of the key.
    t : array (m,), s
    state : array (m, 6), m and m/s
        As `simulate` gives it; NaN for a body that is not there.
    event_table : array (e, 5)
        As in a trajectory: time in s, body, kind, u in m and u' in m/s.
    state_rates : array (m, 6, n)
        Derivatives of the states at fixed times; exactly at a STICK those of the motion before it.
    event_rates : array (e, n), s
        Derivatives of the times of the events; infinite at a touch without speed, 0 where an input that changes makes
        the event.
    corner : float or None
        Time in s from which on one-sided derivatives differ, because an object under dry friction turns where it could
        as well stay, or stops just when inputs change, a pair begins at u' = -1/p and nothing moves it off, or a
        command is just at its limit; None: nowhere. An object that friction just holds, to the last digit, is missed.
    corner_reason : str or None
        Which of these, in words.
    """

    scene: Scene
    keys: tuple[str, ...]
    t: Array
    state: Array
    event_table: Array
    state_rates: Array
    event_rates: Array
    corner: float | None
    corner_reason: str | None

    @property
    def V_c(self) -> Array:
        """Twice the energy (m,) in J, with continuous feedback."""
        return energy(self.scene.system, self.state).V_c

    @property
    def V_c_rates(self) -> Array:
        """Derivatives (m, n) of V_c."""
        system, state = self.scene.system, self.state
        changes = directions(self.scene, self.keys, False).closed_loop(system)
        gradient, explicit, weights, bodies = np.zeros_like(state), [], [], system.closed_loop
        columns = [column for body in system.present for column in (COLUMN[body], COLUMN[body] + 1)]
        for body in system.present:
            column = COLUMN[body]
            x, v = state[:, column], state[:, column + 1]
            mass, stiffness, _, force = bodies[body]
            away = force / stiffness if stiffness > 0.0 else 0.0
            gradient[:, column], gradient[:, column + 1] = 2.0 * (stiffness * x - force), 2.0 * mass * v
            explicit += [v * v, x * x - away * away, 2.0 * (away - x)]
            weights += [changes.bodies[body, column] for column in (Of.MASS, Of.STIFFNESS, Of.FORCE)]
        for side in system.contacts:
            pressed = np.maximum(closing(side, state)[0], 0.0)
            push = 2.0 * elastic_force(system.pairs[side, Law.HERTZIAN], pressed)
            front, back = PAIR_COLUMNS[side]
            gradient[:, front] += push
            gradient[:, back] -= push
            explicit.append(2.0 * stored_energy(1.0, pressed))
            weights.append(changes.pairs[side, Law.HERTZIAN])
        moved = np.einsum("mi,min->mn", gradient[:, columns], self.state_rates[:, columns])
        return np.asarray(moved + np.stack(explicit, axis=1) @ np.array(weights))


def differentiate(run: Trajectory, keys: Sequence[str]) -> Sensitivity:
    """Repeat a run of `exact`, and carry its derivatives along; the motion is that of the run, bit for bit.

    What has no derivatives is refused: a run that was not to its end or had controllers from outside, numbers that do
    not enter smoothly, sensors that measure in steps.
    """
    scene, sampled, system = run.scene, run.sampled, run.scene.system
    if run.status is not Status.DONE:
        raise Refused(f"{scene.name}: no derivatives of a run that {run.stop}")
    if run.method != EXACT or run.controllers:
        raise Refused(f"{scene.name}: derivatives: allowed: a run of {EXACT} with the scene's own controllers")
    changes, grid, events = directions(scene, keys, sampled), run.t, run.event_table
    times = np.concatenate([grid, events[:, Entry.TIME]])
    integrator = integrator_of(run)
    carrier = Carrier(scene, integrator, changes, times, sampled, len(events))
    states = complete(scene, integrator, sampled, times)
    carrier.finish()
    m = len(grid)
    carrier.out[:m][grid == 0.0] = changes.state  # before friction holds an object that has just been put there
    at_events = event_rates(scene, changes, sampled, events, Moments(states[m:], carrier.out[m:], carrier.forces))
    states[:, system.absent_columns] = carrier.out[:, system.absent_columns] = np.nan
    check_same(run, grid, states[:m], integrator.event_table)
    return Sensitivity(scene, tuple(keys), grid, states[:m], events, carrier.out[:m], at_events, carrier.corner,
                       carrier.corner_reason)


def complete(scene: Scene, integrator: Integrator, sampled: bool, times: Array) -> Array:
    """Run a scene to its end, as `simulate` does, or refuse; states (m, 6) at output times (m,) in s, in any order."""
    grid, index = np.unique(times, return_inverse=True)
    states = drive(scene, integrator, sampled, grid)
    if integrator.status is not Status.DONE:
        raise Refused(f"{scene.name}: no derivatives of a run that {integrator.stop}")
    return states[index]


def with_derivatives(chunk: Chunk, variants: Variants, setup: Setup, keys: Sequence[str], stop: NDArray[np.int64]
                     ) -> Chunk:
    """A chunk of rows with the derivatives of their last states, see `ensemble`; a `stop` that is not 0 ends it early.

    A row that has none says why among the stops, and has nan.
    """
    n, stops = variants.rows, dict(chunk.stops)
    rates, level, corner = np.full((n, len(DIFFERENTIATED), len(keys)), np.nan), np.full(n, np.nan), np.full(n, np.nan)
    for i in np.flatnonzero(chunk.status == 0).tolist():
        if stop[0]:
            break
        scene = variants.row(i)
        try:
            found = differentiate(simulate(
                scene, grid=np.array([scene.duration]), sampled=setup.sampled, setting=setup.accuracy,
                max_events=setup.max_events, max_work=setup.max_work), keys)
        except Refused as refusal:
            stops[i] = str(refusal)
            continue
        rates[i], level[i] = np.vstack([found.state_rates[-1], found.V_c_rates[-1]]), found.V_c[-1]
        corner[i] = np.inf if found.corner is None else found.corner
    columns = zip(derivatives_by(keys), [level, *rates.transpose(2, 1, 0).reshape(-1, n), corner], strict=True)
    return chunk._replace(columns={**chunk.columns, **dict(columns)}, stops=stops)

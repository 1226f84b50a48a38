"""The energy that a motion lost, by cause, in J; V counts it twice.

Of an exact run it is what an observer sees while the run is integrated again, from closed forms and polynomials; of any
other motion what its states at every control period and output time tell.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Of
from grasp_ros.physics.model import Array, hertzian_force, impact_force
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.simulation.repeat import as_row, at_every_tick
from grasp_ros.simulation.trajectory import Trajectory, check_run


class Losses(NamedTuple):
    """Energy lost by each cause in J; arrays (n,) if they are running sums. Negative is gained."""

    dampers: Array  # c of the arms
    feedback: Array  # Kv of the controllers; held commands: all their work
    impacts: Array  # p, and what the cut-off tension leaves
    friction: Array  # drag and dry friction of the object

    @property
    def total(self) -> Array:
        """All of them."""
        return np.asarray(self.dampers + self.feedback + self.impacts + self.friction)


def power_lost(system: System, state: Array) -> Losses:
    """Rates of the losses in W at states (n, 6), under continuous feedback; half of (18), and what effects add."""
    speed = np.zeros((len(state), 3))
    speed[:, system.present] = state[:, [COLUMN[body] + 1 for body in system.present]]
    damping, loop = system.bodies[:, Of.DAMPING], system.closed_loop[:, Of.DAMPING]
    arms, impacts = speed[:, :OBJECT] ** 2, np.zeros(len(state))
    for _, contact, u, d in pairs_of(system, state):
        impacts += (impact_force(contact, u, d) - hertzian_force(contact, u)) * d
    friction = damping[OBJECT] * speed[:, OBJECT] ** 2 + system.coulomb * np.abs(speed[:, OBJECT])
    return Losses(arms @ damping[:OBJECT], arms @ (loop - damping)[:OBJECT], impacts, friction)


def losses(run: Trajectory) -> Losses:
    """Energy lost by each cause over the whole run, in J, or up to the last output time if computed from these.

    Under sampled feedback `feedback` is not the loss by Kv, but the work that the commands took out of the arms,
    besides the energy that they have stored in V_c. Half of the decrease of V_c is the total minus the work of
    external forces.

    Raises
    ------
    Refused
        If output times that count leave control periods out, and the run cannot be repeated, see `Trajectory.at`, or
        there are none.
    """
    row = as_row(check_run(run), "energy")
    return losses_of(at_every_tick(run) if row is None or needs_ticks(run) else run, row)[0]


def needs_ticks(run: Trajectory) -> bool:
    """Whether the states at all ticks have to tell the work of held commands from that of external forces.

    A row has one sum of both. Each is constant between ticks, so that its work follows from the states there.
    """
    return bool(run.sampled and run.scene.system.external)


def losses_of(run: Trajectory, row: Mapping[str, float] | None) -> tuple[Losses, float]:
    """The losses, and the work of external forces in J, from the row of an exact run, see `as_row` and `needs_ticks`.

    Without a row by the trapezoidal rule, of a run whose output times hold every control period.
    """
    system, arms = run.scene.system, [COLUMN[LEFT], COLUMN[RIGHT]]
    moves = np.diff(np.nan_to_num(run.state[:, [COLUMN[body] for body in Body]]), axis=0)  # 0 of an absent body
    external = float((run.external[:-1] * moves).sum())
    if row is None:
        found = Losses(*(np.asarray(np.trapezoid(rate, run.t)) for rate in power_lost(system, run.state)))
    else:
        found = Losses(*(np.asarray(row[f"lost_{cause}"]) for cause in Losses._fields))
    if not run.sampled:
        return found, external if row is None else row["work_inputs"]
    work = float((run.inputs[:-1] * moves).sum()) if row is None else row["work_inputs"]
    own = 0.0 if run.controllers else 1.0  # what a user's controller stores is not known
    _, stiffness, _, force = own * (system.closed_loop - system.bodies)[:OBJECT].T  # of the feedback
    ends = np.stack([run.scene.initial_state, np.nan_to_num(run.state[-1])])[:, arms]
    before, after = (0.5 * stiffness * ends**2 - force * ends).sum(axis=1)
    return found._replace(feedback=np.asarray(before - after - (work - external))), external  # not stored in V_c

"""The energy that a motion lost, by cause, in J; V counts it twice.

Of an exact run it is what an observer sees while the run is integrated again, from closed forms and polynomials; of any
other motion what its states at every control period and output time tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.observe.sight import Seen, Wanted
from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of
from grasp_ros.physics.model import Array, Contact, hertzian_force, impact_force
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.simulation.quantities import by_output_times, watch_again
from grasp_ros.simulation.repeat import at_every_tick
from grasp_ros.simulation.trajectory import Trajectory

CAUSES = [int(cause) for cause in (Seen.DAMPERS, Seen.FEEDBACK, Seen.IMPACTS, Seen.FRICTION)]  # as in `Losses`


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
    zero: Array = np.zeros(len(state))
    speed = {body: state[:, COLUMN[body] + 1] for body in system.present}
    arms = [body for body in system.present if body != OBJECT]
    damping, loop = system.bodies[:, Of.DAMPING], system.closed_loop[:, Of.DAMPING]
    dampers = sum((damping[body] * speed[body] ** 2 for body in arms), zero)
    feedback = sum(((loop - damping)[body] * speed[body] ** 2 for body in arms), zero)
    impacts = zero
    for side, u, d in pairs_of(system, state):
        contact = Contact(*system.pairs[side])
        impacts = impacts + (impact_force(contact, u, d) - hertzian_force(contact, u)) * d
    friction = zero
    if OBJECT in system.present:
        friction = damping[OBJECT] * speed[OBJECT] ** 2 + system.coulomb * np.abs(speed[OBJECT])
    return Losses(dampers, feedback, impacts, friction)


def running_losses(run: Trajectory) -> tuple[Array, Losses]:
    """Energy lost so far by each cause: times (n,) in s, and arrays (n,) in J; see `quantities.by_output_times`.

    The times are those of outputs and events of an exact run, and its begin and end; those of outputs and control
    periods of any other, whose sums follow the trapezoidal rule.
    """
    if not by_output_times(run):
        times = np.unique(np.concatenate([run.t, run.event_table[:, 0], [0.0, run.scene.duration]]))
        return times, observed_losses(run, times)
    run = at_every_tick(run)
    return run.t, _sums(run)


def _sums(run: Trajectory) -> Losses:
    """Running sums (n,) in J of what its states tell, by the trapezoidal rule."""
    steps = np.diff(run.t)
    rates = power_lost(run.scene.system, run.state)
    return Losses(*(np.concatenate([[0.0], np.cumsum(0.5 * steps * (r[1:] + r[:-1]))]) for r in rates))


def observed_losses(run: Trajectory, times: Array) -> Losses:
    """Energy lost until each of the times (n,) in s, from 0 on: arrays (n,). An exact run is integrated again."""
    integrator, watcher = watch_again(run, Wanted.LOSSES)
    lost = np.zeros((len(CAUSES), len(times)))
    for k, length in enumerate(np.diff(times).tolist(), 1):
        integrator.advance(length)
        lost[:, k] = watcher.seen[CAUSES]
    return Losses(*lost)


def losses(run: Trajectory) -> Losses:
    """Energy lost by each cause over the whole run, in J; see `quantities.by_output_times`.

    What a held command does is not a loss of Kv: under sampled feedback `feedback` is the work that the commands took
    out of the arms, beside what they have stored in V_c.

    Raises
    ------
    Refused
        If output times that count leave control periods out, and the run cannot be repeated, see `Trajectory.at`.
    """
    if by_output_times(run):
        run = at_every_tick(run)
        sums = _sums(run)
    else:
        sums = observed_losses(run, np.array([0.0, run.scene.duration]))
    found = Losses(*(np.asarray(total[-1]) for total in sums))
    if not run.sampled:
        return found
    system, taken = run.scene.system, 0.0
    own = 0.0 if run.controllers else 1.0  # nobody knows what a controller of one's own stores
    virtual = own * (system.closed_loop - system.bodies)  # spring and force of the feedback
    for side in (LEFT, RIGHT):
        if side not in system.present:
            continue
        x = run.state[:, COLUMN[side]]
        work = float((run.inputs[:-1, side] * np.diff(x)).sum())
        stored = 0.5 * virtual[side, Of.STIFFNESS] * (x**2)[[0, -1]] - virtual[side, Of.FORCE] * x[[0, -1]]
        taken -= work + float(stored[1] - stored[0])
    return found._replace(feedback=np.asarray(taken))

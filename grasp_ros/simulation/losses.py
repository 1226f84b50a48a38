"""The energy that a motion lost, by cause, in J of V, which is twice the energy.

Of an exact run it is what `outcomes` sees while the run is integrated again, from closed forms and polynomials; of any
other motion what its output times tell.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.layout import DAMPING, FORCE, LEFT, OBJECT, RIGHT, STIFFNESS
from grasp_ros.physics.model import Array, Contact, hertzian_force, impact_force
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.simulate import simulate
from grasp_ros.simulation.trajectory import Trajectory

NODES = 24  # of a segment between events
MOST = 20_000  # stretches between events that are worth it
LONGEST = 0.25  # s; longer segments are cut, so that an arm turns by no more than some radians in each part


class Losses(NamedTuple):
    """Energy lost by each cause in J of V; arrays (n,) if they are running sums. Negative is gained."""

    dampers: Array  # c of the arms
    feedback: Array  # Kv of the controllers; held commands: all their work
    impacts: Array  # p, and what the cut-off tension leaves
    friction: Array  # drag and dry friction of the object

    @property
    def total(self) -> Array:
        """All of them."""
        return np.asarray(self.dampers + self.feedback + self.impacts + self.friction)


def power_lost(system: System, state: Array) -> Losses:
    """Rates of the losses in W of V at states (n, 6), under continuous feedback; (18), and what effects add."""
    zero: Array = np.zeros(len(state))
    speed = {body: state[:, COLUMN[body] + 1] for body in system.present}
    arms = [body for body in system.present if body != OBJECT]
    damping, loop = system.bodies[:, DAMPING], system.closed_loop[:, DAMPING]
    dampers = sum((2.0 * damping[body] * speed[body] ** 2 for body in arms), zero)
    feedback = sum((2.0 * (loop - damping)[body] * speed[body] ** 2 for body in arms), zero)
    impacts = zero
    for side, u, d in pairs_of(system, state):
        contact = Contact(*system.pairs[side])
        impacts = impacts + 2.0 * (impact_force(contact, u, d) - hertzian_force(contact, u)) * d
    friction = zero
    if OBJECT in system.present:
        friction = 2.0 * (damping[OBJECT] * speed[OBJECT] ** 2 + system.coulomb * np.abs(speed[OBJECT]))
    return Losses(dampers, feedback, impacts, friction)


def edges_of(run: Trajectory, longest: float) -> Array:
    """Ends of the stretches of a motion in which everything is smooth: events, and cuts of the long flights, in s.

    Empty if there are more stretches than MOST.
    """
    events = np.unique(np.concatenate([[0.0], run.event_table[:, 0], run.t[-1:]]))
    parts = np.ceil(np.diff(events) / longest)
    if parts.sum() > MOST:
        return np.zeros(0)
    cuts = [np.linspace(a, b, int(n) + 1)[1:] for (a, b), n in zip(pairwise(events.tolist()), parts, strict=True)]
    return np.concatenate([[0.0], *cuts])


def by_output_times(run: Trajectory) -> bool:
    """Whether `losses` are no more exact than the output times are dense."""
    return run.method != EXACT or run.status is not Status.DONE or run.sampled or bool(run.scene.system.external)


def running_losses(run: Trajectory, longest: float = LONGEST) -> tuple[Array, Losses]:
    """Energy lost so far by each cause: times (n,), at most `longest` s apart, in s, and arrays (n,) in J of V.

    Under continuous feedback of `exact` the run is integrated again at the nodes of Gauss and Legendre: between events
    the rates are analytic functions of theta in t = middle - half cos(theta), because u^(3/2) becomes theta^3 times
    one, but for a relaxation shorter than they are apart: large p. Other runs, those that stopped and those of more
    than MOST stretches have their output times: the trapezoidal rule.
    """
    system, edges = run.scene.system, np.zeros(0) if by_output_times(run) else edges_of(run, longest)
    if not len(edges):
        lost = power_lost(system, run.state)
        steps = np.diff(run.t)
        sums = [np.concatenate([[0.0], np.cumsum(0.5 * steps * (rate[1:] + rate[:-1]))]) for rate in lost]
        return run.t, Losses(*sums)
    x, weight = np.polynomial.legendre.leggauss(NODES)
    theta = 0.5 * np.pi * (x + 1.0)
    half = 0.5 * np.diff(edges)[:, None]
    times = edges[:-1, None] + half * (1.0 - np.cos(theta))
    weights = 0.5 * np.pi * half * np.sin(theta) * weight
    grid = np.maximum.accumulate(np.minimum(times.ravel(), edges[-1]))
    again = simulate(run.scene, grid=grid, accuracy=run.setting)
    lost = power_lost(system, again.state)
    sums = [np.concatenate([[0.0], np.cumsum((rate.reshape(weights.shape) * weights).sum(axis=1))]) for rate in lost]
    return edges, Losses(*sums)


def losses(run: Trajectory) -> Losses:
    """Energy lost by each cause over the whole run, in J of V; see `by_output_times`.

    What a held command does is not a loss of Kv: under sampled feedback `feedback` is the work that the commands took
    out of the arms, beside what they have stored in V_c, from the positions at the output times.
    """
    if not by_output_times(run):
        seen = ensemble(run.scene, {}, ("energy",), setup=Setup(accuracy=run.setting)).columns
        return Losses(*(2.0 * seen[f"lost_{cause}"][0] for cause in Losses._fields))
    _, sums = running_losses(run)
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
        work = 2.0 * float((run.inputs[:-1, side] * np.diff(x)).sum())
        stored = virtual[side, STIFFNESS] * (x**2)[[0, -1]] - 2.0 * virtual[side, FORCE] * x[[0, -1]]
        taken -= work + float(stored[1] - stored[0])
    return found._replace(feedback=np.asarray(taken))

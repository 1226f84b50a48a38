"""What a motion amounts to in a few numbers: settling times, contacts, peak forces, and the energy lost by cause.

Settled is one definition for the whole package: no mass leaves 2 % of the largest initial displacement any more.
Energies are in J of V, which is twice the energy. These numbers come from a motion that is there, whatever method or
controller made it; `outcomes` has those of runs that are watched while they are integrated, and agrees.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import EXACT
from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.layout import DAMPING, FORCE, LEFT, OBJECT, RIGHT, STIFFNESS, Transition
from grasp_ros.physics.model import Array, Contact, hertzian_force, impact_force
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene import Scene
from grasp_ros.simulation.simulate import simulate
from grasp_ros.simulation.trajectory import Trajectory

SETTLED = 0.02  # of the largest initial displacement
NODES = 24  # of a segment between events
MOST = 20_000  # stretches between events that are worth it
LONGEST = 0.25  # s; longer segments are cut, so that an arm turns by no more than some radians in each part


def settled_distance(scene: Scene, part: float = SETTLED) -> float:
    """What a mass must not leave any more to be settled, in m: a part of the largest initial displacement."""
    return part * float(np.abs(scene.initial_state[[COLUMN[body] for body in scene.system.present]]).max())


def rests_at_zero(system: System) -> bool:
    """Whether the arms are regulated to 0 and nothing pushes from outside: where `settled` has a meaning."""
    return not (system.closed_loop[:, FORCE].any() or system.external)


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


def settling_times(run: Trajectory, part: float = SETTLED) -> Array:
    """When left arm, object and right arm settled, (3,) in s, as far as the output times go; infinite: not yet."""
    return last_outside(run.t, run.state[:, 0::2], settled_distance(run.scene, part))


def contact_intervals(run: Trajectory, side: int) -> Array:
    """Begin and end of every stretch with u > 0 of one side, (n, 2) in s."""
    table = run.event_table[run.event_table[:, 1] == side]
    begins = table[table[:, 2] == Transition.TOUCH, 0].tolist()
    ends = table[table[:, 2] == Transition.RELEASE, 0].tolist()
    if ends and (not begins or ends[0] < begins[0]):
        begins.insert(0, 0.0)  # it began in contact
    if len(begins) > len(ends):
        ends.append(float(run.t[-1]))
    return np.reshape([*zip(begins, ends, strict=True)], (-1, 2))


def impact_forces_of(run: Trajectory) -> Array:
    """fw of both sides at the output times, (n, 2) in N; 0 where there is no contact, or none in the scene."""
    forces = np.zeros((len(run.t), 2))
    for side, u, d in pairs_of(run.scene.system, run.state):
        forces[:, side] = impact_force(Contact(*run.scene.system.pairs[side]), u, d)
    return forces


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


def is_smooth_between(run: Trajectory, edges: Array) -> bool:
    """Whether a motion is known to be smooth between edges, those of `edges_of`, and can be integrated there."""
    located = run.method == EXACT and run.status is Status.DONE and not (run.sampled or run.scene.system.external)
    return located and len(edges) > 0


def by_output_times(run: Trajectory) -> bool:
    """Whether `losses` are no more exact than the output times are dense; see `running_losses`."""
    return not is_smooth_between(run, edges_of(run, LONGEST))


def running_losses(run: Trajectory, longest: float = LONGEST) -> tuple[Array, Losses]:
    """Energy lost so far by each cause: times (n,), at most `longest` s apart, in s, and arrays (n,) in J of V.

    Under continuous feedback of `exact` the run is integrated again at the nodes of Gauss and Legendre: between events
    the rates are analytic functions of theta in t = middle - half cos(theta), because u^(3/2) becomes theta^3 times
    one. Other runs, those that stopped and those of more than MOST stretches have their output times: the trapezoidal
    rule.
    """
    system, edges = run.scene.system, edges_of(run, longest)
    if not is_smooth_between(run, edges):
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
    """Energy lost by each cause over the whole run, in J of V; see `running_losses`.

    What a held command does is not a loss of Kv: under sampled feedback `feedback` is the work that the commands took
    out of the arms, beside what they have stored in V_c, from the positions at the output times.
    """
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

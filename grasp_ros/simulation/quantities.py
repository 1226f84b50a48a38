"""What a motion amounts to in a few numbers: settling times, contacts and impact forces.

Settled is one definition for the whole package: no mass leaves 2 % of the largest initial displacement any more.
These numbers come from a motion that is there, whatever method or controller made it; `outcomes` has those of runs that
are watched while they are integrated, and agrees.
"""

from __future__ import annotations

import numpy as np

from grasp_ros.physics.energy import pairs_of
from grasp_ros.physics.layout import Of, Transition
from grasp_ros.physics.model import Array, Contact, impact_force
from grasp_ros.physics.system import COLUMN, System
from grasp_ros.scene import Scene
from grasp_ros.simulation.trajectory import Trajectory

SETTLED = 0.02  # of the largest initial displacement


def settled_distance(scene: Scene, part: float = SETTLED) -> float:
    """What a mass must not leave any more to be settled, in m: a part of the largest initial displacement."""
    return part * float(np.abs(scene.initial_state[[COLUMN[body] for body in scene.system.present]]).max())


def rests_at_zero(system: System) -> bool:
    """Whether the arms are regulated to 0 and nothing pushes from outside: where `settled` has a meaning."""
    return not (system.closed_loop[:, Of.FORCE].any() or system.external)


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

"""Runs that start anew, at an output or at the end, beside runs from states nudged a little.

A run and a restarted one differ by rounding, as far as the motion lets it grow; how far it does, the nudged runs say.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Entry, Law, Of, Transition, Work
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.simulation import Trajectory
from lab.cases.case import Product, Unfinished
from lab.cases.scenes import reference
from lab.oracles.metamorphic import FLIP
from lab.oracles.rounding_bounds import (
    TINY,
    UNDERFLOW,
    Impacts,
    accelerations,
    at_rest,
    impact_speed,
    impacts,
    largest,
    rates,
    sizes,
    walk,
)
from lab.oracles.segments import COLUMNS, FIRST, LAST, Detail
from lab.reference.deadline import Deadline, deadline

NUDGE = 2.0**-46  # of the size of a state
PATTERN = np.array([1.0, -0.7, 0.4, 0.9, -1.0, 0.6])  # signs and parts of a nudge
OTHER = np.array([0.5, 1.0, -0.8, 0.3, 0.9, 1.0])  # where one nudge shows least, another one does
BESIDE = 1e-7  # of a time: outputs that near to an event are beside it
AHEAD = 60  # pieces over which a restarted run is compared
REFERENCE_STEPS = 100  # contact steps beyond which the reference, which counts in 25 digits, takes too long
REFERENCE_SECONDS = 3.0


def splitting(detail: Detail, part: float, product: Product) -> float:
    """A run restarted from an output, over the rest of its input interval, beside one from a state nudged a little.

    Outputs beside an event are left out: `motion` compares them with the state at the event. `part`, in [0, 1), says
    which piece of the run begins anew; the product, with which accuracy and budgets.
    """
    first = int(part * len(detail.pieces.begin))
    pieces = slice(first, first + _alike(detail, first))
    times, start = detail.t[pieces].ravel(), detail.pieces.begin[first]
    there = [COLUMN[body] + k for body in detail.run.scene.system.present for k in (0, 1)]
    scale = sizes(detail)
    whole, size = _rows(detail.x[pieces], detail.v[pieces]), _rows(scale.x[first], scale.v[first])[0]
    moves = np.where(NUDGE * size > UNDERFLOW, size, 0.0)  # what rests stays at rest
    base = detail.run.scene.system.bodies if detail.run.sampled else detail.run.scene.system.closed_loop
    inputs = detail.bodies[first, :, Of.FORCE] - base[:, Of.FORCE]
    again, *nudged = (_go(detail.run, whole[0] + nudge * moves * pattern, inputs, times - start, product)
                      for nudge, pattern in ((0.0, PATTERN), (NUDGE, PATTERN), (-NUDGE, PATTERN), (NUDGE, OTHER)))
    grown = np.max([np.abs(other - again) for other in nudged], axis=0) * (EPS / NUDGE)
    reached = np.abs(whole)
    reached[:, ::2] = np.maximum.accumulate(reached[:, ::2].max(axis=1))[:, None]  # in a contact x follows x_o
    pairs = impacts(detail, scale)
    moving = _rows(np.abs(detail.v[pieces]), accelerations(detail, pairs)[pieces])
    touched = _touched(detail, pieces)[:, None]  # a rounding of that time moves an arm: it is put where the object is
    fastest = np.maximum.accumulate(np.abs(detail.v[pieces]).max(axis=2).ravel())[:, None]
    moving[:, ::2] = np.maximum(moving[:, ::2], np.where(touched, fastest, 0.0))
    unit = grown + EPS * (reached + size) + _late(times, whole, moving) + TINY
    unit += _noise(detail, pairs, pieces, times - start)
    rest = (np.broadcast_to(change[pieces], detail.x[pieces].shape) for change in at_rest(detail))
    unit += _rows(*rest)  # whoever restarts knows less of the scene's scale, and comes to rest later
    slowing = np.where(touched, _slowing(detail.bodies[first]), 0.0)  # on the way to a touch that roundings of x shift
    unit[:, 1::2] += EPS * reached[:, ::2] * (rates(detail.bodies[first]) + slowing)[:, [LEFT, OBJECT, RIGHT]]
    error = (np.abs(again - whole) / unit)[:, there].max(axis=1) / walk(detail.run, 1)
    return float(error[~_beside_event(detail, pieces).ravel()].max(initial=0.0))


def _beside_event(detail: Detail, pieces: slice) -> NDArray[np.bool_]:
    """Outputs (k, n) at the ends of segments, or next to them."""
    t, kind = detail.t[pieces], detail.pieces.kind[pieces, None]
    near = BESIDE * t
    begins, ends = (kind & FIRST > 0) & (t - t[:, :1] <= near), (kind & LAST > 0) & (t[:, -1:] - t <= near)
    return np.asarray(begins | ends)


def _touched(detail: Detail, pieces: slice) -> NDArray[np.bool_]:
    """Which outputs (n,) come after the first touch in these pieces."""
    events = detail.run.event_table
    touches = events[events[:, Entry.KIND] == Transition.TOUCH, Entry.TIME]
    first = min(touches[touches > detail.pieces.begin[pieces.start]], default=np.inf)
    return np.asarray(detail.t[pieces].ravel() >= first)


def _slowing(bodies: Array) -> Array:
    """How fast dampers (3, 4) slow bodies down, and the object that they hit, (3,) in 1/s."""
    mass = bodies[:, Of.MASS]
    found: Array = np.where(mass > 0.0, np.abs(bodies[:, Of.DAMPING]) / np.where(mass > 0.0, mass, 1.0), 0.0)
    found[OBJECT] = found.max()
    return found


def _rows(x: Array, v: Array) -> Array:
    """States (n, 6) of positions and velocities (..., 3) by body."""
    states = np.empty((x.size // 3, 6))
    states[:, COLUMNS], states[:, np.array(COLUMNS) + 1] = x.reshape(-1, 3), v.reshape(-1, 3)
    return states


def _late(times: Array, states: Array, moving: Array) -> Array:
    """What a rounding of the times changes in states (n, 6), which move at rates of these sizes."""
    steps = np.abs(np.diff(states, axis=0)) / np.maximum(np.diff(times), TINY)[:, None]
    steps[np.diff(times) == 0.0] = 0.0
    fastest = moving.copy()
    fastest[:-1] = np.maximum(fastest[:-1], steps)
    fastest[1:] = np.maximum(fastest[1:], steps)
    late: Array = EPS * times[:, None] * fastest
    return late


def _noise(detail: Detail, pairs: list[Impacts], pieces: slice, offsets: Array) -> Array:
    """What roundings of the constant forces, which may balance each other, and of impacts make of states (n, 6)."""
    mass, force = detail.bodies[pieces.start, :, Of.MASS], np.abs(detail.bodies[pieces.start, :, Of.FORCE])
    force[OBJECT] += detail.run.scene.system.coulomb
    speed = EPS * (force * offsets[:, None] / np.where(mass > 0.0, mass, 1.0)
                   + impact_speed(detail, pairs)[pieces].max(axis=0))
    return _rows(speed * offsets[:, None], speed)


def _alike(detail: Detail, first: int) -> int:
    """How many pieces from the first on follow each other under the same inputs."""
    begin, end = detail.pieces.begin[first + 1 : first + AHEAD], detail.pieces.end[first : first + AHEAD - 1]
    forces = detail.bodies[:, :, Of.FORCE]
    ahead = forces[first + 1 : first + AHEAD]
    broken = (begin != end[: len(begin)]) | (ahead != forces[first]).any(axis=1)
    return 1 + (int(broken.argmax()) if broken.any() else len(broken))


def _go(run: Trajectory, state: Array, inputs: Array, offsets: Array, product: Product) -> Array:
    """States at offsets in time from another state, under inputs that are held."""
    system = replace(run.scene.system, state=state)
    integrator = Integrator(system, continuous=not run.sampled, accuracy=product.accuracy,
                            max_events=product.max_events, max_work=product.max_work)
    integrator.set_input(inputs)
    found = integrator.advance(float(offsets[-1]), offsets)
    product.runs.append(replace(run, state=found, status=integrator.status))
    if integrator.status is not Status.DONE:
        raise Unfinished(integrator.status.value)
    return found


def _end_beside_nudged(run: Trajectory, start: Array, product: Product) -> tuple[Array, Array]:
    """The end (6,) of a whole run from a state, and what roundings of the start and at each event make of it."""
    system, seconds = run.scene.system, np.array([run.scene.duration])
    size = largest(run.state)
    size[system.absent_columns] = 0.0
    end, *nudged = (_go(run, start + nudge * size * PATTERN, np.zeros(3), seconds, product)[0]
                    for nudge in (0.0, NUDGE, -NUDGE))
    grown = np.maximum(*(np.abs(other - end) for other in nudged)) * (EPS / NUDGE)
    return end, (grown + EPS * size) * (walk(run, 1) + len(run.event_table)) + TINY


def reversal(run: Trajectory, product: Product) -> float | None:
    """A motion without losses, run backwards, ends where it began, O8; None: there are losses or held forces."""
    system = run.scene.system
    lossy = system.closed_loop[:, Of.DAMPING].any() or system.pairs[:, Law.DISSIPATION].any() or system.coulomb
    if lossy or run.sampled or system.external:
        return None
    begin, unit = _end_beside_nudged(run, np.nan_to_num(run.state[-1]) * FLIP, product)
    return float((np.abs(begin * FLIP - run.scene.initial_state) / unit).max())


def digits(run: Trajectory, product: Product) -> float | None:
    """The end beside that by another method, in 25 digits; None: that takes longer than some seconds."""
    scene = run.scene
    if run.work[Work.CONTACT_STEPS] > REFERENCE_STEPS or scene.sampled or scene.system.external:
        return None
    try:
        with deadline(REFERENCE_SECONDS):
            expected = reference(scene, [0.0, scene.duration])[-1]
    except (Deadline, RuntimeError):
        return None
    end, unit = _end_beside_nudged(run, scene.initial_state, product)
    return float((np.abs(end - expected) / unit).max())

"""What roundings in a run are relative to: sizes of its positions, velocities and impacts, and how far steps wander."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.tolerances import REST, STILL
from grasp_ros.physics.impact_law import stored_energy
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, Law, Of, Work
from grasp_ros.physics.model import Array, Contact, impact_force
from grasp_ros.simulation import Trajectory
from lab.oracles.segments import FIRST, INNER, Detail

NEGLECT = STILL / 32.0  # of the fastest velocity: what a step may neglect of each, as 32 roundings of this
STEP = 5.0  # time constants of what damps within a step in contact
MANY = 100.0  # roundings that u' may be from -1/p while the force is that of a pair that glides there
TINY = 1e-280  # against 0 / 0, and for what underflows
UNDERFLOW = 1e-100  # m or m/s: motions below lose digits in squares and powers 5/2, in other units others
DIED_OUT = 1e-150  # m or m/s: nothing is said about the digits of such motions


class Sizes(NamedTuple):
    """What roundings are relative to, (k, 1, 3) by body."""

    x: Array  # m, in the segment; in a contact also that of x_o, because x_o and u are carried, and x of arms follows
    v: Array  # m/s, in the piece; of damped bodies in a contact also in a step before it


class Impacts(NamedTuple):
    """One pair in all pieces, at their ends and nodes."""

    side: int
    u: Array  # (k, n + 2) m
    d: Array  # u', m/s
    force: Array  # N
    by_u: Array  # size of dF/du, N/m
    by_d: Array  # size of dF/du', N s/m
    loss: Array  # W
    noise: Array  # of u by rounding of the positions, m
    noise_d: Array  # of u', m/s
    bounce: Array  # (k, 1): mu times the speed of an impact of the segment's energy, kg m/s
    sudden: Array  # (k,) N s, what the pair exchanges within a rounding of the time at a touch


def walk(run: Trajectory, parts: int) -> float:
    """How far the roundings of the steps in one of equal parts of a run wander, in roundings of one step."""
    return math.sqrt(1.0 + float(run.work[Work.FLIGHTS] + run.work[Work.CONTACT_STEPS]) / parts)


def largest(states: Array) -> Array:
    """The largest position and the largest speed of states (n, 6), for each column (6,); what is absent counts as 0."""
    return np.asarray(np.tile(np.abs(np.nan_to_num(states).reshape(-1, 3, 2)).max(axis=(0, 1)), 3))


def largest_in_segment(detail: Detail, values: Array) -> Array:
    """The largest of values (k, ...) of all pieces of the same segment."""
    segment = detail.pieces.segment
    largest = np.zeros((int(segment.max(initial=0)) + 1, *values.shape[1:]))
    np.maximum.at(largest, segment, values)
    return np.asarray(largest[segment])


def rates(bodies: Array) -> Array:
    """How fast bodies (..., 4) swing or creep by themselves, (...) in 1/s."""
    mass, stiffness, damping, _ = np.moveaxis(bodies, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        swing = np.sqrt(np.abs(stiffness) / np.where(mass > 0.0, mass, 1.0))
        return np.asarray(np.fmin(swing, np.abs(stiffness / damping)))  # an over-damped body creeps


def sizes(detail: Detail) -> Sizes:
    """Sizes of positions and velocities; v of a swing has the digits of its amplitude, that of a fall those it had.

    In a contact an arm has the roundings of x_o, by which its spring drives it.
    """
    mass, stiffness, _, force = np.moveaxis(detail.bodies[:, None], -1, 0)
    own = largest_in_segment(detail, np.abs(detail.x).max(axis=1, keepdims=True))
    own = largest_in_segment(detail, _with_way(detail, own))  # a touch at its end puts the arm where x_o and u say
    touching, taken = np.zeros(len(own), dtype=bool), detail.bodies[..., Of.DAMPING].copy()
    for side in detail.run.scene.system.contacts:
        hertzian, loss = detail.run.scene.system.pairs[side]
        u = _closing(detail, side)[0].max(axis=1)
        touching |= u >= 0.0
        taken[:, [side, OBJECT]] += (loss * hertzian * np.maximum(u, 0.0) ** 1.5)[:, None]
    own = np.maximum(own, np.where(touching[:, None], own[..., OBJECT], 0.0)[..., None])
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.where(stiffness != 0.0, np.abs(force / stiffness), 0.0)
    swing = np.where(stiffness != 0.0, rates(detail.bodies)[:, None] * np.minimum(own + rest, 2.0 * own), np.inf)
    acting = np.abs(stiffness) * own + np.abs(force)
    acting[..., OBJECT] += detail.run.scene.system.coulomb
    gained = acting / np.where(mass > 0.0, mass, 1.0) * elapsed(detail)
    v = _before_decay(detail, np.abs(detail.v).max(axis=1), np.where(touching[:, None], taken, 0.0))[:, None]
    way = _with_way(detail, v + np.minimum(swing, gained))
    beside = np.where(touching[:, None, None], NEGLECT, EPS) * largest_in_segment(detail, v.max(axis=2, keepdims=True))
    own = own + np.where(touching[:, None, None], beside, 0.0) * elapsed(detail)  # positions with their velocities
    x_rest, v_rest = at_rest(detail)
    return Sizes(own + x_rest / EPS, way + beside + v_rest / EPS)


def at_rest(detail: Detail) -> tuple[Array, Array]:
    """Changes of position and velocity, (k, 1, 3), with which a piece may come to rest, see `exact.driver.rest`.

    As there, a spring counts k x (x + x_o): an arm that touches the object takes its place, with its roundings.
    """
    x, v = np.nan_to_num(np.abs(detail.x)), np.nan_to_num(np.abs(detail.v))
    mass, stiffness, _, force = np.moveaxis(detail.bodies[:, None], -1, 0)
    finite = np.where(np.isfinite(mass) & (mass > 0.0), mass, 1.0)
    with np.errstate(over="ignore"):
        springs = np.abs(stiffness) * x * (x + x[..., [OBJECT]])
        energy = (finite * v * v + springs + 2.0 * np.abs(force) * x).sum(axis=-1)
        for side in detail.run.scene.system.contacts:
            hertzian, u = detail.run.scene.system.pairs[side, Law.HERTZIAN], _closing(detail, side)[0]
            energy += 2.0 * stored_energy(hertzian, np.maximum(np.nan_to_num(u), 0.0))
        energy = energy.max(initial=0.0)
    slow = REST * np.sqrt(energy / finite)
    rests = v.max(axis=1, keepdims=True) <= slow
    far = REST * float(x.max(initial=0.0))
    return np.where(rests, far, 0.0) + DIED_OUT, np.where(rests, slow, 0.0) + DIED_OUT


def _before_decay(detail: Detail, v: Array, taken: Array) -> Array:
    """Speeds (k, 3), those of damped bodies in a contact no less than some time constants ago, in the same segment.

    A series in time goes so far in one step, with the roundings of its begin. `taken`: N s/m, (k, 3), by dampers and
    by the dissipation of what is pressed.
    """
    pieces, mass, found = detail.pieces, detail.bodies[..., Of.MASS], v.copy()
    damped = taken * elapsed(detail)[:, 0] > mass
    for body in np.flatnonzero(damped.any(axis=0)).tolist():
        last = np.flatnonzero(damped[:, body])
        since = pieces.begin[last] - STEP * mass[last, body] / taken[last, body]
        first = np.maximum(np.searchsorted(pieces.end, since), np.searchsorted(pieces.segment, pieces.segment[last]))
        spans = np.column_stack([first, last + 1]).ravel()  # `reduceat` wants a number behind the last
        found[last, body] = np.maximum.reduceat(np.append(v[:, body], 0.0), spans)[::2]
    return found


def _with_way(detail: Detail, own: Array) -> Array:
    """Sizes (k, ...), those behind an event no less than on the way to it, whose roundings the state there has.

    Where that way is not among the pieces, it may have been any.
    """
    begins, ends = detail.pieces.begin[1:], detail.pieces.end[:-1]
    found = own.copy()
    before = np.where((begins == ends)[:, None, None], own[:-1], own.max(axis=0))
    behind = np.isin(begins, detail.run.event_table[:, 0])[:, None, None]
    found[1:] = np.where(behind, np.maximum(own[1:], before), own[1:])
    return found


def accelerations(detail: Detail, pairs: list[Impacts], apart: bool = False) -> Array:
    """Sizes of the accelerations (k, n + 2, 3) in m/s^2, from the model; of dry friction no more than its limit.

    Terms of other signs cancel, unless each counts apart.
    """
    size = np.abs if apart else np.asarray
    mass, stiffness, damping, force = (detail.bodies[:, None, :, column]
                                       for column in (Of.MASS, Of.STIFFNESS, Of.DAMPING, Of.FORCE))
    total = size(force) + size(-stiffness * detail.x) + size(-damping * detail.v)
    for pair in pairs:
        push = pair.force if pair.side == LEFT else -pair.force
        total[..., pair.side] += size(-push)
        total[..., OBJECT] += size(push)
    total = np.abs(total)
    total[..., OBJECT] += detail.run.scene.system.coulomb
    return np.asarray(total / np.where(mass > 0.0, mass, 1.0))


def impact_speed(detail: Detail, pairs: list[Impacts]) -> Array:
    """Speeds (k, 3) in m/s that the impacts of a segment can give to its bodies."""
    momentum = np.zeros((len(detail.x), 3))
    for pair in pairs:
        momentum[:, pair.side] += pair.bounce[:, 0]
        momentum[:, OBJECT] += pair.bounce[:, 0]
    mass = detail.bodies[..., Of.MASS]
    return np.asarray(momentum / np.where(mass > 0.0, mass, 1.0))


def push_noise(detail: Detail, pairs: list[Impacts]) -> Array:
    """Speed (k,) in m/s that the roundings of the impacts give to the object from the begin of its segment on."""
    mass, pieces = detail.bodies[:, OBJECT, Of.MASS], detail.pieces
    gained = force_noise(detail, pairs) * (pieces.end - pieces.begin) / np.where(mass > 0.0, mass, 1.0)
    total = np.cumsum(gained)
    return np.asarray(total - (total - gained)[pieces.first])


def force_noise(detail: Detail, pairs: list[Impacts]) -> Array:
    """Roundings (k,) in N of the impacts on the object; where 1 + p u' nearly vanishes, far larger than the forces'."""
    return sum(((pair.by_u * pair.noise + pair.by_d * pair.noise_d).max(axis=1) for pair in pairs),
               np.zeros(len(detail.x)))


def elapsed(detail: Detail) -> Array:
    """From the begin of the segment to the end of the piece, (k, 1, 1) in s."""
    pieces = detail.pieces
    return np.asarray((pieces.end - pieces.begin[pieces.first])[:, None, None])


def impacts(detail: Detail, size: Sizes) -> list[Impacts]:
    """All pairs that can push; the force is that of `physics.model`, whatever mode was recorded."""
    found = [_impact(detail, size, side) for side in detail.run.scene.system.contacts]
    if len(found) < 2:
        return found
    left, right = found
    return [left._replace(noise_d=left.noise_d + _handed_on(detail, right)),
            right._replace(noise_d=right.noise_d + _handed_on(detail, left))]


def _handed_on(detail: Detail, pair: Impacts) -> Array:
    """Roundings of u' of a pair that the object has, (k, 1) in m/s: as far as it follows that pair's dissipation."""
    rate = pair.by_d.max(axis=1, keepdims=True) / detail.bodies[:, None, OBJECT, Of.MASS]
    return np.asarray(pair.noise_d * np.minimum(1.0, rate * elapsed(detail)[:, 0]))


def _closing(detail: Detail, side: int) -> tuple[Array, Array]:
    """u in m and u' in m/s of a pair at all nodes, (8)."""
    sign = 1.0 if side == LEFT else -1.0
    return sign * (detail.x[..., side] - detail.x[..., OBJECT]), sign * (detail.v[..., side] - detail.v[..., OBJECT])


def _impact(detail: Detail, size: Sizes, side: int) -> Impacts:
    contact, (u, d) = Contact(*detail.run.scene.system.pairs[side]), _closing(detail, side)
    force = impact_force(contact, u, d)
    noise = EPS * (size.x[..., side] + size.x[..., OBJECT])
    noise_d = EPS * (size.v[..., side] + size.v[..., OBJECT])
    deep, damped = np.maximum(u, 0.0), 1.0 + contact.dissipation * d
    near, doubt = np.maximum(u + noise, 0.0), contact.dissipation * noise_d + 2.0 * EPS  # of 1 + p u'
    slope, elastic = contact.hertzian * np.sqrt(near), contact.hertzian * (deep * np.sqrt(deep))
    by_u = 1.5 * slope * (np.maximum(damped, 0.0) + doubt)
    by_d = np.where(damped >= -MANY * doubt, contact.dissipation * near * slope, 0.0)
    loss = np.where(damped >= 0.0, contact.dissipation * elastic * d * d, elastic * -d)
    masses = detail.bodies[:, side, Of.MASS], detail.bodies[:, OBJECT, Of.MASS]
    mu = masses[0] * masses[1] / (masses[0] + masses[1])
    late, fastest = EPS * detail.pieces.end, np.abs(d).max(axis=1)
    touches = (u + noise).max(axis=1) > -late * fastest
    speed2 = (d * d + 2.0 * stored_energy(contact.hertzian, deep) / mu[:, None]).max(axis=1) * touches
    bounce = mu[:, None] * np.sqrt(largest_in_segment(detail, speed2))[:, None]
    after = (detail.pieces.kind[1:] & FIRST > 0)[:, None]  # the state at an event has the roundings of the way to it
    bounce[1:] = np.where(after, np.maximum(bounce[1:], bounce[:-1]), bounce[1:])
    caught = masses[0] * fastest if len(detail.run.scene.system.contacts) > 1 else 0.0  # by the other arm
    most = np.maximum(bounce[:, 0], caught)
    reached = np.minimum(most, late * impact_force(contact, late * fastest, fastest))
    sudden = np.where(detail.pieces.kind != INNER, reached, 0.0)
    return Impacts(side, u, d, force, by_u, by_d, loss, noise, noise_d, bounce, sudden)

"""The equations of motion in integral form over pieces of a run, with the impact force from the model alone.

    m (v1 - v0) + C int v dt + K int x dt - f T = +- int fw dt - int phi dt,  |phi| <= F, phi = F sign(v) where v != 0
    x1 - x0 = int v dt
    E1 - E0 = -int (C v^2 + F |v| + losses of the contacts) dt

Errors are in units of what rounding explains: of the states, of u = x_l - x_o and its effect on the force, of the time,
and of the quadrature, as two of its orders differ.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.impact_law import elastic_force, stored_energy
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Law, Of
from grasp_ros.physics.model import Array
from lab.oracles.rounding_bounds import (
    TINY,
    Impacts,
    Sizes,
    accelerations,
    elapsed,
    force_noise,
    impact_speed,
    impacts,
    sizes,
    walk,
)
from lab.oracles.segments import INNER, Detail

SMOOTH = 1e-6  # of its integral's size: an integrand whose quadratures differ by more is not resolved


ALL = 0.04  # of the size of an integral that is not resolved: with 100 units it may be off by four times its size


class Ledger(NamedTuple):
    """Errors of a balance in all pieces, in units of rounding, and of what quadratures miss that resolve nothing."""

    name: str
    error: Array  # (k,)
    resolved: NDArray[np.bool_]  # (k,) where the quadrature resolves the motion


def _wander(detail: Detail, values: Array) -> Array:
    """What a rounding of the times changes in an integral of values (k, n + 2, ...)."""
    late = EPS * detail.pieces.end
    steps: Array = np.abs(np.diff(values, axis=1)).sum(axis=1)
    return late.reshape(-1, *[1] * (steps.ndim - 1)) * steps


def _resolved(detail: Detail, values: Array, noise: Array | float) -> NDArray[np.bool_]:
    """Whether all quadratures agree on values (k, n + 2, ...)."""
    _, doubt = detail.integral(values)
    return np.asarray(doubt <= SMOOTH * detail.total(values) + noise)


def ledgers(detail: Detail) -> Iterator[Ledger]:
    """All balances of a run."""
    steps = walk(detail.run, max(len(detail.pieces.begin), 1))
    for ledger in _ledgers(detail):
        yield ledger._replace(error=ledger.error / steps)


def _ledgers(detail: Detail) -> Iterator[Ledger]:
    size = sizes(detail)
    pairs = impacts(detail, size)
    span = (detail.pieces.end - detail.pieces.begin)[:, None]
    present: list[int] = [body for body in (LEFT, RIGHT, OBJECT) if body in detail.run.scene.system.present]
    smooth = _resolved(detail, detail.x, EPS * size.x[:, 0] * span)
    smooth &= _resolved(detail, detail.v, EPS * size.v[:, 0] * span)
    smooth &= ~_turns(detail)[:, None]
    pushed = np.ones(len(span), dtype=bool)
    for pair in pairs:
        pushed &= _resolved(detail, pair.force, TINY + detail.total(pair.by_u * pair.noise))
    momentum, unit, held = _momentum(detail, size)
    friction = _friction(detail, pairs)
    everywhere = np.asarray(smooth[:, present].all(axis=1))
    noise = EPS * impact_speed(detail, pairs)
    yield _positions(detail, size, noise, smooth, present)
    yield _steps(detail, size, noise, accelerations(detail, pairs), smooth, present)
    yield from _bodies(detail, pairs, (momentum, unit, held), friction, (smooth, pushed), present)
    whole, doubt = momentum[:, present].sum(axis=1), unit[:, present].sum(axis=1)
    doubt = doubt + EPS * sum(pair.bounce[:, 0] for pair in pairs)
    still = np.asarray((detail.v[..., OBJECT] == 0.0).all(axis=1))  # friction is what pushes it, with its rounding
    doubt = doubt + np.where(still, force_noise(detail, pairs) * span[:, 0], 0.0)
    if pairs:
        doubt = doubt + np.where(everywhere, 0.0, ALL * held[:, present].sum(axis=1))
        yield Ledger("momentum", _beyond(whole, friction, doubt), everywhere)
    yield _energy(detail, size, pairs, everywhere & pushed)


def _momentum(detail: Detail, size: Sizes) -> tuple[Array, Array, Array]:
    """m dv + C int v dt + K int x dt - f T of each body (k, 3) in N s, its unit, and the size of these integrals."""
    mass, stiffness, damping, force = np.moveaxis(detail.bodies, -1, 0)
    x, v = detail.x, detail.v
    span = (detail.pieces.end - detail.pieces.begin)[:, None]
    moved, doubt = detail.integral(x)
    way, lag = detail.integral(v)
    change = mass * (v[:, -1] - v[:, 0]) + damping * way + stiffness * moved - force * span
    late = EPS * detail.pieces.end[:, None]
    acting = np.abs(stiffness)[:, None] * np.abs(x) + np.abs(damping)[:, None] * np.abs(v) + np.abs(force)[:, None]
    acting[..., OBJECT] += detail.run.scene.system.coulomb
    unit = EPS * (mass + np.abs(damping) * span) * size.v[:, 0]
    unit = unit + EPS * (np.abs(stiffness) * size.x[:, 0] + np.abs(force)) * span
    unit = unit + late * acting[:, [0, -1]].max(axis=1) + np.abs(stiffness) * (doubt + _wander(detail, x))
    unit = unit + np.abs(damping) * (lag + _wander(detail, v))
    held = np.abs(damping) * detail.total(v) + np.abs(stiffness) * detail.total(x) + np.abs(force) * span
    return change, unit + TINY, held


def _friction(detail: Detail, pairs: list[Impacts]) -> tuple[Array, Array]:
    """Between which impulses (k,) in N s dry friction lies; its sign is that of a velocity beyond rounding."""
    limit, v = detail.run.scene.system.coulomb, detail.v[:, 1:-1, OBJECT]
    mass, force = detail.bodies[:, OBJECT, Of.MASS], np.abs(detail.bodies[:, OBJECT, Of.FORCE])
    gained = (force + limit) * elapsed(detail)[:, 0, 0] + sum(pair.bounce[:, 0] for pair in pairs)
    noise = (EPS * gained / np.where(mass > 0.0, mass, 1.0))[:, None]
    span, turns = limit * (detail.pieces.end - detail.pieces.begin), _turns(detail)
    forth, back = (v > noise).all(axis=1) & ~turns, (v < -noise).all(axis=1) & ~turns
    return np.where(forth, span, -span), np.where(back, -span, span)


def _turns(detail: Detail) -> NDArray[np.bool_]:
    """Pieces (k,) in which an object under dry friction turns, where its velocity has a kink that nothing records."""
    v = np.sign(detail.v[..., OBJECT])
    return np.asarray((v[:, 1:] * v[:, :-1] < 0.0).any(axis=1) & (detail.run.scene.system.coulomb > 0.0))


def _beyond(change: Array, friction: tuple[Array, Array], unit: Array) -> Array:
    """How far a change of momentum is from what friction allows, in units."""
    low, high = friction
    outside = np.maximum(np.maximum(-change - high, low + change), 0.0)
    scale = unit + EPS * np.maximum(np.abs(low), np.abs(high))
    return np.asarray(outside / scale)


def _bodies(detail: Detail, pairs: list[Impacts], own: tuple[Array, Array, Array], friction: tuple[Array, Array],
            resolved: tuple[NDArray[np.bool_], NDArray[np.bool_]], present: list[int]) -> Iterator[Ledger]:
    """Momentum of each body that an impact can push; `own`: that of `_momentum`.

    An impact that is over within a rounding of the time pushes what rests in a contact beside it in that time, too.
    """
    change, scale, held = (part.copy() for part in own)
    for pair in pairs:
        impulse, doubt = detail.integral(pair.force)
        noise = detail.total(pair.by_u) * pair.noise[:, 0] + detail.total(pair.by_d) * pair.noise_d[:, 0]
        noise = noise + doubt + EPS * (impulse + pair.bounce[:, 0]) + _wander(detail, pair.force)
        noise = noise + EPS * detail.pieces.end * pair.force.max(axis=1) + pair.sudden  # each time is rounded by itself
        held += pair.sudden[:, None]
        sign = 1.0 if pair.side == LEFT else -1.0
        for body, direction in ((pair.side, sign), (OBJECT, -sign)):
            change[:, body] += direction * impulse
            scale[:, body] += noise
            held[:, body] += impulse
    zero = np.zeros(len(change))
    for body, name in ((LEFT, "left"), (OBJECT, "object"), (RIGHT, "right")):
        if body in present:
            bound = friction if body == OBJECT else (zero, zero)
            known = resolved[0][:, body] & resolved[1]
            unit = scale[:, body] + np.where(known, 0.0, ALL * held[:, body])
            yield Ledger(f"momentum, {name}", _beyond(change[:, body], bound, unit), known)


def _positions(detail: Detail, size: Sizes, noise: Array, smooth: NDArray[np.bool_], present: list[int]) -> Ledger:
    """dx = int v dt, the worst of all bodies.

    The impact forces of a contact at rest may balance; `noise` (k, 3) is what their roundings make of v.
    """
    way, doubt = detail.integral(detail.v)
    late = EPS * detail.pieces.end[:, None]
    span = (detail.pieces.end - detail.pieces.begin)[:, None]
    fastest = np.abs(detail.v).max(axis=(1, 2))[:, None]  # a touch sets u = 0, and x of the arm follows x_o
    unit = EPS * (size.x[:, 0] + size.v[:, 0] * span) + noise * span + late * fastest + doubt
    unit = unit + _wander(detail, detail.v) + TINY
    unit = unit + np.where(smooth, 0.0, ALL * detail.total(detail.v))
    error = np.abs(detail.x[:, -1] - detail.x[:, 0] - way) / unit
    return Ledger("position", error[:, present].max(axis=1), np.asarray(smooth[:, present].all(axis=1)))


def _steps(detail: Detail, size: Sizes, noise: Array, acting: Array, smooth: NDArray[np.bool_], present: list[int]
           ) -> Ledger:
    """From each output to the next a body goes as far as its velocities at both say, the worst of all bodies.

    Differences of velocities hide a swing that is faster than the outputs; the accelerations there, `acting`, do not.
    """
    step = np.maximum(np.diff(detail.t, axis=1)[..., None], TINY)
    rate = np.maximum(np.abs(np.diff(detail.v, axis=1)) / step, np.maximum(acting[:, 1:], acting[:, :-1]))
    steepest = rate.copy()  # of the neighbours, too: a velocity may turn between two outputs
    steepest[:, 1:] = np.maximum(steepest[:, 1:], rate[:, :-1])
    steepest[:, :-1] = np.maximum(steepest[:, :-1], rate[:, 1:])
    mean = 0.5 * (detail.v[:, 1:] + detail.v[:, :-1])
    beyond = np.abs(np.diff(detail.x, axis=1) - mean * step) - 0.5 * steepest * step**2
    fastest = np.abs(detail.v).max(axis=(1, 2))[:, None]
    hidden = np.minimum(EPS * size.v[:, 0], np.abs(detail.v).max(axis=1))  # v of a swing that is over is its rounding
    unit = EPS * size.x[:, 0] + EPS * detail.pieces.end[:, None] * fastest + (noise + hidden) * step.max(axis=1) + TINY
    error = np.where(smooth, beyond.max(axis=1) / unit, 0.0)[:, present].max(axis=1)
    return Ledger("position, output to output", error, np.asarray(smooth[:, present].any(axis=1)))


def _energy(detail: Detail, size: Sizes, pairs: list[Impacts], resolved: NDArray[np.bool_]) -> Ledger:
    """Kinetic, elastic and potential energy of the whole, against what dampers, friction and contacts take."""
    mass, stiffness, damping, force = np.moveaxis(detail.bodies[:, None], -1, 0)
    x, v = detail.x, detail.v
    ends = x[:, [0, -1]], v[:, [0, -1]]
    dx, dv = (part[:, 1] - part[:, 0] for part in ends)
    mean, speed = (0.5 * (part[:, 1] + part[:, 0]) for part in ends)
    level = (mass[:, 0] * dv * speed + stiffness[:, 0] * dx * mean - force[:, 0] * dx).sum(axis=1)
    taken = (damping * v * v).sum(axis=2) + detail.run.scene.system.coulomb * np.abs(v[..., OBJECT])
    unit = (mass * size.v * np.abs(v).max(axis=1, keepdims=True) + np.abs(stiffness) * size.x * size.x
            + np.abs(force) * size.x).sum(axis=(1, 2))
    held = np.abs(stiffness * x) + np.abs(force)
    power = (np.abs(v) * (held + np.abs(damping * v))).sum(axis=2).max(axis=1)
    fastest = np.abs(v).max(axis=(1, 2))  # at a touch x of the arm follows x_o
    power = power + np.where(detail.pieces.kind != INNER, fastest * held.max(axis=(1, 2)), 0.0)
    for pair in pairs:
        hertzian = detail.run.scene.system.pairs[pair.side, Law.HERTZIAN]
        deep = np.maximum(pair.u[:, [0, -1]], 0.0)
        stored = stored_energy(hertzian, deep)
        level = level + stored[:, 1] - stored[:, 0]
        taken = taken + pair.loss
        elastic = elastic_force(hertzian, np.maximum(pair.u, 0.0))
        unit = unit + stored.max(axis=1) + (elastic.max(axis=1) * pair.noise[:, 0] / EPS)
        unit = unit + pair.bounce[:, 0] * np.abs(pair.d).max(axis=1)
        unit = unit + _loss_noise(detail, pair)
        power = power + (np.maximum(elastic, np.abs(pair.force)) * np.abs(pair.d)).max(axis=1)
    lost, doubt = detail.integral(taken)
    late = EPS * detail.pieces.end * power
    unit = EPS * (unit + lost) + late + doubt + _wander(detail, taken) + TINY
    within_range = np.isfinite(unit)  # squares may leave the range of numbers
    known = resolved & _resolved(detail, taken, unit) & within_range
    within = sum(pair.sudden * np.abs(pair.d).max(axis=1) for pair in pairs)  # a rounding of the time
    most = taken.max(axis=1) * (detail.pieces.end - detail.pieces.begin)  # the nodes may lie behind all of the loss
    error = np.abs(level + lost) / (unit + np.where(known, 0.0, ALL * (most + within)))
    return Ledger("energy", np.where(within_range, error, 0.0), known)


def _loss_noise(detail: Detail, pair: Impacts) -> Array:
    """What noise of u and u' makes of the loss in a contact, in J by EPS."""
    p = detail.run.scene.system.pairs[pair.side, Law.DISSIPATION]
    rate = np.abs(pair.d) * (pair.by_u * pair.noise + pair.by_d * pair.noise_d)
    rate = rate + np.abs(pair.force) * (pair.noise_d + 0.0 * p)
    return detail.total(rate) / EPS

"""The record of a run against its states: the mode that its events say, and the time of each event."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.layout import EPS, OBJECT, Law, Of, Pair, Slide, Transition
from grasp_ros.physics.model import Array
from lab.oracles.rounding_bounds import TINY, Impacts, accelerations, impacts, push_noise, sizes
from lab.oracles.segments import Detail

BEFORE: dict[Transition, tuple[Pair | Slide, ...]] = {  # modes that an event ends
    Transition.TOUCH: (Pair.OPEN,), Transition.RELEASE: (Pair.CONTACT, Pair.CLAMPED),
    Transition.CLAMP: (Pair.CONTACT,), Transition.REENTRY: (Pair.CLAMPED,),
    Transition.STICK: (Slide.FREE,), Transition.SLIP: (Slide.STUCK,),
}
AFTER: dict[Transition, Pair | Slide] = {
    Transition.TOUCH: Pair.CONTACT, Transition.RELEASE: Pair.OPEN, Transition.CLAMP: Pair.CLAMPED,
    Transition.REENTRY: Pair.CONTACT, Transition.STICK: Slide.STUCK, Transition.SLIP: Slide.FREE,
}


class Units(NamedTuple):
    """What rounding explains of u and u' of a pair, (k, n + 2)."""

    u: Array  # m
    d: Array  # m/s


def findings(detail: Detail) -> Iterator[tuple[str, float]]:
    """The largest errors of all relations between events and states, in units of rounding."""
    size = sizes(detail)
    pairs = impacts(detail, size)
    acting = accelerations(detail, pairs, apart=True)
    for pair in pairs:
        others = [other for other in pairs if other is not pair]
        beside = sum((EPS * other.bounce + other.sudden[:, None] for other in others), np.zeros_like(pair.bounce))
        unit = _units(detail, pair, beside, acting)
        yield from _pair_modes(detail, pair, unit)
        yield from _pair_events(detail, pair, unit)
    if detail.run.scene.system.coulomb > 0.0:
        yield from _object(detail, pairs, acting)


def _units(detail: Detail, pair: Impacts, beside: Array, acting: Array) -> Units:
    """From sizes, times, and the rounding of the impact beside it (k, 1) in kg m/s, which moves the object as well."""
    late, mass = EPS * detail.t, detail.bodies[:, OBJECT, Of.MASS][:, None]
    d = pair.noise_d + beside / mass + late * (acting[..., pair.side] + acting[..., OBJECT])
    return Units(pair.noise + late * np.abs(pair.d) + TINY, d + TINY)


def _recorded(detail: Detail, body: int) -> tuple[Array, list[Transition]]:
    rows = detail.run.event_table
    rows = rows[rows[:, 1] == body]
    return rows[:, 0], [Transition(int(kind)) for kind in rows[:, 2]]


def _spans(detail: Detail, body: int, modes: tuple[int, ...]) -> Iterator[tuple[tuple[int, ...], NDArray[np.bool_]]]:
    """What a body's record says: possible modes, and the nodes (k, n + 2) at which they hold.

    Each time is rounded by itself, so nothing is said about nodes no further from an event than that.
    """
    times, kinds = _recorded(detail, body)
    number, late = np.searchsorted(times, detail.t, side="right"), EPS * detail.t
    inside = (detail.t > detail.pieces.begin[:, None]) & (detail.t < detail.pieces.end[:, None])
    inside &= np.searchsorted(times, detail.t - late) == np.searchsorted(times, detail.t + late, side="right")
    yield (BEFORE[kinds[0]] if kinds else modes), inside & (number == 0)
    after = np.array([-1, *(AFTER[kind] for kind in kinds)])[number]
    for mode in modes:
        yield (mode,), inside & (after == mode)


def _worst(detail: Detail, body: int, modes: tuple[int, ...], errors: Callable[[int], dict[str, Array]]
           ) -> Iterator[tuple[str, float]]:
    """The largest errors in each mode; at the begin those of the mode that fits best."""
    worst: dict[str, float] = {}
    by_mode = {mode: errors(mode) for mode in modes}
    for allowed, where in _spans(detail, body, modes):
        found = [{name: float(values[where].max(initial=0.0)) for name, values in by_mode[mode].items()}
                 for mode in allowed]
        for name, error in min(found, key=lambda errors: max(errors.values(), default=0.0)).items():
            worst[name] = max(worst.get(name, 0.0), error)
    for name, error in worst.items():
        yield name, error


def _pair_modes(detail: Detail, pair: Impacts, unit: Units) -> Iterator[tuple[str, float]]:
    p = detail.run.scene.system.pairs[pair.side, Law.DISSIPATION]
    beyond = -1.0 / p - pair.d if p > 0.0 else np.full_like(pair.d, -np.inf)  # > 0: separating faster than 1/p

    def errors(mode: int) -> dict[str, Array]:
        if mode == Pair.OPEN:
            return {"open, u > 0": pair.u / unit.u}
        if mode == Pair.CONTACT:
            return {"contact, u < 0": -pair.u / unit.u, "contact, u' < -1/p": beyond / unit.d}
        return {"clamped, u < 0": -pair.u / unit.u, "clamped, u' > -1/p": -beyond / unit.d}

    return _worst(detail, pair.side, (Pair.OPEN, Pair.CONTACT, Pair.CLAMPED), errors)


def _at_events(detail: Detail, times: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pieces that begin at these times, and which of the times those are."""
    begins = detail.pieces.begin
    piece = np.minimum(np.searchsorted(begins, times), len(begins) - 1)
    hit = np.flatnonzero(begins[piece] == times)
    return piece[hit], hit


def _pair_events(detail: Detail, pair: Impacts, unit: Units) -> Iterator[tuple[str, float]]:
    """u = 0 at touch and release, u' = -1/p at the others, from the state at the recorded time.

    Of several events of the pair at the same time, less than a rounding apart, it is the state at the first.
    """
    times, kinds = _recorded(detail, pair.side)
    piece, hit = _at_events(detail, times)
    alone = np.diff(times, prepend=-np.inf)[hit] > 0.0
    piece, hit = piece[alone], hit[alone]
    before = np.maximum(piece - 1, 0)  # what rounding explains comes from the way to the event
    seen = (detail.pieces.end[before] == detail.pieces.begin[piece]) | (detail.pieces.begin[piece] == 0.0)
    piece, hit, before = piece[seen], hit[seen], before[seen]
    if not len(hit):
        return
    p = detail.run.scene.system.pairs[pair.side, Law.DISSIPATION]
    through_zero = np.array([kinds[k] in (Transition.TOUCH, Transition.RELEASE) for k in hit])
    depth = np.abs(pair.u[piece, 0]) / np.maximum(unit.u[piece, 0], unit.u[before].max(axis=1))
    speed = np.full_like(depth, np.inf)
    if p > 0.0:
        speed = np.abs(pair.d[piece, 0] + 1.0 / p) / np.maximum(unit.d[piece, 0], unit.d[before].max(axis=1))
    yield "event time", float(np.where(through_zero, depth, speed).max())


def _object(detail: Detail, pairs: list[Impacts], acting: Array) -> Iterator[tuple[str, float]]:
    """An object that sticks rests, and what pushes it is within its friction; v_o = 0 where it begins or ends."""
    limit = detail.run.scene.system.coulomb
    late = EPS * detail.t
    held = detail.bodies[:, None, OBJECT, Of.FORCE]
    push = np.repeat(held, detail.t.shape[1], axis=1)
    unit = EPS * (np.abs(held) + limit) + TINY
    for pair in pairs:
        push = push + (pair.force if pair.side == 0 else -pair.force)
        speed = acting[..., pair.side] + acting[..., OBJECT]
        unit = unit + EPS * pair.force + pair.by_u * (pair.noise + late * np.abs(pair.d))
        unit = unit + pair.by_d * (pair.noise_d + late * speed)
    v = np.abs(detail.v[..., OBJECT])
    resting = {"stuck, v": np.where(v > 0.0, np.inf, 0.0), "stuck, push beyond F": (np.abs(push) - limit) / unit}
    yield from _worst(detail, OBJECT, (Slide.FREE, Slide.STUCK),
                      lambda mode: resting if mode == Slide.STUCK else {})
    times, _ = _recorded(detail, OBJECT)
    piece, hit = _at_events(detail, times)
    if len(hit):
        scale = EPS * np.abs(detail.v[piece, :, OBJECT]).max(axis=1) + late[piece, 0] * acting[piece, 0, OBJECT] + TINY
        scale = scale + push_noise(detail, pairs)[np.maximum(piece - 1, 0)]  # on the way there
        yield "event time", float((v[piece, 0] / scale).max())

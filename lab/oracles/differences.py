"""Derivatives of a run beside central differences of plain runs, which say themselves how far they can be trusted.

A central difference errs by its step, and by the roundings of the two motions over its step. Steps become smaller by
STRIDE; where two neighbours agree best, their disagreement is what is left of both.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.accuracy import FINEST
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene, SceneError
from grasp_ros.sensitivity.directions import check_key
from grasp_ros.sensitivity.sensitivities import sensitivities
from grasp_ros.simulation import simulate
from lab.cases.draw import Draw, draw_ordinary, inside

SEED = 1990
STRIDE, STEPS = 8.0, 13  # from a tenth of the number down to some 1e-12 of it
DECIDABLE = 1e-3  # of the derivative: a difference that is less certain decides nothing
FACTOR = 8.0  # by which a difference may be less certain than its neighbours show
SMALLEST = 1e-9  # of the derivative, likewise
MOST_WORK = 20_000  # of a run
AGREES, FLAGGED, REFUSED, UNDECIDED, LONG, WRONG = VERDICTS = (
    "agrees", "flagged", "refused", "not decidable", "too long", "wrong")


class Verdict(NamedTuple):
    """What became of one comparison."""

    word: str  # one of VERDICTS
    error: float = 0.0  # the largest, in what is allowed
    text: str = ""  # why it is refused, or what is wrong


def smooth_keys(scene: Scene) -> list[tuple[str, float]]:
    """Numbers of a scene by which it has derivatives, and how large a change of each is."""
    found = []
    for section, numbers in scene.values.items():
        for name, value in numbers.items():
            key, size = f"{section}.{name}", value
            try:
                check_key(scene, key)
            except Refused:
                continue
            if name in ("position_m", "velocity_m_per_s"):
                size = max(abs(own[name]) for own in scene.values.values() if name in own)
            if size != 0.0:
                found.append((key, abs(size)))
    return found


def judge_draw(number: int, make: Callable[[Draw], Scene] = draw_ordinary) -> tuple[str, Verdict]:
    """Draw a natural scene and one of its numbers, and compare; what was drawn, and what became of it."""
    rng = np.random.default_rng([SEED, number])
    scene = inside(make, rng)
    keys = smooth_keys(scene)
    key, size = keys[int(rng.integers(len(keys)))]
    return f"# draw {number}, by {key}\n{scene.to_yaml()}", judge(scene, key, size)


def judge(scene: Scene, key: str, size: float) -> Verdict:
    """Compare the derivatives of the last state of a scene by one of its numbers, whose changes are of a size."""
    if simulate(scene, grid=np.zeros(1), max_work=MOST_WORK).status is Status.WORK_BUDGET:
        return Verdict(LONG)
    try:
        found = sensitivities(scene, [key], accuracy=FINEST)
        rates = found.state_rates[-1, :, 0]
        spread = _spread(scene, key, rates)
    except Refused as refusal:
        return Verdict(REFUSED, text=str(refusal))
    if found.corner is not None:
        return Verdict(FLAGGED)
    value, doubt = _plateau(scene, key, size)
    scale, away = np.maximum(np.abs(value), np.abs(rates)), np.abs(rates - value)
    allowed = FACTOR * (doubt + spread) + SMALLEST * scale
    text, there = f"{rates} beside {value}, allowed {allowed}", np.isfinite(found.state[-1])
    if not np.isfinite(rates[there]).all():
        return Verdict(WRONG, np.inf, text)
    there &= scale > 0.0
    if not there.any():
        return Verdict(AGREES)
    error = float(np.max(away[there] / allowed[there]))
    if error > 1.0:
        return Verdict(WRONG, error, text)
    return Verdict(AGREES if (allowed <= DECIDABLE * scale)[there].any() else UNDECIDED, error, text)


def _spread(scene: Scene, key: str, rates: Array) -> Array:
    """How much the derivatives (6,) change where the places are one rounding off."""
    off, found = np.spacing(np.abs(scene.initial_state[::2]).max()), [rates]
    for way in (-off, off):
        with suppress(SceneError):
            moved = scene.changed({"object.position_m": scene.values["object"]["position_m"] + float(way)})
            found.append(sensitivities(moved, [key], accuracy=FINEST).state_rates[-1, :, 0])
    return np.asarray(np.max(np.abs(np.array(found) - rates), axis=0))


def _plateau(scene: Scene, key: str, size: float) -> tuple[Array, Array]:
    """Differences (6,), each at the step where its neighbours agree best, and how uncertain they are."""
    section, _, name = key.partition(".")
    rows, roundings = [], []
    for step in size * 0.1 * STRIDE ** -np.arange(STEPS, dtype=float):
        low, high = scene.values[section][name] - step, scene.values[section][name] + step
        with suppress(SceneError):
            ends = [simulate(scene.changed({key: float(at)}), grid=np.array([scene.duration]), accuracy=FINEST)
                    for at in (low, high)]
            if all(end.status is Status.DONE for end in ends):
                rows.append((ends[1].state[-1] - ends[0].state[-1]) / (high - low))
                roundings.append(np.spacing(np.abs(ends[0].state[-1])) / (high - low))
    if len(rows) < 3:
        return np.full(6, np.nan), np.full(6, np.inf)
    changes = np.abs(np.diff(rows, axis=0))
    doubt = np.nan_to_num(np.maximum(changes[:-1], changes[1:]) + roundings[1:-1], nan=np.inf)
    best = np.argmin(doubt, axis=0)
    return np.array(rows)[1:-1][best, range(6)], doubt[best, range(6)]

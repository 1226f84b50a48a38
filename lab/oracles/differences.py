"""Derivatives of a run beside central differences of plain runs, which say themselves how far they can be trusted.

A central difference errs by its step, and by the roundings of the two motions over its step. Steps become smaller by
STRIDE; where two neighbours agree best, their disagreement is what is left of both.
"""

from __future__ import annotations

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.accuracy import FINEST
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene, SceneError
from grasp_ros.sensitivity.directions import check_key
from grasp_ros.simulation import Trajectory, simulate
from grasp_ros.simulation.differentiate import differentiate
from lab.cases.draw import draw_ordinary, inside

SEED = 1990
STRIDE, STEPS = 8.0, 13  # from a tenth of the number down to some 1e-12 of it
DECIDABLE = 1e-3  # of the derivative: a difference that is less certain decides nothing
FACTOR = 8.0  # by which a difference may be less certain than its neighbours show
SMALLEST = 1e-9  # of the derivative, likewise
BEND = 0.1  # of the derivative: where one-sided differences disagree by more, steps are too long
MOST_WORK = 20_000  # of a run
AGREES, WRONG = DECIDED = "agrees", "wrong"
FLAGGED, REFUSED, UNDECIDED, LONG = "flagged", "refused", "not decidable", "too long"


class Verdict(NamedTuple):
    """What became of one comparison."""

    word: str  # one of DECIDED, or why nothing is
    error: float = 0.0  # the largest, in what is allowed
    text: str = ""  # what was compared
    reason: str = ""  # why it is refused or flagged


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


def judge_draw(number: int) -> tuple[str, Verdict]:
    """Draw a natural scene and one of its numbers, and compare; what was drawn, and what became of it."""
    rng = np.random.default_rng([SEED, number])
    scene = inside(draw_ordinary, rng)
    keys = smooth_keys(scene)
    key, size = keys[int(rng.integers(len(keys)))]
    return f"# draw {number}, by {key}\n{scene.to_yaml()}", judge(scene, key, size)


def judge(scene: Scene, key: str, size: float) -> Verdict:
    """Compare the derivatives of the last state of a scene by one of its numbers, whose changes are of a size."""
    if simulate(scene, grid=np.zeros(1), max_work=MOST_WORK).status is Status.WORK_BUDGET:
        return Verdict(LONG)
    try:
        found = differentiate(_run(scene), [key])
        rates = found.state_rates[-1, :, 0]
        spread = _spread(scene, key, rates)
    except Refused as refusal:
        return Verdict(REFUSED, reason=str(refusal).removeprefix(f"{scene.name}: ").partition(";")[0])
    if found.corner is not None:
        return Verdict(FLAGGED, reason=found.corner_reason or "")
    there = np.isfinite(found.state[-1])
    if not np.isfinite(rates[there]).all():
        return Verdict(WRONG, np.inf, f"{rates}")
    near = _plateau(scene, key, size)
    scale, away = np.maximum(np.abs(near.value), np.abs(rates)), np.abs(rates - near.value)
    allowed = FACTOR * (near.doubt + spread) + SMALLEST * scale
    text = f"{rates} beside {near.value}, allowed {allowed}"
    there &= scale > 0.0
    if not there.any():
        return Verdict(AGREES)
    error = float(np.max(away[there] / allowed[there]))
    seen = (near.bend <= BEND * scale) & (np.abs(rates) * near.smallest <= np.abs(found.state[-1]))
    if error > 1.0 and seen[there & (away > allowed)].any():
        return Verdict(WRONG, error, text)
    decided = there & seen & (allowed <= DECIDABLE * scale)
    return Verdict(AGREES if error <= 1.0 and decided.any() else UNDECIDED, error, text)


def _run(scene: Scene) -> Trajectory:
    return simulate(scene, grid=np.array([scene.duration]), setting=FINEST)


def _spread(scene: Scene, key: str, rates: Array) -> Array:
    """How much the derivatives (6,) change where the positions are one rounding off."""
    off, found = np.spacing(np.abs(scene.initial_state[::2]).max()), [rates]
    for way in (-off, off):
        with suppress(SceneError):
            moved = scene.changed({"object.position_m": scene.values["object"]["position_m"] + float(way)})
            found.append(differentiate(_run(moved), [key]).state_rates[-1, :, 0])
    return np.asarray(np.max(np.abs(np.array(found) - rates), axis=0))


class _Plateau(NamedTuple):
    """Differences (6,), each at the step where its neighbours agree best."""

    value: Array
    doubt: Array  # how uncertain they are
    bend: Array  # by how much the two one-sided differences disagree there
    smallest: float  # step


def _plateau(scene: Scene, key: str, size: float) -> _Plateau:
    section, _, name = key.partition(".")
    middle = scene.values[section][name]
    here = _end(scene)
    rows, roundings, bends = [], [], []
    for step in size * 0.1 * STRIDE ** -np.arange(STEPS, dtype=float):
        low, high = middle - step, middle + step
        with suppress(SceneError):
            below, above = (_end(scene.changed({key: float(at)})) for at in (low, high))
            rows.append((above - below) / (high - low))
            bends.append(np.abs((above - here) / (high - middle) - (here - below) / (middle - low)))
            roundings.append(np.tile(np.spacing([np.nanmax(np.abs(here[kind::2])) for kind in (0, 1)]), 3) / step)
    if len(rows) < 3:
        return _Plateau(np.full(6, np.nan), np.full(6, np.inf), np.full(6, np.inf), 0.0)
    changes = np.abs(np.diff(rows, axis=0))
    doubt = np.nan_to_num(np.maximum(changes[:-1], changes[1:]) + roundings[1:-1], nan=np.inf)
    best = np.argmin(doubt, axis=0), range(6)
    return _Plateau(np.array(rows)[1:-1][best], doubt[best], np.array(bends)[1:-1][best], float(step))


def _end(scene: Scene) -> Array:
    """The last state (6,) of a run; NaN: it does not get there."""
    run = _run(scene)
    return np.asarray(run.state[-1] if run.status is Status.DONE else np.full(6, np.nan))

"""Other scenes whose runs must be related to the first: the mirror image, other units, short control periods."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Of, Work
from grasp_ros.physics.model import Array, penetration
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation import Trajectory
from lab.cases.case import Product
from lab.oracles.metamorphic import SWAPPED, mirrored, scaled
from lab.oracles.rounding_bounds import TINY, largest

UNITS = 4.0, 2.0, 0.5  # of length, time and mass
PERIODS = 16, 64, 256  # control periods in runs that tend to continuous feedback
LONGEST = 1e4  # s, of such runs: a control period has its limit
NOISE, FAR = 1e-10, 0.2  # distances from it, relative, that say nothing
FALLS = 0.5  # part of the distance that may be left at a sixteenth of the period
SHALLOW = 1e-85  # m or m/s: below, what a touch moves, like u^3.5, may be denormal, and in other units other numbers
FEW, SOME = 10, 100  # events and contact steps, beyond which a distance may grow by itself


def mirror(run: Trajectory, product: Product) -> Iterator[tuple[str, float]]:
    """States and events seen from the other side, to the bit; noise and sines have no mirror image."""
    scene = run.scene
    if any(section.endswith(("_sensor", "_sine")) for section in scene.values):
        return
    image = product.run(mirrored(scene), run.t[[0, -1]])
    own, other = run.event_table, image.event_table.copy()
    other[:, 1] = np.array([RIGHT, LEFT, OBJECT], dtype=float)[other[:, 1].astype(int)]
    same = _sorted(own) == _sorted(other) and _equal(run.state[-1], -image.state[-1][SWAPPED])
    yield "mirror", float(not same)


def units(run: Trajectory, product: Product, smallest: float) -> Iterator[tuple[str, float]]:
    """States and events in other units, O7, to the bit."""
    if smallest < SHALLOW:
        return
    length, time, mass = UNITS
    try:
        image = scaled(run.scene, length, time, mass)
    except Refused:  # a number leaves its range
        return
    other = product.run(image, time * run.t[[0, -1]])
    own = run.event_table * np.array([time, 1.0, 1.0, length, length / time])
    state = run.state[-1] * np.array([length, length / time] * 3)
    yield "scaling", float(not (_sorted(own) == _sorted(other.event_table) and _equal(state, other.state[-1])))


def _sorted(table: Array) -> list[list[float]]:
    """Rows of events in an order that does not depend on which side is looked at first."""
    return sorted(row.tolist() for row in table)


def _equal(one: Array, other: Array) -> bool:
    return bool(np.array_equal(np.nan_to_num(one), np.nan_to_num(other)))


def short_periods(run: Trajectory, product: Product) -> Iterator[tuple[str, float]]:
    """Commands held ever shorter tend to continuous feedback: the distance falls with the period.

    Over a time constant of the feedback at most, within which the longest period is short; where the distance does not
    fall, over one of the fastest swing or impact, which a longer period may step over.
    """
    system = run.scene.system
    if run.scene.sampled or system.external or not system.laws:
        return
    feedback = max(
        _rate(system.bodies[side, Of.MASS], law.position_gain, law.velocity_gain) for side, law in system.laws.items()
    )
    left = _left_of_distance(run, product, feedback)
    if left is not None and left > FALLS:
        left = _left_of_distance(run, product, max(feedback, _fastest_rate(run)))
    if left is not None:
        yield "short periods", left


def _left_of_distance(run: Trajectory, product: Product, rate: float) -> float | None:
    """The distance at the shortest period by the largest at a longer one, over 1 / `rate` in s: 1/16 in theory.

    None where they are rounding, or large. At one period an early and a late impact may cancel, so that one distance
    alone says nothing.
    """
    scene = run.scene
    base = int(min(LONGEST, scene.duration, 1.0 / rate if rate > 0.0 else math.inf) * NANOSECONDS / PERIODS[-1])
    if base < 1:
        return None
    seconds = base * PERIODS[-1] / NANOSECONDS

    def part(periods: int, sampled: bool) -> Trajectory:
        numbers = {"time.duration_s": seconds, "time.control_period_s": round(seconds / periods, 9)}
        return product.run(scene.changed(numbers), [0.0, seconds], sampled=sampled)

    continuous = part(PERIODS[-1], False)
    if len(continuous.event_table) > FEW or continuous.work[Work.CONTACT_STEPS] > SOME:
        return None
    size = largest(continuous.state) + TINY
    *longer, last = (
        float(np.nanmax(np.abs(part(periods, True).state[-1] - continuous.state[-1]) / size)) for periods in PERIODS
    )
    if last > NOISE + _cancelled(continuous) / size[1] and longer[0] < FAR:
        return last / max(longer)
    return None


def _cancelled(run: Trajectory) -> float:
    """Speed in m/s that roundings of a feedback around its set-point bring, or of impacts that balance each other."""
    system, speed = run.scene.system, 0.0
    mass, duration = system.bodies[:, Of.MASS], run.scene.duration
    depths, rates = _deepest(run), np.abs(np.nan_to_num(penetration(run.state)[1::2])).max(axis=1)
    for side in system.contacts:
        (hertzian, loss), depth, rate = system.pairs[side], depths[side], rates[side]
        force = hertzian * depth**1.5 * (1.0 + loss * rate)
        speed = max(speed, 16.0 * EPS * force * duration / min(mass[side], mass[OBJECT]))
    for side, law in system.laws.items():
        place = np.abs(run.state[:, COLUMN[side]]).max() + abs(law.set_point)
        force = abs(law.position_gain) * place + abs(law.feed_forward)
        speed = max(speed, 16.0 * EPS * force * duration / mass[side])
    return speed


def _deepest(run: Trajectory) -> Array:
    """The largest penetration at an output time of each pair, (2,) in m; 0 of one that never touches."""
    found: Array = np.maximum(np.nan_to_num(penetration(run.state)[::2]), 0.0).max(axis=1)
    return found


def _rate(mass: float, stiffness: float, damping: float) -> float:
    """The fastest rate, in 1/s, of a mass with a spring and a damper, or a feedback in their place."""
    return float(max(math.sqrt(abs(stiffness) / mass), abs(damping) / mass))


def _fastest_rate(run: Trajectory) -> float:
    """Of the bodies by themselves, and of the impacts as deep as the ends or the events bring them, in 1/s."""
    system = run.scene.system
    bodies = system.bodies[system.present]
    mass, fastest = bodies[:, Of.MASS], [_rate(*row) for row in bodies[:, :Of.FORCE].tolist()]
    depths = _deepest(run)
    for side in system.contacts:
        (hertzian, loss), speed = system.pairs[side], np.abs(run.event_table[:, 4]).max(initial=0.0)
        depth = max(depths[side], (1.25 * mass.max() * speed**2 / hertzian) ** 0.4)
        fastest += [np.sqrt(1.5 * hertzian * np.sqrt(depth) / mass.min()), hertzian * loss * depth**1.5 / mass.min()]
    return float(np.max(fastest))

"""The domain: which scenes are simulated. What lies outside is refused, with the key, its value and what is allowed.

`RANGES` are bounds of single numbers, in SI; `grasp_ros.scene.effects` takes the ranges of its keys from them. `RULES`
are ratios of several numbers, measured on systems as arrays; a row is a scene, so that an ensemble is checked at once.
A shorter run of a scene inside is inside as well.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    EPS,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
)
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System

LARGEST_POSITION = 1e12  # m, that a run may reach
LARGEST_SPEED = 1e12  # m/s
SMALLEST = 1e-30  # of any number of a scene that is not 0, in SI


class Range(NamedTuple):
    """Bounds of one kind of number."""

    text: str
    low: float
    high: float
    unit: str
    why: str


MASS_RANGE = Range("mass", 1e-12, 1e9, "kg", "from a grain of dust to a wall that does not move")
POSITION_RANGE = Range("position or set-point", -1e9, 1e9, "m", "a thousandth of what a run may reach")
SPEED_RANGE = Range("velocity", -1e9, 1e9, "m/s", "a thousandth of what a run may reach")
SPRING_RANGE = Range("stiffness of an arm", 0.0, 1e12, "N/m", "1 nm under 1 kN")
DAMPER_RANGE = Range("damping, drag", 0.0, 1e12, "N s/m", "1 nm/s under 1 kN")
POSITION_GAIN_RANGE = Range("position gain", -1e12, 1e12, "N/m", "as the springs")
VELOCITY_GAIN_RANGE = Range("velocity gain", -1e12, 1e12, "N s/m", "as the dampers")
FORCE_RANGE = Range("force", -1e12, 1e12, "N", "what the stiffest spring exerts over 1 m")
HERTZ_RANGE = Range("Hertzian stiffness H", 1e-6, 1e15, "N/m^1.5", "a sphere of diamond as large as a house has 1e13")
DISSIPATION_RANGE = Range("dissipation p", 0.0, 1e12, "s/m", "what is too large depends on speed and force: see below")
RANGES = (
    MASS_RANGE, POSITION_RANGE, SPEED_RANGE, SPRING_RANGE, DAMPER_RANGE, POSITION_GAIN_RANGE, VELOCITY_GAIN_RANGE,
    FORCE_RANGE, HERTZ_RANGE, DISSIPATION_RANGE,
)


class Rows:
    """Systems of n scenes over one duration, and what the rules make of them.

    Parameters
    ----------
    bodies : array (n, 3, 4)
        With the continuous feedback in them, see `System.closed_loop`; mass 0: no such body.
    pairs : array (n, 2, 2)
        See `System`.
    state : array (n, 6), m and m/s
    duration : float, s
    """

    def __init__(self, bodies: Array, pairs: Array, state: Array, duration: float) -> None:
        self._bodies, self._pairs, self._duration = bodies, pairs, duration
        self.there = bodies[..., MASS] > 0.0
        self.mass = np.where(self.there, bodies[..., MASS], 1.0)
        by_body = [0, 2, 1]  # of the columns of a state
        self.x, self.v = state[:, 0::2][:, by_body], state[:, 1::2][:, by_body]
        self.touching = (pairs[..., HERTZIAN] > 0.0) & self.there[:, :OBJECT] & self.there[:, OBJECT:]

    @cached_property
    def rate(self) -> Array:
        """The faster of sqrt(k/m) and c/m of each body, (n, 3) in 1/s."""
        return np.maximum(np.sqrt(self._bodies[..., STIFFNESS] / self.mass), self._bodies[..., DAMPING] / self.mass)

    @cached_property
    def speed(self) -> Array:
        """What each body reaches by its own spring and constant force, (n, 3) in m/s."""
        force = self._bodies[..., FORCE] - self._bodies[..., STIFFNESS] * self.x
        return np.abs(self.v) + np.abs(force) / self.mass / np.maximum(self.rate, 1.0 / self._duration)

    @cached_property
    def reduced(self) -> Array:
        """Reduced masses of the pairs, (n, 2) in kg."""
        arm, body = self.mass[:, :OBJECT], self.mass[:, OBJECT:]
        return arm / (1.0 + arm / body)

    @cached_property
    def gap(self) -> Array:
        """Positive where a pair is apart, (n, 2) in m."""
        return (self.x[:, OBJECT:] - self.x[:, :OBJECT]) * (1.0, -1.0)

    @cached_property
    def elastic(self) -> Array:
        """Elastic force of the pairs at the start, (n, 2) in N."""
        return self._pairs[..., HERTZIAN] * np.maximum(-self.gap, 0.0) ** 1.5 * self.touching

    @cached_property
    def pressed(self) -> Array:
        """Constant force through the pairs if all that is in contact were one rigid body there, (n, 2) in N."""
        push = self._bodies[..., FORCE] - self._bodies[..., STIFFNESS] * self.x[:, OBJECT:]
        push, mass = push.copy(), self.mass.copy()
        push[:, :OBJECT] *= self.touching
        mass[:, :OBJECT] *= self.touching
        common = push.sum(axis=1) / mass.sum(axis=1)  # acceleration
        inward = (push - mass * common[:, None])[:, :OBJECT] * (1.0, -1.0)
        return np.maximum(inward, 0.0) * self.touching

    def gaps(self) -> Array:
        """Gap or penetration by a rounding of the largest position, (n, 2)."""
        return np.abs(self.gap) / _rounding(self.x) * self.touching

    def closing(self) -> Array:
        """Relative speed by a rounding of the largest speed, (n, 2)."""
        return np.abs(self.v[:, :OBJECT] - self.v[:, OBJECT:]) / _rounding(self.v) * self.touching

    def masses(self) -> Array:
        """Mass of an arm by that of the object, (n, 2)."""
        return self.mass[:, :OBJECT] / self.mass[:, OBJECT:] * (self.there[:, :OBJECT] & self.there[:, OBJECT:])

    def turns(self) -> Array:
        """Rate times duration, (n, 3)."""
        return self.rate * self._duration * self.there

    def speeds(self) -> Array:
        """What each body reaches by itself, (n, 3) in m/s."""
        return self.speed * self.there

    def thrown(self) -> Array:
        """Speed at which a pair that starts pressed in is pushed apart, (n, 2) in m/s."""
        return np.sqrt(0.8 * self.elastic * np.maximum(-self.gap, 0.0) / self.reduced)

    def losses(self) -> Array:
        """The dissipation p times the speeds of arm and object, (n, 2)."""
        return self._pairs[..., DISSIPATION] * (self.speed[:, :OBJECT] + self.speed[:, OBJECT:]) * self.touching

    def relaxations(self) -> Array:
        """How many times p F / mu a pair is pressed for, (n, 2): from its start outwards, and for the whole run."""
        loss = self._pairs[..., DISSIPATION]
        outward = np.minimum(self._duration, 0.4 * loss * np.maximum(-self.gap, 0.0))
        return loss / self.reduced * (self.elastic * outward + self.pressed * self._duration)


def _rounding(numbers: Array) -> Array:
    largest = np.abs(numbers).max(axis=1, keepdims=True)
    return np.where(largest > 0.0, EPS * largest, 1.0)


class Rule(NamedTuple):
    """A bound of a ratio: 0, or from `low` to `high`."""

    text: str
    low: float
    high: float
    unit: str
    why: str
    keys: tuple[str, ...]  # of the scene, one for each column of the measure
    measure: Callable[[Rows], Array]

    @property
    def allowed(self) -> str:
        """The bound in words."""
        unit = f" {self.unit}" if self.unit else ""
        parts = [f"at least {self.low:g}"] * (self.low > 0.0) + [f"at most {self.high:g}"] * (self.high < np.inf)
        return ("0, or " if self.low > 0.0 else "") + " and ".join(parts) + unit


def _arms(key: str) -> tuple[str, ...]:
    return f"left_{key}", f"right_{key}"


RULES = (
    Rule("gap or penetration of a pair, in roundings of the largest position", 1e-3, np.inf, "",
         "a gap far below the rounding of its positions has no meaning", _arms("arm.position_m"), Rows.gaps),
    Rule("relative speed of a pair, in roundings of the largest speed", 1e-3, np.inf, "",
         "a speed far below the rounding of the velocities has no meaning", _arms("arm.velocity_m_per_s"),
         Rows.closing),
    Rule("mass of an arm, in masses of the object", 1e-12, 1e12, "",
         "an impact still moves the heavier one by four digits of a rounded velocity", _arms("arm.mass_kg"),
         Rows.masses),
    Rule("sqrt(k/m) or c/m of a body, times the duration", 0.0, 1e12, "",
         "one rounding of the rate turns the phase at the end by 1e-4", ("time.duration_s",) * 3, Rows.turns),
    Rule("speed that a body reaches by its spring and its constant force", 0.0, 1e10, "m/s",
         "a hundredth of what a run may reach", ("left_arm.mass_kg", "right_arm.mass_kg", "object.mass_kg"),
         Rows.speeds),
    Rule("speed at which a pair that starts pressed in is pushed apart", 0.0, 1e10, "m/s",
         "a hundredth of what a run may reach", _arms("arm.position_m"), Rows.thrown),
    Rule("p times the speeds of arm and object", 0.0, 1e6, "",
         "an impact leaves a part of 1/(p v) of its speed and takes p v / 15 Taylor steps",
         _arms("contact.dissipation_s_per_m"), Rows.losses),
    Rule("p F / mu times how long a pair is pressed by F", 0.0, 1e9, "",
         "a pressed pair takes a fifteenth of that in Taylor steps, and a run may take 1e8",
         _arms("contact.dissipation_s_per_m"), Rows.relaxations),
)


class Outside(NamedTuple):
    """A number that puts a scene outside."""

    rule: Rule
    key: str
    measured: float


def outside(system: System, duration: float) -> Outside | None:
    """The first rule that a system breaks over a duration in s, or None."""
    rows = Rows(system.closed_loop[None], system.pairs[None], system.state[None], duration)
    for rule in RULES:
        measured = rule.measure(rows)
        wrong = _breaks(rule, measured)[0]
        if wrong.any():
            column = int(wrong.argmax())
            return Outside(rule, rule.keys[column], float(measured[0, column]))
    return None


def outside_rows(rows: Rows) -> Array:
    """Which of n systems break a rule, (n,) of bool."""
    return np.any([_breaks(rule, rule.measure(rows)).any(axis=1) for rule in RULES], axis=0)


def _breaks(rule: Rule, measured: Array) -> Array:
    return ~((measured == 0.0) | ((measured >= rule.low) & (measured <= rule.high)))

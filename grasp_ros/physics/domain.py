"""The domain: which scenes are simulated. What lies outside is refused, with the key, its value and what is allowed.

`RANGES` are bounds of single numbers, in SI; `grasp_ros.scene.effects` takes the ranges of its keys from them. `RULES`
are ratios of several numbers, measured on systems as arrays; a row is a scene, so that an ensemble is checked at once.
A shorter run of a scene inside is inside as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.impact_law import EXPONENT, STORED, elastic_force, stored_energy
from grasp_ros.physics.layout import EPS, OBJECT, Law, Of
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System

LARGEST_POSITION = 1e12  # m, that a run may reach
LARGEST_SPEED = 1e12  # m/s
SMALLEST = 1e-36  # in SI, of a number that is not 0; a position or a velocity may decay to any
SIGNS = np.array([1.0, -1.0])  # of what points to the object, by side
PART = 1e-3  # of a rounding, that a gap is at least
CONSTANTS = 40.0  # time constants, after which a motion is at rest: e^-40 is less than a rounding


class Range(NamedTuple):
    """Bounds of one kind of number."""

    low: float
    high: float
    unit: str
    why: str

    @property
    def bounds(self) -> tuple[float, float]:
        """The smallest and the largest number allowed."""
        return self.low, self.high


RANGES = {
    "mass": Range(1e-12, 1e9, "kg", "from a grain of dust to a wall that does not move"),
    "position, set-point": Range(-1e9, 1e9, "m", "a thousandth of what a run may reach"),
    "velocity": Range(-1e9, 1e9, "m/s", "a thousandth of what a run may reach"),
    "stiffness of an arm": Range(0.0, 1e12, "N/m", "1 nm under 1 kN"),
    "damping, drag": Range(0.0, 1e12, "N s/m", "1 nm/s under 1 kN"),
    "position gain": Range(-1e12, 1e12, "N/m", "as the springs"),
    "velocity gain": Range(-1e12, 1e12, "N s/m", "as the dampers"),
    "force": Range(-1e12, 1e12, "N", "what the stiffest spring exerts over 1 m"),
    "gravity": Range(0.0, 1e3, "m/s^2", "some hundred times that of the earth"),
    "Hertzian stiffness H": Range(1e-6, 1e15, "N/m^1.5", "harder than a sphere of diamond as large as a house"),
    "dissipation p": Range(0.0, 1e12, "s/m", "how much is too much depends on the impulse, see below"),
    "duration": Range(0.0, 1e9, "s", "some 30 years"),
    "control period": Range(0.0, 1e3, "s", "a command that is held for longer controls nothing"),
}


class Systems:
    """Arrays of n systems, one a row, over one duration in s, and what the rules measure of them.

    Bodies (n, 3, 4) have the continuous feedback in them, see `System.closed_loop`, and mass 0 where there is none;
    pairs are (n, 2, 2), states (n, 6) in m and m/s.
    """

    def __init__(self, bodies: Array, pairs: Array, state: Array, duration: float) -> None:
        self._bodies, self._pairs, self.duration = bodies, pairs, duration
        self.there = bodies[..., Of.MASS] > 0.0
        self.mass = np.where(self.there, bodies[..., Of.MASS], 1.0)
        by_body = [0, 2, 1]  # of the columns of a state
        self.x, self.v = state[:, 0::2][:, by_body], state[:, 1::2][:, by_body]
        self.touching = (pairs[..., Law.HERTZIAN] > 0.0) & self.there[:, :OBJECT] & self.there[:, OBJECT:]

    @cached_property
    def swing(self) -> Array:
        """sqrt(k/m) of each body, (n, 3) in 1/s."""
        return np.sqrt(self._bodies[..., Of.STIFFNESS] / self.mass)

    @cached_property
    def speed(self) -> Array:
        """What each body reaches by its own spring and constant force, (n, 3) in m/s."""
        force = self._bodies[..., Of.FORCE] - self._bodies[..., Of.STIFFNESS] * self.x
        rate = np.maximum(self.swing, self._bodies[..., Of.DAMPING] / self.mass)
        return np.abs(self.v) + np.abs(force) / self.mass / np.maximum(rate, 1.0 / self.duration)

    @cached_property
    def reduced(self) -> Array:
        """Reduced masses of the pairs, (n, 2) in kg."""
        arm, body = self.mass[:, :OBJECT], self.mass[:, OBJECT:]
        return arm / (1.0 + arm / body)

    @cached_property
    def gap(self) -> Array:
        """Positive where a pair is apart, (n, 2) in m."""
        return np.asarray((self.x[:, OBJECT:] - self.x[:, :OBJECT]) * SIGNS)

    @cached_property
    def pressed(self) -> Array:
        """Constant force of each pair if all bodies with contacts were one rigid body at x_o, (n, 2) in N."""
        push = self._bodies[..., Of.FORCE] - self._bodies[..., Of.STIFFNESS] * self.x[:, OBJECT:]
        mass = self.mass.copy()
        push[:, :OBJECT] *= self.touching
        mass[:, :OBJECT] *= self.touching
        common = push.sum(axis=1) / mass.sum(axis=1)  # acceleration
        inward: Array = (push - mass * common[:, None])[:, :OBJECT] * SIGNS
        return np.maximum(inward, 0.0) * self.touching

    @cached_property
    def pressing(self) -> Array:
        """Time for which `pressed` moves a pair, (n, 2) in s: until springs and dampers of the arms hold it at rest."""
        arms = self._bodies[:, :OBJECT] * self.touching[..., None]
        damping, stiffness = arms[..., Of.DAMPING].sum(axis=1), arms[..., Of.STIFFNESS].sum(axis=1)
        mass = self.mass.sum(axis=1)
        law = np.where(self.touching[..., None], self._pairs, 1.0)
        depth = (self.pressed / law[..., Law.HERTZIAN]) ** (1.0 / EXPONENT)
        with np.errstate(divide="ignore", invalid="ignore"):
            together = np.where(stiffness > 0.0, 2.0 * mass / damping + damping / stiffness, np.inf)
        return np.minimum(self.duration, CONSTANTS * (together[:, None] + law[..., Law.DISSIPATION] * depth / EXPONENT))

    def gaps(self) -> Array:
        """Gap or penetration in roundings of the largest position, (n, 2)."""
        return np.abs(self.gap) / _rounding(self.x) * self.touching

    def closing(self) -> Array:
        """Relative speed where there is no gap, by a rounding of the largest speed, (n, 2)."""
        closed = self.touching & (self.gap == 0.0)
        return np.asarray(np.abs(self.v[:, :OBJECT] - self.v[:, OBJECT:]) / _rounding(self.v) * closed)

    def thrown(self) -> Array:
        """Speed at which a pair that starts pressed in is pushed apart, (n, 2) in m/s."""
        stored = stored_energy(self._pairs[..., Law.HERTZIAN], np.maximum(-self.gap, 0.0)) * self.touching
        return np.asarray(np.sqrt(2.0 * stored / self.reduced))

    def impulses(self) -> Array:
        """Largest p J / mu, (n, 2): J from the approach, a start pressed in, and constant forces.

        A pair pressed by the force F relaxes at the rate p F / mu, so this counts relaxation times: p F t / mu where F
        presses for a time t, and p v for an impact at v that loses all of v.
        """
        loss, depth = self._pairs[..., Law.DISSIPATION], np.maximum(-self.gap, 0.0)
        elastic: Array = elastic_force(self._pairs[..., Law.HERTZIAN], depth) * self.touching
        outward = np.minimum(self.duration, loss / STORED * depth)  # s, separating at 1/p
        force = elastic * outward + self.pressed * self.pressing
        return loss * self.touching * (self.speed[:, :OBJECT] + self.speed[:, OBJECT:] + force / self.reduced)


def _rounding(numbers: Array) -> Array:
    """Rounding of the largest of three numbers (n, 3), at least SMALLEST / PART: (n, 1)."""
    return np.asarray(np.maximum(EPS * np.abs(numbers).max(axis=1, keepdims=True), SMALLEST / PART))


class Rule(NamedTuple):
    """A ratio is 0 (absent body, no gap, no speed) or from `low` to `high`."""

    text: str
    low: float
    high: float
    unit: str
    why: str
    keys: tuple[str, ...]  # of the scene, one for each column of the measure
    measure: Callable[[Systems], Array]

    @property
    def allowed(self) -> str:
        """The bound in words."""
        unit = f" {self.unit}" if self.unit else ""
        parts = [f"at least {self.low:g}"] * (self.low > 0.0) + [f"at most {self.high:g}"] * (self.high < np.inf)
        return ("0, or " if self.high == np.inf else "") + " and ".join(parts) + unit


def _arms(key: str) -> tuple[str, ...]:
    return f"left_{key}", f"right_{key}"


RULES = (
    Rule("gap or depth of a pair, in roundings of the largest position", PART, np.inf, "",
         f"a smaller one cannot be distinguished from 0 next to the positions, nor can one below {SMALLEST:g} m",
         _arms("arm.position_m"), Systems.gaps),
    Rule("relative speed of a pair without a gap, in roundings of the largest speed", PART, np.inf, "",
         f"a smaller one cannot be distinguished from 0 next to the velocities, nor can one below {SMALLEST:g} m/s",
         _arms("arm.velocity_m_per_s"), Systems.closing),
    Rule("mass of the arm / mass of the object", 1e-12, 1e12, "",
         "four digits are left of the velocity that an impact gives the heavier body", _arms("arm.mass_kg"),
         lambda rows: rows.mass[:, :OBJECT] / rows.mass[:, OBJECT:] * rows.touching),
    Rule("sqrt(k/m) of a body x duration", 0.0, 1e12, "",
         "one rounding of sqrt(k/m) shifts the phase at the end by 1e-4", ("time.duration_s",) * 3,
         lambda rows: rows.swing * rows.duration * rows.there),
    Rule("speed that a body reaches by its start, spring and constant force", 0.0, 1e10, "m/s",
         "a hundredth of what a run may reach", ("left_arm.mass_kg", "right_arm.mass_kg", "object.mass_kg"),
         lambda rows: rows.speed * rows.there),
    Rule("speed at which a pair that starts pressed in separates", 0.0, 1e10, "m/s",
         "a hundredth of what a run may reach", _arms("arm.position_m"), Systems.thrown),
    Rule("p J / mu of a pair, with J its impulse and mu its reduced mass", 0.0, 1e8, "",
         "at the bound a run takes a fifteenth as many Taylor steps, some ten seconds",
         _arms("contact.dissipation_s_per_m"), Systems.impulses),
)


def outside(system: System, duration: float) -> tuple[Rule, str, float] | None:
    """The first rule that a system breaks over a duration in s, the key, and what was measured; or None."""
    rows = Systems(system.closed_loop[None], system.pairs[None], system.state[None], duration)
    for rule, measured, wrong in _ruled(rows):
        if wrong.any():
            column = int(wrong.argmax())
            return rule, rule.keys[column], float(measured[0, column])
    return None


def outside_rows(rows: Systems) -> NDArray[np.bool_]:
    """Which of n systems break a rule, (n,)."""
    return np.asarray(np.logical_or.reduce([wrong.any(axis=1) for _, _, wrong in _ruled(rows)]))


def _ruled(rows: Systems) -> Iterator[tuple[Rule, Array, NDArray[np.bool_]]]:
    """Each rule, what it measures of n systems, (n, k), and which of that breaks it."""
    for rule in RULES:
        measured = rule.measure(rows)
        yield rule, measured, ~((measured == 0.0) | ((measured >= rule.low) & (measured <= rule.high)))

"""Directions: how a number of a scene changes what is simulated, to the last digits.

Nearly every number enters the arrays of a system linearly, and angles enter by their sine: a difference over any width
is exact for the first, one over half a turn for the second.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from grasp_ros.physics.control import Column
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Of
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import PAIR_COLUMNS, System
from grasp_ros.scene import Scene
from grasp_ros.scene.effects import build
from grasp_ros.scene.effects.base import SIDES, Parameter
from grasp_ros.scene.targets import parameter_of, target_of

NOT_SMOOTH = {  # by the unit of a number: why no derivative is to be had
    "s": "it moves ticks, which are whole", "Hz": "its effect grows with the time; allowed: phase_rad",
}
STEPS = (Column.POSITION_STEP, Column.VELOCITY_STEP)
LARGEST = 1e300  # N, in place of no limit


class Directions(NamedTuple):
    """How n numbers change a system; each array has the directions last."""

    bodies: Array  # (3, 4, n)
    pairs: Array  # (2, 2, n)
    state: Array  # (6, n)
    coulomb: Array  # (1, n)
    laws: Array  # (2, k, n)
    external: Array  # (ticks, 3, n); no tick if no direction changes a force

    def closed_loop(self, system: System) -> Directions:
        """The same with the continuous feedback in the bodies, see `System.closed_loop`."""
        bodies = self.bodies.copy()
        for side, law in system.laws.items():
            gain, damping, set_point, feed_forward = self.laws[side, :4]
            bodies[side, Of.STIFFNESS] += gain
            bodies[side, Of.DAMPING] += damping
            aim, stiffness = law.row[Column.SET_POINT], law.row[Column.POSITION_GAIN]
            bodies[side, Of.FORCE] += gain * aim + stiffness * set_point + feed_forward
        return self._replace(bodies=bodies)


def directions(scene: Scene, keys: Sequence[str], sampled: bool) -> Directions:
    """How numbers of a scene, by "section.key", change it; `sampled`: commands are held. Refused: see `check_keys`."""
    parameters = check_keys(scene, keys, sampled)
    forced = {force.section for force in scene.system.external} & {key.partition(".")[0] for key in keys}
    found = no_directions(len(keys), scene.ticks if forced else 0)
    for j, (key, parameter) in enumerate(zip(keys, parameters, strict=True)):
        if target := target_of(scene, key):
            array, row, column = target
            rows = getattr(found, array)
            rows.reshape(len(rows), -1, len(keys))[row, column, j] = 1.0
        else:
            for rows, change in zip(found, _difference(scene, key, parameter, len(found.external)), strict=True):
                rows[..., j] = change
    return found


def no_directions(n: int, ticks: int = 0) -> Directions:
    """Directions that change nothing."""
    return Directions(np.zeros((3, 4, n)), np.zeros((2, 2, n)), np.zeros((6, n)), np.zeros((1, n)),
                      np.zeros((2, len(Column), n)), np.zeros((ticks, 3, n)))


def check_keys(scene: Scene, keys: Sequence[str], sampled: bool) -> list[Parameter]:
    """The numbers behind some keys, by which a run of a scene has derivatives.

    Refused: a key that is not in the scene or on which the motion does not depend smoothly, a sensor that quantises.
    """
    if not keys:
        raise Refused(f"{scene.name}: sensitivity: nothing; allowed: keys of the scene, such as object.position_m")
    for side, law in scene.system.laws.items():
        if (sampled or scene.sampled) and law.row[[*STEPS]].any():
            raise Refused(f"{scene.name}: the {('left', 'right')[side]} sensor quantises, which has no"
                          " derivative; allowed: a sensor without position_step_m and velocity_step_m_per_s")
    found = [check_key(scene, key) for key in keys]
    for key in keys:
        if _is_off(scene, key):
            raise Refused(f"{scene.name}: {key} has no derivative at 0: its effect is left out; allowed: a small"
                          " number")
    return found


def check_key(scene: Scene, key: str) -> Parameter:
    """The number behind a key; one that the scene does not name, or that does not enter smoothly, is refused."""
    parameter = parameter_of(scene, key)
    if parameter.unit in NOT_SMOOTH or parameter.whole:
        raise Refused(f"{scene.name}: {key} has no derivative: {NOT_SMOOTH.get(parameter.unit, 'it is whole')}")
    return parameter


def _is_off(scene: Scene, key: str) -> bool:
    """Whether a number is 0 with which the system has no dry friction, or no noise, to differentiate."""
    section, _, name = key.partition(".")
    law = scene.system.laws.get(SIDES.get(section.removesuffix("_sensor"), -1))
    return bool((name == "coulomb_N" and scene.system.coulomb == 0.0)
                or ("noise" in name and law is not None and law.seed is None))


def _difference(scene: Scene, key: str, parameter: Parameter, ticks: int) -> Iterator[Array]:
    """Derivatives of all arrays of a system by one number, in the order of `Directions`."""
    section, _, name = key.partition(".")
    value = scene.values[section][name]

    def at(other: float) -> tuple[Array, ...]:  # which need not be in its range
        return arrays(build({**scene.values, section: {**scene.values[section], name: other}}))

    def arrays(system: System) -> tuple[Array, ...]:
        external = system.external_over(np.arange(ticks)) if ticks else np.zeros((0, 3))
        return (system.bodies, system.pairs, system.state, np.array([system.coulomb]),
                np.minimum(system.law_rows, LARGEST), external)

    if parameter.unit == "rad":
        low, high, width = at(value - 0.5 * math.pi), at(value + 0.5 * math.pi), 2.0
    else:
        width = float(value) or 1.0
        low, high = arrays(scene.system), at(value + width)
    return ((b - a) / width for a, b in zip(low, high, strict=True))


def closing(side: int, state: Array) -> tuple[Array, Array]:
    """u in m and u' in m/s of a pair, (8), from states (m, 6), or their derivatives from those of states (m, 6, n)."""
    front, back = PAIR_COLUMNS[side]
    return state[:, front] - state[:, back], state[:, front + 1] - state[:, back + 1]

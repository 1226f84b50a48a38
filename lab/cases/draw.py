"""Scenes drawn from the whole domain.

A scene is drawn from numbers in [0, 1), so that a property test and a fuzzing run draw from the same space.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.maps.plan import Axis
from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene, SceneError
from lab.cases.scenes import horizon, side_sections

NUMBERS = 160  # of a draw


class Draw:
    """Numbers in [0, 1) on their way into a scene."""

    def __init__(self, numbers: Sequence[float]) -> None:
        self._numbers = iter(numbers)

    def between(self, low: float, high: float) -> float:
        """A number in [low, high]."""
        return low + (high - low) * next(self._numbers)

    def decades(self, low: float, high: float, zero: float = 0.0) -> float:
        """10 to a power in [low, high], or 0 for the part `zero` of all draws."""
        number = next(self._numbers)
        return 0.0 if number < zero else float(10.0 ** (low + (high - low) * (number - zero) / (1.0 - zero)))

    def chance(self, part: float) -> bool:
        """True for the part of all draws."""
        return next(self._numbers) < part


def inside(make: Callable[[Draw], Scene], rng: np.random.Generator) -> Scene:
    """The first scene that is not refused: what lies outside the domain is drawn again."""
    while True:
        try:
            return make(Draw(rng.random(NUMBERS).tolist()))
        except SceneError:
            continue


def draw_ordinary(draw: Draw) -> Scene:
    """A scene of the paper's kind with numbers over ten decades, with or without the loop and its effects."""
    size, speed = draw.decades(-3.0, 1.0), draw.decades(-3.0, 2.0)
    sections: dict[str, dict[str, Any]] = {}
    slowest = 0.0
    for side, sign in (("left", -1.0), ("right", 1.0)):
        mass = draw.decades(-5.0, 5.0)
        stiffness, gain = (mass * draw.decades(-4.0, 6.0, zero=0.15) for _ in range(2))
        damping, velocity = (mass * draw.decades(-6.0, 4.0, zero=0.2) for _ in range(2))
        position = 0.0 if draw.chance(0.1) else sign * size * draw.between(-0.02, 1.0)
        rate = speed * draw.between(-1.0, 1.0)
        contact = Contact(draw.decades(0.0, 10.0), draw.decades(-4.0, 3.0, zero=0.2))
        sections |= side_sections(side, Arm(mass, stiffness, damping, gain, velocity), contact, position, rate)
        slowest = max(slowest, math.sqrt((stiffness + gain) / mass))
    sections["object"] = {
        "mass_kg": draw.decades(-5.0, 5.0), "position_m": 0.0, "velocity_m_per_s": speed * draw.between(-1.0, 1.0),
    }
    seconds = draw.decades(0.0, 1.3) * (1.0 / slowest if slowest > 0.0 else size / speed)
    sections["time"] = horizon(min(max(seconds, 1e-6), 1e4))
    if draw.chance(0.3):
        _add_loop(draw, sections, seconds)
    elif draw.chance(0.1):
        _take_losses(sections)
    if draw.chance(0.3):
        _add_effects(draw, sections, speed**2 / size)
    return scenes.compose("drawn", sections, title="ordinary")


def _add_loop(draw: Draw, sections: dict[str, dict[str, Any]], seconds: float) -> None:
    """Sampling with some of its effects, and gains for which the loop is stable or grows slowly."""
    period = max(math.ceil(min(seconds, 1e3) / 200.0 * draw.decades(-0.5, 0.7) * 1e9), 1)
    ticks = max(min(round(min(seconds, 1e3) * 1e9 / period), 300), 1)
    sections["time"] = {"duration_s": period * ticks / 1e9, "control_period_s": period / 1e9}
    sections["loop"] = {"delay_ticks": int(draw.between(0.0, 4.0))}
    for side in ("left", "right"):
        mass = sections[f"{side}_arm"]["mass_kg"]
        rate = min(1e9 / period, math.sqrt(1e12 / mass))
        sections[f"{side}_feedback"] = {
            "position_gain_N_per_m": mass * rate**2 * draw.decades(-6.0, -1.5, zero=0.1),
            "velocity_gain_Ns_per_m": mass * rate * draw.decades(-5.0, -1.0, zero=0.1),
        }
        if draw.chance(0.3):
            sections[f"{side}_actuator"] = {"limit_N": draw.decades(-3.0, 3.0)}
        if draw.chance(0.3):
            sections[f"{side}_sensor"] = {"noise_seed": 1, "position_noise_m": draw.decades(-6.0, -2.0),
                                          "velocity_step_m_per_s": draw.decades(-6.0, -2.0)}


def _add_effects(draw: Draw, sections: dict[str, dict[str, Any]], acceleration: float) -> None:
    """Friction, tilt, a pulse, set-points and constant forces of the usual size, and sides that are not there."""
    weight = min(sections["object"]["mass_kg"] * acceleration, 1e11)  # ten of them are a force that a scene allows
    if draw.chance(0.4):
        sections["object_friction"] = {"coulomb_N": weight * draw.decades(-4.0, 1.0),
                                       "viscous_Ns_per_m": weight * draw.decades(-5.0, 0.0, zero=0.5)}
    if draw.chance(0.3):
        sections["tilt"] = {"angle_rad": draw.between(-1.0, 1.0),
                            "gravity_m_per_s2": min(acceleration * draw.decades(-4.0, 0.0), 1e3)}
    if draw.chance(0.3):
        period = round(sections["time"]["control_period_s"] * 1e9)
        ticks = round(sections["time"]["duration_s"] * 1e9) // period
        start, length = int(draw.between(0.0, ticks)), 1 + int(draw.between(0.0, ticks))
        sections["object_pulse"] = {"force_N": weight * draw.between(-1.0, 1.0), "start_s": start * period / 1e9,
                                    "length_s": length * period / 1e9}
    if draw.chance(0.3):
        sections["left_feedback"]["set_point_m"] = draw.between(-1.0, 1.0) * abs(sections["left_arm"]["position_m"])
        sections["left_feedback"]["feed_forward_N"] = weight * draw.between(-1.0, 1.0)
    if draw.chance(0.2):
        for section in [section for section in sections if section.startswith("right_")]:
            del sections[section]
    elif draw.chance(0.2):
        del sections["left_contact"]


def _take_losses(sections: dict[str, dict[str, Any]]) -> None:
    for side in ("left", "right"):
        sections[f"{side}_arm"]["damping_Ns_per_m"] = 0.0
        sections[f"{side}_feedback"]["velocity_gain_Ns_per_m"] = 0.0
        sections[f"{side}_contact"]["dissipation_s_per_m"] = 0.0


def relative(scene: Scene, part: float) -> tuple[Axis, ...]:
    """Axes for every number of a scene that is neither 0 nor one of its times: off by up to a part of it."""
    return tuple(
        Axis(f"{section}.{key}", value - part * abs(value), value + part * abs(value))
        for section, numbers in scene.values.items() if section != "time"
        for key, value in numbers.items() if isinstance(value, float) and value
    )

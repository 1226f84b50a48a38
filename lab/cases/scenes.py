"""Building the scenes of hard cases from few numbers, and what their errors have in common."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.events import Event
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Arm, Array, Contact
from grasp_ros.scene import Scene
from lab.reference import Reference, integrate

STANDARD = Arm(1.0, 10.0, 0.2, 5.0, 0.5)
ELASTIC = Arm(1.0, 10.0, 0.0, 5.0, 0.0)
FREE = Arm(1.0, 0.0, 0.0, 0.0, 0.0)
PERIOD = 1e-3  # s
STIFF = Contact(1e4, 0.1)  # of Table 1
AWAY = 1e8  # m, where a body is that shall meet nobody
BEGIN, END = (Transition.TOUCH, Transition.REENTRY), (Transition.RELEASE, Transition.CLAMP)  # of a contact


def horizon(seconds: float) -> dict[str, float]:
    """The section `time` of a horizon of at least `seconds`, with whole nanoseconds and control periods."""
    if seconds > 1.0:
        duration = math.ceil(seconds / PERIOD) * PERIOD
        return {"duration_s": round(duration, 3), "control_period_s": PERIOD}
    duration = max(math.ceil(seconds * 1e9), 1) / 1e9
    return {"duration_s": duration, "control_period_s": duration}


def grasp(state: Sequence[float] | Array, seconds: float, *, left: Arm = STANDARD, right: Arm | None = None,
          contact: Contact = STIFF, right_contact: Contact | None = None, mass: float = 5.0,
          name: str = "grasp") -> Scene:
    """A scene of the paper's kind, with any numbers; both sides are equal unless told otherwise."""
    x_l, v_l, x_o, v_o, x_r, v_r = (float(value) for value in state)
    arms = {"left": (left, contact, x_l, v_l), "right": (right or left, right_contact or contact, x_r, v_r)}
    sections: dict[str, dict[str, Any]] = {
        "time": horizon(seconds),
        "object": {"mass_kg": mass, "position_m": x_o, "velocity_m_per_s": v_o},
    }
    for side, given in arms.items():
        sections |= side_sections(side, *given)
    return scenes.compose(name, sections)


def side_sections(side: str, arm: Arm, contact: Contact, x: float, v: float) -> dict[str, dict[str, Any]]:
    """The sections of an arm, its feedback and its contact."""
    return {
        f"{side}_arm": {
            "mass_kg": arm.mass, "stiffness_N_per_m": arm.stiffness, "damping_Ns_per_m": arm.damping,
            "position_m": x, "velocity_m_per_s": v,
        },
        f"{side}_feedback": {"position_gain_N_per_m": arm.position_gain, "velocity_gain_Ns_per_m": arm.velocity_gain},
        f"{side}_contact": {"hertz_N_per_m1_5": contact.hertzian, "dissipation_s_per_m": contact.dissipation},
    }


def library(name: str, seconds: float) -> Scene:
    """A scene of the package with another horizon."""
    return scenes.load(name).changed({f"time.{key}": value for key, value in horizon(seconds).items()})


@lru_cache(maxsize=256)
def _reference(text: str, times: tuple[float, ...]) -> Reference:
    return integrate(scenes.parse(text, "case", "a hard case"), times)


def reference_run(scene: Scene, times: Sequence[float] | Array) -> Reference:
    """States and contacts by another method with 25 digits."""
    return _reference(scene.to_yaml(), tuple(float(t) for t in times))


def reference(scene: Scene, times: Sequence[float] | Array) -> Array:
    """States (n, 6) of `reference_run`."""
    return reference_run(scene, times).as_array()


def contacts(events: Sequence[Event], side: int) -> tuple[Array, Array]:
    """Begins and ends, in s, of one side's contact in the sense of (10).

    A clamped pair that parts is in contact no more: its release is no second end.
    """
    own = [event for event in events if event.side == side]
    before = [None, *(event.kind for event in own)]
    begins = [event.time for event in own if event.kind in BEGIN]
    ends = [event.time for event, last in zip(own, before, strict=False) if event.kind in END and last not in END]
    return np.array(begins), np.array(ends)


def distance(found: Array, expected: Array) -> float:
    """Largest error, each column relative to its largest value; a column that is 0 counts as it is."""
    size = np.abs(expected).max(axis=0)
    return float((np.abs(found - expected).max(axis=0) / np.where(size > 0.0, size, 1.0)).max())


def part(scene: Scene, points: int, first: float = 0.0) -> Array:
    """Equidistant times from `first` to the end of a scene."""
    return np.linspace(first, scene.duration, points)

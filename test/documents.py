"""Scenes of the tests: documents with one thing replaced, and scenes of the package with other numbers."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import yaml

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.scene import Scene, load
from grasp_ros.simulation import simulate

STEPS = tuple(f"{side}_sensor.{key}" for side in ("left", "right")
              for key in ("position_step_m", "velocity_step_m_per_s"))
BASE: dict[str, Any] = yaml.safe_load(load("case_01").to_yaml())


def document(section: str, key: str, value: Any) -> str:
    """Case 1 with one number replaced."""
    result = copy.deepcopy(BASE)
    result[section][key] = value
    return yaml.safe_dump(result, sort_keys=False)


def text_with(old: str, new: str) -> str:
    """Case 1 with one line replaced as text."""
    text = load("case_01").to_yaml()
    assert text.count(old) >= 1
    return text.replace(old, new, 1)


def scene_of(name: str, *settings: str, without: tuple[str, ...] = ()) -> Scene:
    """A scene of the package with other numbers, or without some of its sections or keys."""
    return scenes.compose(name, {
        section: {key: number for key, number in numbers.items() if f"{section}.{key}" not in without}
        for section, numbers in scenes.load(name, settings).values.items() if section not in without})


def body(mass: float = 1.0, x: float = 0.0, v: float = 0.0, **rest: float) -> dict[str, float]:
    """The section of an arm, or of the object."""
    return {"mass_kg": mass, "position_m": x, "velocity_m_per_s": v, **rest}


def made(seconds: float, period: float | None = None, **sections: dict[str, Any]) -> Scene:
    """A scene from its sections; the control period is its horizon unless given."""
    time = {"duration_s": seconds, "control_period_s": period or seconds}
    return scenes.compose("scene", {"time": time, **sections})


def case_of(name: str = "case_01", duration: float = 2.0, period: float = 0.001, *settings: str) -> Scene:
    """A case with another length and control period."""
    return scenes.load(name, [f"time.duration_s={duration!r}", f"time.control_period_s={period!r}", *settings])


def horizon(name: str, seconds: float, *settings: str) -> Scene:
    """A scene over another time."""
    return scenes.load(name, [f"time.duration_s={seconds}", *settings])


def stalling() -> float:
    """A coarse setting at which scipy's LSODA stalls on `v_jump_one_sided`; last bits say which one does."""
    for setting in np.geomspace(1e-2, 1e-4, 60).tolist():
        if simulate(horizon("v_jump_one_sided", 5.0), method="lsoda_events", setting=setting).status is Status.STALLED:
            return float(setting)
    raise AssertionError("none of 60 settings stalls")

"""Derivatives through impacts beside differences of the high-precision reference: the table of docs/derivatives.md."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.files import replacing, writing
from grasp_ros.sensitivity.sensitivities import sensitivities
from lab.reference.derivative import difference

P, PLACE = "left_contact.dissipation_s_per_m", "object.position_m"
SUBJECTS = (
    *((f"case_{number:02}", key) for key in (P, PLACE) for number in range(1, 12)),
    *((name, P) for name in ("v_jump_symmetric", "v_jump_one_sided", "friction", "preload", "tilt_hold", "delay")),
    ("case_01", "left_arm.mass_kg"),
)
PARTS = (0.25, 0.5, 1.0)  # of the horizon
SECONDS = {"delay": 3.0}  # horizons of scenes with many ticks, which take the reference long
ROUNDINGS = 4  # runs whose initial places are off by one
MARK = "<!-- table -->"


class Row(NamedTuple):
    """One scene, one number, one time."""

    scene: str
    key: str
    t: float  # s
    size: float  # largest of the six derivatives
    error: float  # the largest, by that size
    spread: float  # how much one rounding of the initial places changes them, likewise


def run(directory: Path) -> list[Row]:
    """Compare all subjects; differences of the reference are kept in a journal."""
    path = directory / "derivatives.json"
    with writing(path):
        directory.mkdir(parents=True, exist_ok=True)
    journal = json.loads(path.read_text()) if path.is_file() else {}
    rows = []
    for name, key in SUBJECTS:
        scene = scenes.load(name)
        scene = scene.changed({"time.duration_s": SECONDS.get(name, scene.duration)})
        times, entry = [part * scene.duration for part in PARTS], f"{name}|{key}"
        if entry not in journal:
            journal[entry] = difference(scene, key, times).state.tolist()
            with replacing(path) as file:
                file.write(json.dumps(journal).encode())
        rows += _rows(scene, key, np.array(times), np.array(journal[entry]))
    return rows


def _rows(scene: Scene, key: str, times: Array, expected: Array) -> list[Row]:
    found, size = _derivative(scene, key, times), np.abs(expected).max(axis=1)
    signs = np.random.default_rng(1990).choice([-1.0, 1.0], size=(ROUNDINGS, 3))
    spread = np.max([np.abs(_derivative(_off(scene, row), key, times) - found).max(axis=1) for row in signs], axis=0)
    error = np.abs(found - expected).max(axis=1)
    return [Row(scene.name, key, *(float(value) for value in row))
            for row in zip(times, size, error / size, spread / size, strict=True)]


def _derivative(scene: Scene, key: str, times: Array) -> Array:
    """Derivatives (m, 6) of the states by one number."""
    return np.asarray(sensitivities(scene, [key], times).state_rates[..., 0])


def _off(scene: Scene, signs: Array) -> Scene:
    """The scene with initial places that are one rounding of the largest of them off."""
    off = signs * np.spacing(np.abs(scene.initial_state).max())
    places = zip(("left_arm", "object", "right_arm"), off.tolist(), strict=True)
    return scene.changed({f"{body}.position_m": scene.values[body]["position_m"] + way for body, way in places})


def report(rows: list[Row]) -> str:
    """The rows as a table of Markdown."""
    lines = ["| scene | number | t, s | largest derivative | relative error | one rounding changes it by |",
             "|---|---|---|---|---|---|"]
    lines += [f"| {row.scene} | `{row.key}` | {row.t:g} | {row.size:.3g} | {row.error:.1e} | {row.spread:.1e} |"
              for row in rows]
    return "\n".join(lines)


def write(page: Path, rows: list[Row]) -> None:
    """Put the table into the page, between its marks."""
    before, _, after = page.read_text(encoding="utf-8").split(MARK)
    with replacing(page) as file:
        file.write(f"{before}{MARK}\n\n{report(rows)}\n\n{MARK}{after}".encode())

"""The replay of a case: states of the run, from its dense output, as the page embeds them.

Frames are 1/60 s apart, and some tens more stand in every contact, so that slow motion through a contact shows states
of the run and no interpolation. Times are whole microseconds, at which the run is evaluated; the other numbers are
rounded to 16 bits of their largest, V_c of its logarithm, which is a hundredth of a pixel.
"""

from __future__ import annotations

import base64
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.simulation import simulate
from grasp_ros.simulation.quantities import contact_intervals
from lab.paper.cases import FIGURES, Cases, Figure, value_of

RATE = 60.0  # frames a second
IN_CONTACT = 40  # more frames in each contact
LONGEST = 0.5  # s; a contact that lasts longer needs no more frames
TICKS = 1e6  # of time, in a second; frames are less than 2^16 of them apart
COLUMNS = ("t", "x_l", "x_o", "x_r", "f_l", "f_r", "fw_l", "fw_r", "V_c")
LARGEST = 2**15 - 1


class Packed(NamedTuple):
    """A column in 16 bits: value = scale * number, or exp(low + scale * number) where there is a `low`."""

    numbers: Array
    scale: float
    low: float | None = None


def frame_times(scene: Scene) -> Array:
    """Times of the frames in s, whole microseconds."""
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    spans = np.concatenate([contact_intervals(run, side) for side in SIDES])
    inside = [np.linspace(a, b, IN_CONTACT + 2) for a, b in spans.tolist() if b - a < LONGEST]
    even = np.linspace(0.0, scene.duration, round(scene.duration * RATE) + 1)
    return np.asarray(np.unique(np.round(np.concatenate([even, *inside]) * TICKS)) / TICKS)


def frames(scene: Scene) -> Array:
    """States, forces and V_c of all frames, (n, 9); see COLUMNS."""
    run = simulate(scene, grid=frame_times(scene))
    return np.column_stack([run.t, run.state[:, 0::2], run.command, run.impacts, run.energy.V_c])


def pack(name: str, values: Array) -> Packed:
    """A column in 16 bits; times as steps in microseconds, V_c by its logarithm, the rest in parts of the largest."""
    if name == "t":
        return Packed(np.round(np.diff(values, prepend=0.0) * TICKS), 1.0 / TICKS)
    if name == "V_c" and values.min() > 0.0:
        logs = np.log(values)
        low = float(logs.min())
        scale = float(logs.max() - low) / LARGEST or 1.0
        return Packed(np.round((logs - low) / scale), scale, low)
    scale = float(np.abs(values).max()) / LARGEST or 1.0
    return Packed(np.round(values / scale), scale)


def replays(cases: Cases) -> list[dict[str, Any]]:
    """What the page embeds of all cases."""
    return [_replay(figure, cases[figure.case]) for figure in FIGURES]


def _replay(figure: Figure, scene: Scene) -> dict[str, Any]:
    table = frames(scene)
    packed = [pack(name, values) for name, values in zip(COLUMNS, table.T, strict=True)]
    numbers = np.concatenate([column.numbers for column in packed]).astype("<i2")
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    spans = [contact_intervals(run, side).round(4).tolist() for side in SIDES]
    return {
        "title": figure.title,
        "columns": list(COLUMNS),
        "scales": [column.scale for column in packed],
        "lows": [column.low for column in packed],
        "rows": len(table),
        "data": base64.b64encode(numbers.tobytes()).decode("ascii"),
        "contacts": spans,
        "masses": [value_of(scene, "m_l"), value_of(scene, "m_o"), value_of(scene, "m_r")],
        "damped": value_of(scene, "c") > 0.0,
    }

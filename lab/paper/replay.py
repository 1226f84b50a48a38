"""The replay of a case: states of the run, from its dense output, as the page embeds them.

Frames are 1/60 s apart, and some tens more stand in every contact, so that slow motion through a contact shows states
of the run and no interpolation. All numbers have 32 bits; the run is evaluated at times that these hold.
"""

from __future__ import annotations

import base64
from typing import Any

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
COLUMNS = ("t", "x_l", "x_o", "x_r", "f_l", "f_r", "fw_l", "fw_r", "V_c")


def frames(scene: Scene) -> Array:
    """States, forces and V_c of all frames, (n, 9); see COLUMNS."""
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    spans = np.concatenate([contact_intervals(run, side) for side in SIDES])
    inside = [np.linspace(a, b, IN_CONTACT + 2) for a, b in spans.tolist() if b - a < LONGEST]
    even = np.linspace(0.0, scene.duration, round(scene.duration * RATE) + 1)
    times = np.unique(np.concatenate([even, *inside]).astype(np.float32)).astype(float)
    run = simulate(scene, grid=times)
    return np.column_stack([run.t, run.state[:, 0::2], run.command, run.impacts, run.energy.V_c])


def replays(cases: Cases) -> list[dict[str, Any]]:
    """What the page embeds of all cases."""
    return [_replay(figure, cases[figure.case]) for figure in FIGURES]


def _replay(figure: Figure, scene: Scene) -> dict[str, Any]:
    table = frames(scene).astype("<f4")
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    return {
        "title": figure.title,
        "columns": list(COLUMNS),
        "rows": len(table),
        "data": base64.b64encode(table.tobytes(order="F")).decode("ascii"),
        "contacts": [contact_intervals(run, side).round(4).tolist() for side in SIDES],
        "masses": [value_of(scene, "m_l"), value_of(scene, "m_o"), value_of(scene, "m_r")],
        "damped": value_of(scene, "c") > 0.0,
    }

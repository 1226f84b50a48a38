"""The replay of a case: states of the run, from its dense output, as the page embeds them.

Frames are 1/60 s apart, and some tens more stand in every contact, so that slow motion through a contact shows states
of the run and no interpolation. Numbers are single precision, which is far below a pixel.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np

from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from grasp_ros.simulation.quantities import contact_intervals
from lab.paper.cases import Figure, value_of

RATE = 60.0  # frames a second
IN_CONTACT = 40  # more frames in each contact
LONGEST = 0.5  # s; a contact that lasts longer needs no more frames
COLUMNS = ("t", "x_l", "x_o", "x_r", "f_l", "f_r", "fw_l", "fw_r", "V_c")


def frame_times(scene: Scene) -> Array:
    """Times of the frames in s."""
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    spans = np.concatenate([contact_intervals(run, side) for side in (LEFT, RIGHT)])
    inside = [np.linspace(a, b, IN_CONTACT + 2) for a, b in spans.tolist() if b - a < LONGEST]
    even = np.linspace(0.0, scene.duration, round(scene.duration * RATE) + 1)
    return np.unique(np.concatenate([even, *inside]))


def frames(scene: Scene) -> Array:
    """States, forces and V_c of all frames, (n, 9); see COLUMNS."""
    run = simulate(scene, grid=frame_times(scene))
    return np.column_stack([run.t, run.state[:, 0::2], run.command, run.impacts, run.energy.V_c])


def replay(figure: Figure, scene: Scene) -> dict[str, Any]:
    """What the page embeds of one case."""
    table = frames(scene)
    run = simulate(scene, grid=np.array([0.0, scene.duration]))
    spans = [contact_intervals(run, side).round(6).tolist() for side in (LEFT, RIGHT)]
    return {
        "title": figure.title,
        "columns": list(COLUMNS),
        "rows": len(table),
        "data": base64.b64encode(table.astype("<f4").tobytes()).decode("ascii"),
        "contacts": spans,
        "masses": [value_of(scene, "m_l"), value_of(scene, "m_o"), float(scene.values["right_arm"]["mass_kg"])],
        "damped": value_of(scene, "c") > 0.0,
    }

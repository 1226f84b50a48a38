"""A recorded motion beside the same scene without ROS, bit for bit, and beside continuous feedback."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.graph.bag import Recording
from grasp_ros.physics.model import Array
from grasp_ros.simulation import Trajectory, simulate


class Comparison(NamedTuple):
    """A recorded motion beside the same scene without ROS."""

    equal: bool  # to the sampled simulation, bit for bit
    offset: Array | None  # (6,), largest distance from continuous feedback, m and m/s; None if it has none of its own

    @property
    def rows(self) -> list[tuple[str, str]]:
        """For `table`."""
        rows = [("same without ROS", "equal, bit for bit" if self.equal else "NOT EQUAL")]
        if self.offset is not None:
            far = ", ".join(
                f"{name} {distance:.3g}"
                for name, distance in zip(("x_l", "x_o", "x_r"), self.offset[0::2], strict=True)
                if not np.isnan(distance)
            )
            rows.append(("from continuous feedback", f"at most {far} m"))
        return rows


def compare_recording(recording: Recording, accuracy: float) -> Comparison:
    """Simulate a recorded scene without ROS, with commands that are held and with the paper's continuous feedback."""
    times, scene = recording.t, recording.scene
    same = simulate(scene, sampled=True, grid=times, accuracy=accuracy, changes=recording.changes)
    equal = _equal(same, recording)
    if scene.sampled or recording.changes:
        return Comparison(equal, None)
    ideal = simulate(scene, grid=times, accuracy=accuracy)
    return Comparison(equal, np.abs(ideal.state - recording.state).max(axis=0))


def _equal(same: Trajectory, recording: Recording) -> bool:
    """Whether states, commands and the inputs that the bag knows have the same bits."""
    if len(same.t) != len(recording.t):
        return False
    known = ~np.isnan(recording.inputs).any(axis=1)  # not at the last tick
    pairs = (
        (same.state, recording.state), (same.command, recording.command),
        (same.inputs[known], recording.inputs[known]),
    )
    return all(simulated.tobytes() == recorded.tobytes() for simulated, recorded in pairs)

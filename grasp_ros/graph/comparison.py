"""A recorded motion beside the same scene without ROS, bit for bit, and beside continuous feedback."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.graph.recording import Recording
from grasp_ros.graph.verify import Answers, Verification, answers_of, verify
from grasp_ros.physics.model import Array
from grasp_ros.simulation import Trajectory, simulate


class Comparison(NamedTuple):
    """A recorded motion beside the same scene without ROS."""

    equal: bool  # every bit is as it should be
    own: bool  # whether all commands are those of the scene's laws, in lockstep and without a reset
    offset: Array | None  # (6,), largest distance from continuous feedback, m and m/s; None if it has none of its own
    verification: Verification
    answers: dict[str, Answers]  # whose commands these are, by side

    @property
    def rows(self) -> list[tuple[str, str]]:
        """For `table`."""
        rows = [(f"{side} controller", str(law)) for side, law in self.answers.items()]
        rows.append(("verified", self.verification.words))
        if self.own:
            rows.append(("same without ROS", "equal, bit for bit" if self.equal else "NOT EQUAL"))
        if self.offset is not None:
            far = ", ".join(
                f"{name} {distance:.3g}"
                for name, distance in zip(("x_l", "x_o", "x_r"), self.offset[0::2], strict=True)
                if not np.isnan(distance)
            )
            rows.append(("from continuous feedback", f"at most {far} m"))
        return rows


def compare_recording(recording: Recording) -> Comparison:
    """Simulate a recorded scene again: with its recorded inputs, and with the scene's laws if it was these that ran.

    With the scene's laws also under the paper's continuous feedback, to say how far from it the held commands lead.
    """
    times, scene, accuracy = recording.t, recording.scene, recording.running.accuracy
    verification, answers = verify(recording), answers_of(recording)
    one_run = recording.running.lockstep and len(recording.starts) <= 1
    own = one_run and not any(found.foreign for found in answers.values())
    if not own:
        return Comparison(verification.holds, own, None, verification, answers)
    same = simulate(scene, sampled=True, grid=times, accuracy=accuracy, changes=recording.changes)
    equal = verification.difference is None and _equal(same, recording)
    if scene.sampled or recording.changes:
        return Comparison(equal, own, None, verification, answers)
    ideal = simulate(scene, grid=times, accuracy=accuracy)
    return Comparison(equal, own, np.abs(ideal.state - recording.state).max(axis=0), verification, answers)


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

"""`grasp watch BAG`: a bag in the terminal."""

from __future__ import annotations

import time

import numpy as np
from rich.live import Live

from grasp_ros.graph.recording import Recording
from grasp_ros.graph.view import Moment, View, named
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.topics import CONTACTS

FRAME_SECONDS = 0.1


def play(recording: Recording, rate: float) -> None:
    """Draw a recording as time goes by; the last picture stays.

    Parameters
    ----------
    recording : Recording
    rate : float
        Seconds of the recording in a second.

    Raises
    ------
    Refused
        If the rate is not positive.
    """
    if not 0.0 < rate < np.inf:
        raise Refused(f"--rate: {rate!r} is not allowed; allowed: a number > 0")
    view, times, begin = View(recording.scene), recording.t, time.monotonic()
    with Live(auto_refresh=False) as live:
        row = -1
        while row < len(times) - 1:
            reached = times[0] + (time.monotonic() - begin) * rate
            row = int(np.searchsorted(times, reached, side="right")) - 1
            live.update(view.draw(moment_of(recording, row, f"{recording.path.name}, {rate:g} s in a second")),
                        refresh=True)
            time.sleep(FRAME_SECONDS if row < len(times) - 1 else 0.0)


def moment_of(recording: Recording, row: int, words: str) -> Moment:
    """What the view shows of a tick of a recording."""
    lockstep = recording.running.lockstep
    forces = recording.command if lockstep else recording.effort
    commands = {side: float(forces[row, body]) for side, body in SIDES.items() if body in recording.scene.system.laws}
    impacts = {side: float(recording.outputs[topic.name][row]) for side, topic in CONTACTS.items()
               if topic.name in recording.outputs}
    level = named(recording.lyapunov[row])
    return Moment(float(recording.t[row]), recording.state[row], commands, impacts, level, words, lockstep)

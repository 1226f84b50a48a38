"""`grasp watch BAG`: a bag in the terminal."""

from __future__ import annotations

import time
from contextlib import closing

import numpy as np
from rich.live import Live

from grasp_ros.graph.keys import Key, Keys
from grasp_ros.graph.recording import Recording
from grasp_ros.graph.view import Moment, View, named
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.topics import CONTACTS

FRAME_SECONDS = 0.1
HINT = "Space pause   ← → step   q quit"


def play(recording: Recording, rate: float, first: float | None = None) -> None:
    """Draw a recording as time goes by; the last picture stays. On a terminal keys pause, step and end it.

    Parameters
    ----------
    recording : Recording
    rate : float
        Seconds of the recording in a second.
    first : float, s, optional
        Where it begins; default: at the first tick.
    """
    times = recording.t
    first = float(times[0]) if first is None else first
    if not 0.0 < rate < np.inf:
        raise Refused(f"--rate: {rate!r} is not allowed; allowed: a number > 0")
    if not times[0] <= first <= times[-1]:
        raise Refused(f"--from: {first!r} is not allowed; allowed: {times[0]:g} to {times[-1]:g} s")
    position = Position(times, rate, first)
    with closing(Keys()) as keys, Live(auto_refresh=False) as live:
        keys.start()
        view = View(recording.scene, HINT if keys.there else "")
        while True:
            words = "paused" if position.paused else f"{rate:g} s in a second"
            moment = moment_of(recording, position.row, words)
            live.update(view.draw(moment, live.console.width), refresh=True)
            if position.ended:
                return
            for key in keys.pressed(FRAME_SECONDS):
                if key is Key.QUIT:
                    return
                position.press(key)
            position.go_on()


class Position:
    """Which tick of a recording is shown: time goes by, or stands and is moved a tick on or back.

    Parameters
    ----------
    times : array (n,), s
        Of the ticks.
    rate : float
        Seconds of the recording in a second.
    first : float, s
        Where it begins.

    Attributes
    ----------
    row : int
        The last tick that has been reached.
    paused : bool
    """

    def __init__(self, times: Array, rate: float, first: float) -> None:
        self._times, self._rate, self.paused, self.row = times, rate, False, 0
        self._begin(first)
        self.go_on()

    def _begin(self, at: float) -> None:
        """Go on from a time of the recording."""
        self._at, self._since = at, time.monotonic()

    def go_on(self) -> None:
        """See how far it has come by now."""
        if not self.paused:
            reached = self._at + (time.monotonic() - self._since) * self._rate
            self.row = int(np.searchsorted(self._times, reached, side="right")) - 1

    def press(self, key: Key) -> None:
        """Pause or go on, or step, which pauses, too."""
        self.paused = key is not Key.PAUSE or not self.paused
        if key is not Key.PAUSE:
            self.row = min(max(self.row + (1 if key is Key.FORWARD else -1), 0), len(self._times) - 1)
        self._begin(float(self._times[self.row]))

    @property
    def ended(self) -> bool:
        """Whether it has gone by."""
        return not self.paused and self.row == len(self._times) - 1


def moment_of(recording: Recording, row: int, words: str) -> Moment:
    """What the view shows of a tick of a recording."""
    lockstep = recording.running.lockstep
    forces = recording.command if lockstep else recording.effort
    commands = {side: float(forces[row, body]) for side, body in SIDES.items() if body in recording.scene.system.laws}
    impacts = {side: float(recording.outputs[topic.name][row]) for side, topic in CONTACTS.items()
               if topic.name in recording.outputs}
    level = named(recording.lyapunov[row])
    return Moment(float(recording.t[row]), recording.state[row], commands, impacts, level, words, lockstep)

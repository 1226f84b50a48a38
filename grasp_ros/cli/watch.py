"""`grasp watch BAG`: a bag in the terminal."""

from __future__ import annotations

import time
from contextlib import closing

import numpy as np
from rich.live import Live

from grasp_ros.graph.bag.recording import Recording
from grasp_ros.graph.terminal import Key, Keys, Moment, View
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.topics import CONTACTS, named

FRAME_SECONDS = 0.1
HINT = "Space pause   ← → step   q quit"


def play(recording: Recording, rate: float, first: float | None = None) -> None:
    """Draw a recording as time goes by; the last picture stays. On a terminal keys pause, step and end it.

    `rate` is in seconds of the recording in a second; `first` is where it begins, in s, by default at the first tick.
    """
    times = recording.t
    first = float(times[0]) if first is None else first
    if not 0.0 < rate < np.inf:
        raise Refused(f"--rate: {rate!r} is not allowed; allowed: a number > 0")
    if not times[0] <= first <= times[-1]:
        raise Refused(f"--from: {first!r} is not allowed; allowed: {times[0]:g} to {times[-1]:g} s")
    row, paused, at, since = 0, False, first, time.monotonic()  # what is shown; since when time goes by, from where
    with closing(Keys()) as keys, Live(auto_refresh=False) as live:
        keys.start()
        view = View(recording.scene, HINT if keys.there else "")
        while True:
            if not paused:
                row = int(np.searchsorted(times, at + (time.monotonic() - since) * rate, side="right")) - 1
            moment = moment_of(recording, row, "paused" if paused else f"{rate:g} s per second")
            live.update(view.draw(moment, live.console.width), refresh=True)
            if not paused and row == len(times) - 1:
                return
            for key in keys.pressed(FRAME_SECONDS):
                if key is Key.QUIT:
                    return
                paused = key is not Key.PAUSE or not paused  # a step pauses, too
                if key is not Key.PAUSE:
                    row = min(max(row + (1 if key is Key.FORWARD else -1), 0), len(times) - 1)
                at, since = float(times[row]), time.monotonic()


def moment_of(recording: Recording, row: int, words: str) -> Moment:
    """What the view shows of a tick of a recording."""
    lockstep = recording.running.lockstep
    forces = recording.command if lockstep else recording.effort
    commands = {side: float(forces[row, body]) for side, body in SIDES.items() if body in recording.scene.system.laws}
    impacts = {side: float(recording.outputs[topic.name][row]) for side, topic in CONTACTS.items()
               if topic.name in recording.outputs}
    level = named(recording.lyapunov[row])
    return Moment(float(recording.t[row]), recording.state[row], commands, impacts, level, words, lockstep)

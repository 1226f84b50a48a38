"""`grasp watch`: a running graph in the terminal."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from rich.live import Live

from grasp_ros import scene as scenes
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.life import run
from grasp_ros.graph.nodes.node import GraspNode
from grasp_ros.graph.view import Moment, View, named
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import COMMANDS, CONTACTS, JOINT_STATES, LYAPUNOV, SCENE, state_of

FRAME_SECONDS = 0.1


class Watch(GraspNode):
    """Node `watch`: draws the last state some times a second.

    Parameters
    ----------
    options
        As in `rclpy.node.Node`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("watch", **options)
        self._view: View | None = None
        self._state, self._time_ns, self._count = np.full(6, np.nan), 0, 0
        self._commands: dict[str, float] = {}
        self._impacts: dict[str, float] = {}
        self._level: dict[str, float] = {}
        self._before = time.monotonic(), 0
        self._rate = 0.0
        self._live = Live("waiting for a plant", auto_refresh=False)
        self._live.start()
        self.subscribe(SCENE, self._on_scene)
        self.subscribe(JOINT_STATES, self._on_state)
        self.subscribe(LYAPUNOV, self._on_lyapunov)
        for topics, forces in ((COMMANDS, self._commands), (CONTACTS, self._impacts)):
            for side, topic in topics.items():
                self.subscribe(topic, partial(self._on_force, forces, side))
        self.wall_timer(FRAME_SECONDS, self._draw)

    def _on_scene(self, message: Any) -> None:
        self._view = View(scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}"))
        self._commands.clear()
        self._impacts.clear()

    def _on_state(self, message: Any) -> None:
        self._state, _ = state_of(message)
        self._time_ns, self._count = messages.to_ns(message.header.stamp), self._count + 1

    def _on_lyapunov(self, message: Any) -> None:
        self._level = named(np.asarray(message.position))

    def _on_force(self, forces: dict[str, float], side: str, message: Any) -> None:
        forces[side] = message.wrench.force.x

    def _draw(self) -> None:
        now, (before, count) = time.monotonic(), self._before
        if now - before > 1.0:
            self._rate, self._before = (self._count - count) / (now - before), (now, self._count)
        if self._view is not None and self._count:
            alone = not self.count_publishers(JOINT_STATES.name)
            words = "the plant has ended" if alone else f"{self._rate:.0f} ticks/s"
            moment = Moment(self._time_ns / NANOSECONDS, self._state, self._commands, self._impacts, self._level, words)
            self._live.update(self._view.draw(moment), refresh=True)

    def close(self) -> None:
        """Leave the last picture on the terminal."""
        self._live.stop()


def main(_: str, received: Sequence[int]) -> int:
    """Watch until a signal comes."""
    return run([Watch], received)

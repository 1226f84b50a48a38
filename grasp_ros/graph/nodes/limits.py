"""What the actuators of a scene can do: no command beyond that can be true."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from grasp_ros.graph.nodes.messages import Command
from grasp_ros.graph.nodes.node import PATIENCE_SECONDS, GraspNode
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import CHANGES, COMMANDS, Topic


class Limits:
    """The largest forces that act, as the scene and the announcements of its controllers have them.

    The package's own controllers keep to the limit. A command of another one that does not is neither taken nor cut:
    the actuator would not do it, and nobody has computed what it would do instead.

    Parameters
    ----------
    node : GraspNode
    scene : Scene
    """

    def __init__(self, node: GraspNode, scene: Scene) -> None:
        self._node = node
        self._limits: dict[Topic, float] = {}
        for side, topic in COMMANDS.items():
            numbers = scene.values.get(f"{side}_actuator", {})
            if "limit_N" in numbers and topic in scene.controllers.values():
                self._limits[topic] = float(numbers["limit_N"])
                node.subscribe(CHANGES[side], partial(self._on_change, topic, f"{side}_actuator.limit_N"))

    def _on_change(self, topic: Topic, name: str, message: Any) -> None:
        for other, value in zip(message.name, message.position, strict=False):
            if other == name and 0.0 <= value < math.inf:
                self._limits[topic] = value

    def allow(self, topic: Topic, command: Command | None) -> bool:
        """Whether the actuator can do what a command says; None, what is no command, it cannot."""
        return command is not None and abs(command[1]) <= self._limits.get(topic, math.inf)

    def admit(self, topic: Topic, command: Command) -> bool:
        """The same, and what it cannot do is counted."""
        if allowed := self.allow(topic, command):
            return allowed
        self._node.refuse("commands beyond a limit", topic)
        self._node.get_logger().warning(
            f"{topic.name}: {command[1]:g} N; allowed by the actuator of the scene: {self._limits[topic]:g} N",
            throttle_duration_sec=PATIENCE_SECONDS,
        )
        return allowed

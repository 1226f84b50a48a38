"""What a plant and a monitor admit: commands that can be true, of a source that is known, up to where the monitor is.

A message does not name its sender. But a reader knows how many writers it has been connected with so far,
and a writer is connected before its first message comes. So while that number is constant, all messages come from the
same source; a message just after a change may come from another one, even from one that has already left.
"""

from __future__ import annotations

import math
import time
from functools import partial
from typing import Any

from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription

from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.scene import Scene
from grasp_ros.scene.topics import CHANGES, COMMANDS, Topic


class Limits:
    """The largest forces that act, as the scene and the announcements of its controllers have them.

    The package's own controllers keep to the limit. A larger command of another controller is refused, not clipped:
    the actuator could not apply it, and no controller has computed a clipped one.
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

    def allow(self, topic: Topic, force: float) -> bool:
        """Whether the actuator can do a command in N."""
        return abs(force) <= self._limits.get(topic, math.inf)

    def admit(self, topic: Topic, force: float) -> bool:
        """The same, and what it cannot do is counted."""
        if not (allowed := self.allow(topic, force)):
            why = f"{force:g} N; allowed by the actuator of the scene: {self._limits[topic]:g} N"
            self._node.refuse("commands beyond a limit", topic, why)
        return allowed


class Sources:
    """The sources of a topic as its reader has them; for some seconds after a change the sender is unknown."""

    def __init__(self, subscription: Subscription, seconds: float) -> None:
        # Asked at every message, in the order of the messages: an event of the executor would come before or after.
        with subscription.handle:
            self._matches = rclpy_implementation.EventHandle(
                subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
            )
        self._seconds, self._until = seconds, 0.0
        self._total, self.number = -1, 0  # connected so far, and now

    def begin(self) -> None:
        """Take those that are there as known."""
        self._look()
        self._until = 0.0

    def settled(self) -> bool:
        """Whether it has been the same ones for a while."""
        now, before = time.monotonic(), self._total
        self._look()
        if before not in (-1, self._total):
            self._until = now + self._seconds
        return now >= self._until

    def _look(self) -> None:
        with self._matches:
            status = self._matches.take_event()
        if status is not None:
            self._total, self.number = status.total_count, status.current_count

"""The graph without the project: the same processes, messages and QoS on plain rclpy, and nothing else.

It is the yardstick of `python -m lab accuracy`: how much of what rclpy can do is left when there is physics.
"""

from __future__ import annotations

import sys
import time
from functools import partial
from typing import Any

import numpy as np
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from grasp_ros.graph.ros import messages
from grasp_ros.graph.serialization import raw_stamp_ns
from grasp_ros.physics.system import BODIES
from grasp_ros.scene.topics import CLOCK, COMMANDS, CONTACTS, JOINT_STATES, LYAPUNOV, LYAPUNOV_NAMES, Topic
from lab.drills.nodes import plain_messages

SETTLE_SECONDS = 4.0  # longer than discovery was ever seen to take
PERIOD_NS = 1_000_000
INPUTS = (JOINT_STATES, *COMMANDS.values(), *CONTACTS.values())


class Baseline(Node):
    """One of the four nodes, by its name."""

    def __init__(self, name: str, ticks: int) -> None:
        super().__init__(name)
        self._last_ns = ticks * PERIOD_NS
        self._now_ns = 0
        self._heard: set[str] = set()
        self.finished = False
        if name == "plant":
            self._outputs = [self._publisher(topic) for topic in (CLOCK, *CONTACTS.values(), JOINT_STATES)]
            for topic in COMMANDS.values():
                self._subscribe(topic, partial(self._on_command, topic.name))
            self._subscribe(LYAPUNOV, lambda _: None, raw=True)
        elif name == "monitor":
            self._outputs = [self._publisher(LYAPUNOV)]
            for topic in INPUTS:
                self._subscribe(topic, self._on_anything, raw=True)
        else:
            self._outputs = [self._publisher(COMMANDS[name.removesuffix("_controller")])]
            self._subscribe(JOINT_STATES, self._on_state)

    def _publisher(self, topic: Topic) -> Any:
        return self.create_publisher(messages.TYPES[topic.type], topic.name, messages.qos(topic))

    def _subscribe(self, topic: Topic, callback: Any, raw: bool = False) -> None:
        self.create_subscription(messages.TYPES[topic.type], topic.name, callback, messages.qos(topic), raw=raw)

    def publish_state(self) -> None:
        """What the plant sends per tick."""
        clock, left, right, states = self._outputs
        clock.publish(plain_messages.clock(self._now_ns))
        left.publish(plain_messages.wrench(self._now_ns, 0.0))
        right.publish(plain_messages.wrench(self._now_ns, 0.0))
        states.publish(plain_messages.joint_state(self._now_ns, BODIES, np.zeros(6), np.zeros(3)))

    def _on_command(self, name: str, _: Any) -> None:
        self._heard.add(name)
        if len(self._heard) == len(COMMANDS):
            self._heard.clear()
            self._now_ns += PERIOD_NS
            self.finished = self._now_ns > self._last_ns
            if not self.finished:
                self.publish_state()

    def _on_state(self, message: Any) -> None:
        self._outputs[0].publish(plain_messages.wrench(plain_messages.to_ns(message.header.stamp), 0.0))

    def _on_anything(self, cdr: bytes) -> None:
        self._now_ns += 1
        if self._now_ns % len(INPUTS) == 0:
            self._outputs[0].publish(plain_messages.lyapunov(raw_stamp_ns(cdr), [0.0] * len(LYAPUNOV_NAMES)))


def main(name: str, ticks: int) -> None:
    """Run one node until it is stopped; the plant prints its ticks per second and ends."""
    rclpy.init()
    node = Baseline(name, ticks)
    executor = EventsExecutor()
    executor.add_node(node)
    settled = time.monotonic() + SETTLE_SECONDS
    while time.monotonic() < settled:
        executor.spin_once(timeout_sec=0.1)
    begin = time.monotonic()
    if name == "plant":
        node.publish_state()
    while not node.finished:
        executor.spin_once(timeout_sec=0.2)
    print(f"{ticks / (time.monotonic() - begin):.1f} ticks/s", file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[2], int(sys.argv[1]))

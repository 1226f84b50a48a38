"""A participant that belongs to no graph, for `python -m lab faults`: it looks on, and it sends what no node should.

It is told what to do by lines of JSON on its standard input, and answers each with a line on its standard output. It
outlives a graph: each `open` takes it to another domain.
"""

from __future__ import annotations

import json
import math
import select
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.duration import Duration
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from grasp_ros.graph.ros import messages
from grasp_ros.graph.serialization import raw_stamp_ns
from grasp_ros.scene.topics import COMMANDS, DEPTH, DIAGNOSTICS, JOINT_STATES, Topic
from lab.drills.nodes import NAME, plain_messages

SPIN_SECONDS = 0.01
MATCH_SECONDS = 40.0  # for the readers of what it sends to be found
KEEP_SECONDS = 0.1  # that it stays a source after its last message, as `ros2 topic pub --once` does
POSITION_GAIN, VELOCITY_GAIN = 5.0, 0.5  # as long as it answers well
WALL = "wall"  # in place of a stamp in ns: the wall clock, as a header that fills itself has it


class FaultInjector:
    """What happens in one domain.

    In the file of an array of NumPy entry k becomes the time, on the monotonic clock, at which tick k was seen on the
    topic.
    """

    def __init__(self, domain: int, times: str, period_ns: int, topic: str) -> None:
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self._node = rclpy.create_node(NAME, context=self._context, enable_rosout=False)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._times = np.load(Path(times), mmap_mode="r+")
        self._period_ns, self._latest_ns = period_ns, 0
        self._concerns: dict[str, tuple[float, str]] = {}
        self._answer: dict[str, Any] = {}
        self._commands: Any = None  # where it answers
        best_effort = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._node.create_subscription(JointState, topic, self._on_tick, best_effort, raw=True)
        self._node.create_subscription(messages.TYPES[DIAGNOSTICS.type], DIAGNOSTICS.name, self._on_health, 100)

    def spin(self) -> None:
        """Take what has come."""
        self._executor.spin_once(timeout_sec=SPIN_SECONDS)

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()

    def _on_tick(self, cdr: bytes) -> None:
        self._latest_ns = raw_stamp_ns(cdr)
        tick = self._latest_ns // self._period_ns
        if 0 <= tick < len(self._times) and not self._times[tick]:
            self._times[tick] = time.monotonic()

    def _on_health(self, message: Any) -> None:
        for status in message.status:
            if status.level != DiagnosticStatus.OK:
                self._concerns.setdefault(status.name, (time.monotonic(), status.message))

    def concerns(self) -> dict[str, Any]:
        """The first report of each node that was not OK: time and words."""
        return {"concerns": self._concerns}

    def clear(self) -> dict[str, Any]:
        """Forget the concerns so far."""
        self._concerns.clear()
        return {}

    def wait_for_sources(self, topic: str, number: int, seconds: float = MATCH_SECONDS) -> dict[str, Any]:
        """Wait until a topic has that many publishers; says when it had, and how many there are."""
        self._wait(lambda: self._node.count_publishers(topic) >= number, seconds)
        return {"when": time.monotonic(), "there": self._node.count_publishers(topic)}

    def publish(self, topic: list[Any], fields: dict[str, Any], seconds: float = 0.0) -> dict[str, Any]:
        """Send a message once its readers are there, once or at full speed for some seconds; then stop to be a source.

        The topic comes as a list of what `Topic` has. Fields are named by their paths; `stamp` is in ns, or WALL.
        """
        own = Topic(*topic)
        publisher = self._publisher(own)

        def read() -> bool:
            """By all who are known, of whom it may be one itself."""
            readers = [reader.node_name for reader in self._node.get_subscriptions_info_by_topic(own.name)]
            return bool({*readers} - {NAME}) and publisher.get_subscription_count() >= len(readers)

        if not self._wait(read):
            return {"failed": f"{own.name} is not read by all who should"}
        message = filled(messages.TYPES[own.type](), {"stamp": self._latest_ns, **fields})
        begin, sent = time.monotonic(), 0
        while not sent or time.monotonic() < begin + seconds:
            publisher.publish(message)
            sent += 1
            self.spin() if sent % 100 == 0 else None
        self._wait(lambda: publisher.wait_for_all_acked(Duration(seconds=0)))  # a reader may know this source later
        self._wait(lambda: False, KEEP_SECONDS)
        self._node.destroy_publisher(publisher)
        return {"begin": begin, "sent": sent}

    def _publisher(self, topic: Topic) -> Any:
        return self._node.create_publisher(messages.TYPES[topic.type], topic.name, messages.qos(topic))

    def _wait(self, condition: Callable[[], bool], seconds: float = MATCH_SECONDS) -> bool:
        """Take what comes until a condition holds; whether it does."""
        deadline = time.monotonic() + seconds
        while not (holds := condition()) and time.monotonic() < deadline:
            self.spin()
        return holds

    def control(self, side: str, force: float | None = None, **fields: Any) -> dict[str, Any]:
        """Answer all states on behalf of an arm from now on: with a spring and a damper, or with this force.

        Further fields are those of the message, as in `publish`; `times`: how often each is sent.
        """
        self._answer = {"side": side, "force": force, "times": 1, **fields}
        if self._commands is None:  # listen first: a plant begins as soon as there is a source that does
            self._node.create_subscription(JointState, JOINT_STATES.name, self._control, messages.qos(JOINT_STATES))
            self._commands = self._publisher(COMMANDS[side])
            if not self._wait(lambda: self._commands.get_subscription_count() > 1):
                return {"failed": f"plant and monitor do not read {COMMANDS[side].name}"}
        return {}

    def _control(self, state: JointState) -> None:
        side, force, times, *_ = self._answer.values()
        row = state.name.index(side)
        if force is None:
            force = -POSITION_GAIN * state.position[row] - VELOCITY_GAIN * state.velocity[row]
        message = plain_messages.wrench(plain_messages.to_ns(state.header.stamp), force)
        filled(message, {key: value for key, value in self._answer.items() if key not in ("side", "force", "times")})
        for _ in range(times):
            self._commands.publish(message)


def filled(message: Any, fields: dict[str, Any]) -> Any:
    """A message with some of its fields set."""
    for path, value in fields.items():
        if path == "stamp":
            if hasattr(message, "header"):
                message.header.stamp = messages.to_time(time.time_ns() if value == WALL else value)
            continue
        *parents, last = path.split(".")
        part = message
        for parent in parents:
            part = getattr(part, parent)
        setattr(part, last, math.nan if value == "nan" else value)
    return message


def main() -> None:
    """Do what the lines say until there are no more."""
    injector: FaultInjector | None = None
    while True:
        if injector is not None and not select.select([sys.stdin], [], [], 0.0)[0]:
            injector.spin()
            continue
        if not (line := sys.stdin.readline()):  # nobody asks again before the answer, so that none waits in its buffer
            break
        words = json.loads(line)
        action, answer = words.pop("do"), {}
        if action == "open":
            injector = FaultInjector(**words)
        elif injector is not None and action == "close":
            injector.close()
            injector = None
        else:
            answer = getattr(injector, action)(**words)
        print(json.dumps(answer), flush=True)
    if injector is not None:
        injector.close()


if __name__ == "__main__":
    main()

"""The monitor: the Lyapunov function live, and the recorder of the bag."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros import scene as scenes
from grasp_ros.graph.bag import Recorder
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.node import GraspNode, run
from grasp_ros.physics.energy import energy, energy_balance
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import reading
from grasp_ros.scene.topics import CHANGES, COMMANDS, JOINT_STATES, LYAPUNOV, SCENE, Topic, state_of
from grasp_ros.simulation.versions import versions


class _Announcements:
    """Numbers that one controller has been given while it runs, waiting for the tick from which they act."""

    def __init__(self, command: Topic, topic: Topic) -> None:
        self.command, self.topic = command, topic
        self.waiting: deque[bytes] = deque()
        self._taken = 0

    def complete(self, command: bytes) -> bool:
        """Whether every announcement is here that a serialized command rests on; its frame_id counts them."""
        return self._taken + len(self.waiting) >= int(messages.raw_frame_id(command) or 0)

    def take(self, command: bytes) -> Iterator[bytes]:
        """Serialized announcements that act from a serialized command on."""
        while self._taken < int(messages.raw_frame_id(command) or 0):
            self._taken += 1
            yield self.waiting.popleft()


class Monitor(GraspNode):
    """Node `monitor`; parameter bag.

    It puts the messages of a tick together, computes V, V_c, V', the mode and the energy balance of the held forces
    from the states, publishes them, and records all in the order of the ticks, so that two equal runs give equal bags.
    """

    def __init__(self) -> None:
        super().__init__("monitor")
        default = f"grasp_{datetime.now():%Y_%m_%d-%H_%M_%S}"
        self._path = Path(self.read_only("bag", default, "directory of the bag; it must not exist"))
        with reading(self._path):
            if self._path.exists():
                raise Refused(f"bag: {str(self._path)!r} exists; allowed: a directory that does not exist yet")
        self._scene: Scene | None = None
        self._recorder: Recorder | None = None
        self._pending: dict[Topic, deque[tuple[int, bytes]]] = {}
        self._announcements: list[_Announcements] = []
        self._before: tuple[int, Array, Array] | None = None  # time in ns, state and external forces of the last tick
        self.counters.update(ticks=0, **{"lost messages": 0, "alarms": 0})
        self._values = self.publisher(LYAPUNOV)
        self.subscribe(SCENE, self._on_scene)

    def _on_scene(self, message: Any) -> None:
        if self._scene is not None:  # one run, one scene
            return
        self._scene = scene = scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}")
        self._recorder = Recorder(self._path, scene, versions())
        self.state = f"recording; {scene.certificate_in_words(sampled=True)}"
        self.get_logger().info(self.state)
        for side, command in COMMANDS.items():
            if command in scene.topics:
                entry = _Announcements(command, CHANGES[side])
                self._announcements.append(entry)
                self.subscribe(entry.topic, partial(self._on_announcement, entry), raw=True)
        for topic in scene.topics:
            if topic != LYAPUNOV:
                self._pending[topic] = deque()
                self.subscribe(topic, partial(self._on_message, self._pending[topic]), raw=True)

    def _on_announcement(self, entry: _Announcements, cdr: bytes) -> None:
        entry.waiting.append(cdr)
        self._drain()

    def _on_message(self, queue: deque[tuple[int, bytes]], cdr: bytes) -> None:
        queue.append((messages.raw_stamp_ns(cdr), cdr))
        self._drain()

    def _drain(self) -> None:
        while all(self._pending.values()):
            newest = max(pending[0][0] for pending in self._pending.values())
            behind = [pending for pending in self._pending.values() if pending[0][0] < newest]
            for pending in behind:
                pending.popleft()
                self.count("lost messages")
            if not behind:
                if not all(entry.complete(self._pending[entry.command][0][1]) for entry in self._announcements):
                    return
                self._complete(newest, {topic: pending.popleft()[1] for topic, pending in self._pending.items()})

    def _complete(self, time_ns: int, tick: dict[Topic, bytes]) -> None:
        assert self._scene is not None
        assert self._recorder is not None
        changes = []
        for entry in self._announcements:
            for cdr in entry.take(tick[entry.command]):
                changes.append((entry.topic, cdr))
                change = deserialize_message(cdr, JointState)
                self._scene = self._scene.changed(dict(zip(change.name, change.position, strict=True)))
        values = self._evaluate(time_ns, deserialize_message(tick[JOINT_STATES], JointState))
        self._recorder.write_tick(time_ns, [*changes, *tick.items()], values)
        self._values.publish(messages.lyapunov(time_ns, values))
        self.count("ticks")
        self.finished = bool(self.exit_code) or time_ns == self._scene.ticks * self._scene.period_ns

    def _evaluate(self, time_ns: int, message: JointState) -> list[float]:
        """What `lyapunov` publishes, see `topics.LYAPUNOV_NAMES`."""
        assert self._scene is not None
        system = self._scene.system
        state, inputs = state_of(message)
        external = system.external_at(time_ns // self._scene.period_ns)
        residual, alarm = 0.0, False
        if self._before is not None and self._before[0] + self._scene.period_ns == time_ns:
            balance = energy_balance(system, self._before[1], state, inputs + self._before[2])
            residual, alarm = float(balance.residual), bool(balance.alarm)
        self._before = time_ns, state, external
        level = energy(system, state, external)
        if alarm:
            self.count("alarms")
            self.exit_code = 1  # `grasp run` and a plant that waits for this monitor end; the bag keeps this tick
            self.state = (
                f"V_c rose by {residual!r} J more than the work of the held forces, t = {time_ns / NANOSECONDS} s,"
                f" mode {int(level.mode)}, state {state.tolist()}"
            )
            self.get_logger().fatal(self.state)
        return [*(float(value) for value in level), residual, float(alarm)]

    def close(self) -> None:
        """Close the bag; then let the plant have the last value."""
        if self._recorder is not None:
            self._recorder.close(self.counters)
        if self.finished:
            self.flush(self._values)


def main(_: str, received: Sequence[int]) -> int:
    """Run the monitor."""
    return run(Monitor, received)

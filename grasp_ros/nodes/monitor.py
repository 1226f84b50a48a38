"""The monitor: the Lyapunov function live, and the recorder of the bag."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros import scene as scenes
from grasp_ros.bag import Recorder
from grasp_ros.nodes import messages
from grasp_ros.nodes.node import GraspNode, run
from grasp_ros.physics.model import energy
from grasp_ros.topics import JOINT_STATES, LYAPUNOV, PER_TICK, SCENE
from grasp_ros.versions import versions

INPUTS = tuple(topic for topic in PER_TICK if topic != LYAPUNOV)


class Monitor(GraspNode):
    """Node `monitor`; parameter bag.

    It puts the messages of a tick together, computes V, V_c, V' and the mode from the state, publishes them, and
    records all in the order of the ticks, so that two equal runs give equal bags.
    """

    def __init__(self) -> None:
        super().__init__("monitor")
        default = f"grasp_{datetime.now():%Y_%m_%d-%H_%M_%S}"
        self._path = Path(self.read_only("bag", default, "directory of the bag; it must not exist"))
        if self._path.exists():
            raise ValueError(f"bag: {str(self._path)!r} exists; allowed: a directory that does not exist yet")
        self._scene: scenes.Scene | None = None
        self._recorder: Recorder | None = None
        self._pending: dict[str, deque[tuple[int, bytes]]] = {topic.name: deque() for topic in INPUTS}
        self.counters.update(ticks=0, **{"lost messages": 0})
        self._values = self.publisher(LYAPUNOV)
        self.subscribe(SCENE, self._on_scene)
        for topic in INPUTS:
            self.subscribe(topic, partial(self._on_message, self._pending[topic.name]), raw=True)

    def _on_scene(self, message: Any) -> None:
        if self._scene is None:
            self._scene = scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}")
            self._recorder = Recorder(self._path, message.data, versions())
            self.state = "recording"

    def _on_message(self, queue: deque[tuple[int, bytes]], cdr: bytes) -> None:
        queue.append((messages.raw_stamp_ns(cdr), cdr))
        while self._scene is not None and all(self._pending.values()):
            newest = max(pending[0][0] for pending in self._pending.values())
            behind = [pending for pending in self._pending.values() if pending[0][0] < newest]
            for pending in behind:
                pending.popleft()
                self.count("lost messages")
            if not behind:
                self._complete(newest, {name: pending.popleft()[1] for name, pending in self._pending.items()})

    def _complete(self, time_ns: int, tick: dict[str, bytes]) -> None:
        assert self._scene is not None
        assert self._recorder is not None
        state = messages.state_of(deserialize_message(tick[JOINT_STATES.name], JointState))
        values = [float(value) for value in energy(self._scene.grasp, state)]
        for topic in INPUTS:
            self._recorder.write(topic, time_ns, tick[topic.name])
        self._recorder.write_lyapunov(time_ns, values)
        self._values.publish(messages.lyapunov(time_ns, values))
        self.count("ticks")
        self.finished = time_ns == self._scene.ticks * self._scene.period_ns

    def close(self) -> None:
        """Close the bag; then let the plant have the last value."""
        if self._recorder is not None:
            self._recorder.close()
        if self.finished:
            self.flush(self._values)


def main(_: str, received: Sequence[int]) -> int:
    """Run the monitor."""
    return run(Monitor, received)

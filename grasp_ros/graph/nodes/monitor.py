"""The monitor: the Lyapunov function live, and the recorder of the bag."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros import scene as scenes
from grasp_ros.graph import running as runnings
from grasp_ros.graph.bag import Recorder
from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.judge import Announcement, Judge
from grasp_ros.graph.nodes.life import run
from grasp_ros.graph.nodes.node import GraspNode
from grasp_ros.graph.nodes.picture import Picture
from grasp_ros.graph.nodes.ticks import Tick, Ticks
from grasp_ros.graph.running import Running
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import reading
from grasp_ros.scene.topics import (
    CHANGES,
    CLOCK,
    COMMANDS,
    DIAGNOSTICS,
    JOINT_STATES,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    RUN,
    SCENE,
    TIMING,
    Topic,
    state_of,
)
from grasp_ros.simulation.versions import versions

GIVE_UP_REPORTS = 5  # reports without a new tick after which a message is lost


class Monitor(GraspNode):
    """Node `monitor`; parameter bag.

    It puts the messages of a tick together, computes V, V_c, V' of the laws that were announced, the energy of the
    plant alone and its balance from the states, publishes them, and records all in the order of the ticks, so that two
    equal runs give equal bags. Time in the bag goes on where a reset puts the plant back.

    Parameters
    ----------
    options
        As in `rclpy.node.Node`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("monitor", **options)
        default = f"grasp_{datetime.now():%Y_%m_%d-%H_%M_%S}"
        self._path = Path(self.read_only("bag", default, "directory of the bag; it must not exist"))
        with reading(self._path):
            if self._path.exists():
                raise Refused(f"bag: {str(self._path)!r} exists; allowed: a directory that does not exist yet")
        self._running: Running | None = None
        self._scene: Scene | None = None
        self._recorder: Recorder | None = None
        self._ticks = Ticks(())
        self._seen: object = -1  # ticks at the last report
        self._stuck = 0  # reports in a row without a new tick
        self._bag_ns = self._offset_ns = 0  # time in the bag, and what it is ahead of simulated time
        self.counters.update(ticks=0, resets=0, **{
            "lost messages": 0, "messages without a state": 0, "refused announcements": 0, "alarms": 0,
            "ticks without V": 0,
        })
        self._values = self.publisher(LYAPUNOV)
        self.subscribe(RUN, self._on_run)
        self.subscribe(SCENE, self._on_scene)

    def _on_run(self, message: Any) -> None:
        if self._running is None:
            self._running = runnings.parse(message.data)
            self._begin()

    def _on_scene(self, message: Any) -> None:
        if self._scene is None:  # one run, one scene
            self._scene = scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}")
            self._begin()

    def _begin(self) -> None:
        """Record, once it is known what runs and how."""
        if self._scene is None or self._running is None:
            return
        scene, running = self._scene, self._running
        beside = [TIMING] if running.lockstep else [TIMING, *scene.controllers.values()]
        per_tick = [topic for topic in scene.topics if topic != LYAPUNOV and topic not in beside]
        self._judge, self._picture = Judge(scene), Picture(self, scene)
        self._ticks = Ticks([topic for topic in per_tick if topic != JOINT_STATES])
        topics = (RUN, SCENE, CLOCK, *scene.topics, *CHANGES.values(), *beside)
        names = {topic: self.resolve_topic_name(topic.name) for topic in topics}
        self._recorder = Recorder(self._path, scene, versions(), names, running)
        self.state = f"recording {running.words}; {scene.certificate_in_words(sampled=True)}"
        self.get_logger().info(self.state)
        for side, command in COMMANDS.items():
            if command in scene.topics:
                self.subscribe(CHANGES[side], partial(self._on_announcement, side), raw=True)
        for topic in per_tick:
            self.subscribe(topic, partial(self._on_message, topic), raw=True)
        for topic in (*beside, DIAGNOSTICS):
            self.subscribe(topic, partial(self._record, topic), raw=True)

    def _record(self, topic: Topic, cdr: bytes) -> None:
        """Keep what does not come with every state, at the time of the last one."""
        if self._recorder is not None and self.counters["ticks"]:
            self._recorder.write(topic, cdr)

    def _on_announcement(self, side: str, cdr: bytes) -> None:
        message = deserialize_message(cdr, JointState)
        numbers = dict(zip(message.name, message.position, strict=False))
        try:
            self._judge.announce(side, Announcement(messages.to_ns(message.header.stamp), numbers, cdr))
        except Refused as error:
            self.count("refused announcements")
            self.get_logger().warning(str(error))

    def _on_message(self, topic: Topic, cdr: bytes) -> None:
        self._ticks.put(topic, cdr)
        self._drain()

    def _drain(self) -> None:
        while (tick := self._ticks.take()) is not None:
            self._complete(tick)

    def report(self) -> None:
        """Publish the counters; go on without a message that does not come although the plant has gone on."""
        super().report()
        now = self.counters["ticks"]
        self._stuck = self._stuck + 1 if now == self._seen else 0
        self._seen = now
        if self._stuck >= GIVE_UP_REPORTS and (tick := self._ticks.take(patient=False)) is not None:
            self._complete(tick)
            self._drain()

    def _complete(self, tick: Tick) -> None:
        assert self._scene is not None
        assert self._recorder is not None
        if tick.restarted:
            self._offset_ns = self._bag_ns + self._scene.period_ns - tick.time_ns
            self._judge.restart()
            self.count("resets")
        self._bag_ns = tick.time_ns + self._offset_ns
        self.count("ticks")
        self.count("lost messages", tick.lost)
        self.count("messages without a state", tick.dropped)
        begun = [(CHANGES[side], cdr) for side, cdr in self._judge.begin(tick.time_ns)]
        values = self._evaluate(tick)
        self._recorder.write_tick(self._bag_ns, [*begun, *tick.found.items()], values, tick.time_ns)
        self._values.publish(messages.lyapunov(tick.time_ns, values))
        self.finished = bool(self.exit_code) or tick.time_ns == self._scene.ticks * self._scene.period_ns

    def _evaluate(self, tick: Tick) -> list[float]:
        """What `lyapunov` publishes, see `topics.LYAPUNOV_NAMES`."""
        state, inputs = state_of(deserialize_message(tick.found[JOINT_STATES], JointState))
        commands = {
            side: deserialize_message(tick.found[topic], WrenchStamped).wrench.force.x
            for side, topic in COMMANDS.items() if topic in tick.found
        }
        self._picture.show(tick.time_ns, state)
        values = self._judge.judge(tick.time_ns, state, inputs, commands)
        named = dict(zip(LYAPUNOV_NAMES, values, strict=True))
        if not named["closed"]:
            self.count("ticks without V")
            unknown = self._judge.unknown
            self.concern = (f"no law announced by {' and '.join(unknown)}: energy of the plant alone" if unknown else
                            "commands are not those of the announced law: energy of the plant alone")
        if named["alarm"]:
            self.count("alarms")
            # `grasp run` and a plant that waits for this monitor end; the bag keeps this tick
            self.fail(
                f"V_c rose by {named['unexplained']!r} J more than the work of the held forces,"
                f" t = {tick.time_ns / NANOSECONDS} s, mode {int(named['mode'])}, state {state.tolist()}"
            )
        return values

    def close(self) -> None:
        """Close the bag; then let the plant have the last value."""
        if self._recorder is not None:
            self._recorder.close(self.counters)
        if self.finished:
            self.flush(self._values)


def main(_: str, received: Sequence[int]) -> int:
    """Run the monitor."""
    return run([Monitor], received)

"""The monitor: the Lyapunov function live, and the recorder of the bag."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.subscription import Subscription

from grasp_ros import scene as scenes
from grasp_ros.graph.bag import BagError
from grasp_ros.graph.bag.recorder import NOT_RECORDED, Recorder, check_path
from grasp_ros.graph.bag.rosbag2 import topics_of
from grasp_ros.graph.health.heartbeat import digest
from grasp_ros.graph.health.peers import PeerNode
from grasp_ros.graph.lockstep.loop import Commands
from grasp_ros.graph.lockstep.synchronizer import ARMS, GIVE_UP_SECONDS, UNCERTAIN_SECONDS, Arrival, Synchronizer, Tick
from grasp_ros.graph.nodes.lyapunov_monitor import MOST_BYTES, LyapunovMonitor
from grasp_ros.graph.nodes.picture import Picture
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.ros.messages import UNREADABLE
from grasp_ros.graph.serialization import raw_command, template_of
from grasp_ros.physics.system import NAMES
from grasp_ros.scene import Scene, topics
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import Topic, named
from grasp_ros.scene.versions import versions

MOST_TICKS, MOST_SECONDS = 128, 0.05  # that are evaluated at once, and of wall time that a tick waits for others
BEHIND_SECONDS, QUIET_SECONDS = 1.0, 0.1  # at most for what came before a signal; without more when all have ended
LOOK_SECONDS = 0.01  # between looks for commands that are missing at the end
MOST_OTHER_BYTES = 2**24  # of a topic that does not come with every state, from report to report
DIAGNOSTICS_LEFT_OUT = "diagnostics not recorded"  # which anybody on the host may send


class Monitor(PeerNode):
    """Node `monitor`; parameter bag.

    It puts the messages of a tick together, computes V, V_c, V' of the laws that were announced, the energy of the
    plant alone and its balance from the states, publishes them, and records all in the order of the ticks, so that two
    equal runs give equal bags. Time in the bag goes on where a reset puts the plant back.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("monitor", **options)
        self._path = Path(self.read_only("bag") or f"grasp_{datetime.now():%Y_%m_%d-%H_%M_%S}")
        check_path(self._path)  # now, and not when a plant comes
        self._running: Running | None = None
        self._scene: Scene | None = None
        self._due: list[tuple[int, Tick, list[tuple[Topic, bytes]]]] = []  # time in the bag, tick, what comes beside
        self._others: list[Subscription] = []  # of what does not come with every state
        self._published, self._advanced = b"", 0.0  # for the last tick, and the wall time at which it came
        self._early: deque[tuple[Topic, bytes]] = deque(maxlen=1000)  # what comes beside before the first state
        self._other_bytes: Counter[Topic] = Counter()  # of `_others`, since the last report
        self._plant, self._at_end = "", False  # identity of the one that is recorded; whether its last tick is
        self._acted = [0.0, 0.0, 0.0]  # N by body, in the last state
        self._commands: dict[Topic, deque[float]] = {}  # the last ones of a free run, N
        self._bag_ns = self._offset_ns = 0  # time in the bag, and what it is ahead of simulated time
        self.counters.update(ticks=0, resets=0, **{
            "lost messages": 0, "messages without a state": 0, "refused announcements": 0, "lost announcements": 0,
            "alarms": 0, "ticks without V": 0, NOT_RECORDED: 0, DIAGNOSTICS_LEFT_OUT: 0, "restored commands": 0,
            **{arrival.value: 0 for arrival in Arrival if arrival is not Arrival.TAKEN},
        })
        self._output, self._template = self.publisher(topics.LYAPUNOV), template_of(topics.LYAPUNOV)
        self.on_text(topics.RUN, self._on_run)
        self.on_text(topics.SCENE, self._on_scene)

    def progress(self) -> object:
        """The ticks so far."""
        return self.counters["ticks"]

    def look(self) -> None:
        """See to it that everybody is there; go on without what does not come."""
        if self.progress() != self._before:  # it is behind: a plant that has ended is missed when all is recorded
            self._gone.pop(topics.JOINT_STATES, None)
        super().look()
        if self.begun:
            self._take(time.monotonic() - max(self._advanced, self._watchdog.resumed))

    def heard(self) -> None:
        """Somebody has given a sign of life; if it is another plant in the place of the one that is recorded, end.

        After the last tick the plant may still be put back: it is over when the plant says so.
        """
        super().heard()
        self.finished = self.finished or self._is_over()
        if self._plant and not self.finished and (other := self.heartbeats.successor(self._plant)):
            self.fail(f"{topics.JOINT_STATES.name}: another {other} has replaced the recorded one")

    def fail(self, reason: str, status: int = 1) -> None:
        """End with a sentence that says how far the bag reaches."""
        said = not self.begun or str(self._path) in reason  # by the recorder itself
        ticks = "" if said else f"; the bag has {self.counters['ticks']} ticks"
        super().fail(f"{reason}{ticks}", status)

    def _on_run(self, text: str) -> None:
        if self._running is None:
            self._running = Running.parse(text)
            self._begin()

    def _on_scene(self, text: str) -> None:
        if self._scene is None:  # one run, one scene
            beat = self.heartbeats.sender_of(digest(text))
            self._plant = beat.identity if beat else ""
            self._scene = scenes.parse(text, topics.SCENE.name, f"topic {topics.SCENE.name}")
            self.heartbeats.works_with(text)
            self._begin()

    def _begin(self) -> None:
        """Record, once it is known what runs and how."""
        if (scene := self._scene) is None or (running := self._running) is None:
            return
        extra = [] if running.lockstep else [topics.TIMING, *scene.controllers.values()]
        self._commands = {topic: deque(maxlen=topics.DEPTH + scene.system.delay) for topic in extra[1:]}
        per_tick = [topic for topic in scene.topics if topic != topics.LYAPUNOV and topic not in extra]
        self._lyapunov, self._picture = LyapunovMonitor(scene), Picture(self, scene)
        self._synchronizer = Synchronizer(
            [topic for topic in per_tick if topic != topics.JOINT_STATES],
            [NAMES[body] for body in scene.system.present],
            scene.period_ns, scene.ticks * scene.period_ns, scene.system.delay,
        )
        names = {topic: self.resolve_topic_name(topic.name) for topic in topics_of(scene)}
        self._recorder = Recorder(self._path, scene, versions(), names, running)
        self._soon = self.wall_timer(MOST_SECONDS, self._complete)
        self._soon.cancel()
        self.begin()
        self.words = f"recording {running.words}; {scene.certificate_in_words(sampled=True)}"
        self.get_logger().info(self.words)
        self._laws = [self.subscribe(topics.CHANGES[side], partial(self._on_announcement, side), raw=True)
                      for side, command in topics.COMMANDS.items() if command in scene.topics]
        for topic in per_tick:
            if topic in ARMS:
                Commands(self, scene, ARMS[topic], self._on_command, UNCERTAIN_SECONDS)
            else:
                self.subscribe(topic, partial(self._on_message, topic), raw=True)
        for topic in (*extra, topics.DIAGNOSTICS):
            self._others.append(self.subscribe(topic, partial(self._record, topic), raw=True))

    def _record(self, topic: Topic, cdr: bytes) -> None:
        """Keep what does not come with every state, at the time of the last one, as long as it is not too much."""
        self._other_bytes[topic] += len(cdr)
        if topic in self._commands:
            self._commands[topic].append((raw_command(cdr) or (0, 0.0))[1])
            self.heartbeats.confirm(topic.name)
            self._let_wait()
        if len(cdr) > MOST_BYTES or self._other_bytes[topic] > MOST_OTHER_BYTES:
            self.refuse(DIAGNOSTICS_LEFT_OUT if topic == topics.DIAGNOSTICS else NOT_RECORDED, topic)
        elif self._due:
            self._due[-1][2].append((topic, cdr))
        elif self.counters["ticks"]:
            self._recorder.write(topic, cdr)
        elif topic != topics.DIAGNOSTICS:
            self._early.append((topic, cdr))

    def _on_announcement(self, side: str, cdr: bytes) -> None:
        try:
            self._lyapunov.announce(side, cdr)
        except UNREADABLE as error:  # `Refused` is a ValueError
            self.refuse("refused announcements", topics.CHANGES[side], str(error))
        self.counters["lost announcements"] = self._lyapunov.lost

    def _on_command(self, own: Commands, cdr: bytes) -> None:
        sure = own.settled() and own.number < 2 and (command := raw_command(cdr)) is not None and own.allow(command[1])
        self._on_message(own.topic, cdr, sure)  # which may be of somebody else, or beyond the limit

    def _on_message(self, topic: Topic, cdr: bytes, sure: bool = True) -> None:
        arrival = self._synchronizer.put(topic, cdr, sure)
        if arrival is Arrival.TAKEN:
            self._take()
        elif arrival is Arrival.AGAIN:
            self.count(arrival.value)
            if not self._awaits_laws():  # what was published has been lost
                self._complete()
                self._output.publish(self._published)
        elif arrival is Arrival.REPEATED:
            self.count(arrival.value)
        else:
            self.refuse(arrival.value, topic)

    def report(self) -> None:
        """Publish the counters."""
        super().report()
        self._other_bytes.clear()

    def _take(self, waited: float = 0.0) -> None:
        """Put ticks in their place in the bag's time; evaluate what waits once it is enough, or something changes."""
        assert self._scene is not None
        while (tick := self._synchronizer.take(waited)) is not None:
            if tick.restarted or self._lyapunov.changes(tick.time_ns):
                self._complete()
            if tick.restarted:
                self._offset_ns = self._bag_ns + self._scene.period_ns - tick.time_ns
                self._lyapunov.restart()
                self.count("resets")
            self._bag_ns, self._advanced = tick.time_ns + self._offset_ns, time.monotonic()
            self._acted = tick.state.inputs
            self.count("restored commands", tick.restored)
            self.count("lost messages", tick.lost)
            self.count("messages without a state", tick.dropped)
            self._due.append((self._bag_ns, tick, [*self._early, *self._lyapunov.begin(tick.time_ns)]))
            self._early.clear()
            if len(self._due) >= MOST_TICKS or tick.time_ns == self._synchronizer.end_ns:
                self._complete()
            else:
                self._let_wait()

    def _let_wait(self) -> None:
        """Let ticks wait for others for a while."""
        if self._due and self._soon.is_canceled() and not self._awaits_laws():
            self._soon.reset()

    def _awaits_laws(self) -> bool:
        """Whether the first state of a free run waits for its laws, which are announced before the first commands."""
        unheard = {topic.name for topic in self._commands} - {*self.heartbeats.own.hears}
        return not self.counters["ticks"] and len(self._due) < 2 and bool(unheard)

    def _complete(self) -> None:
        """Evaluate, record and publish the ticks that wait; none after an alarm."""
        due, self._due = self._due, []
        if not due:
            return
        self._soon.cancel()
        if self._lyapunov.unknown:  # what was announced while they waited
            self.take_waiting(self._laws)
        due[0][2].extend(self._lyapunov.begin(due[0][1].time_ns))
        rows = self._lyapunov.evaluate([tick for _, tick, _ in due])
        for (bag_ns, tick, extra), values in zip(due, rows, strict=True):
            self.count("ticks")
            self._picture.show(tick.state)
            own = self._published = self._template.fill(tick.time_ns, values)
            self._recorder.write_tick(bag_ns, [*extra, *tick.found.items(), (topics.LYAPUNOV, own)], tick.time_ns)
            self._output.publish(own)
            self._check_energy(tick, named(values))
            self._at_end = tick.time_ns == self._synchronizer.end_ns
            self.finished = bool(self.exit_code) or self._is_over()
            if self.finished:
                return

    def _is_over(self) -> bool:
        return self._at_end and all(beat.identity != self._plant for beat in self.heartbeats.alive)

    def _check_energy(self, tick: Tick, values: Mapping[str, float]) -> None:
        """Say why V is not there; end where energy comes from nowhere."""
        self.concern, unknown = "", self._lyapunov.unknown
        if not values["closed"]:
            self.count("ticks without V")
            self.concern = (f"no law announced by {' and '.join(unknown)}: energy of the plant alone" if unknown else
                            "commands are not those of the announced law: energy of the plant alone")
        if values["alarm"]:
            self.count("alarms")
            # `grasp run` and a plant that waits for this monitor end; the bag keeps this tick
            self.fail(f"V_c rose by {values['unexplained']!r} J more than the work of the held forces, t ="
                      f" {tick.time_ns / NANOSECONDS} s, mode {int(values['mode'])}, state {tick.state.numbers}")

    def _take_what_came(self) -> None:
        """Record what is on the way when a signal comes, which all nodes may get at once: the plant may be ahead.

        The last words of a node come when all that it has sent has arrived.
        """
        now = quiet = time.monotonic()
        while not self.finished and time.monotonic() < min(now + BEHIND_SECONDS, quiet + QUIET_SECONDS):
            before = self.progress()
            self.sweep()
            self._complete()
            others = {beat.process for beat in self.heartbeats.alive if beat.runs} - {self.heartbeats.own.process}
            if self.progress() != before or others:
                quiet = time.monotonic()
        self._complete()

    def _take_commands(self) -> None:
        """Record the commands that acted in a free run: it may have been behind, and DDS sends again what was lost."""
        for _ in range(round(GIVE_UP_SECONDS / LOOK_SECONDS)):
            self.take_waiting(self._others, topics.DEPTH)
            acted = {topic: self._acted[ARMS[topic]] for topic in self._commands}
            if all(force in (0.0, *self._commands[topic]) for topic, force in acted.items()):
                return
            self._watchdog.feed()  # it waits, and is not blocked
            time.sleep(LOOK_SECONDS)

    def close(self) -> None:
        """Close the bag."""
        if self.begun:
            with suppress(*[BagError] if self.exit_code else []):  # it has been said
                self._take_what_came()
                self._take_commands()
                self._recorder.close(self.counters)
                self.get_logger().info(f"closed the bag {self._path}: {self.counters['ticks']} ticks")

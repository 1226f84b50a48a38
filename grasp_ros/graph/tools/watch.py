"""`grasp watch`: a running graph in the terminal, with keys that pause and step its plant."""

from __future__ import annotations

import json
import math
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rich.live import Live
from rich.text import Text
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from grasp_ros import scene as scenes
from grasp_ros.graph.lockstep.loop import PAUSED
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.node import GraspNode, Phase
from grasp_ros.graph.serialization import MOST_BYTES, SHORTEST, raw_force, raw_stamp_ns
from grasp_ros.graph.terminal import FRAME_SECONDS, Key, Keys, Moment, View
from grasp_ros.physics.errors import printable
from grasp_ros.physics.system import NAMES
from grasp_ros.scene.effects.base import NANOSECONDS, SIDES
from grasp_ros.scene.topics import COMMANDS, CONTACTS, JOINT_STATES, LYAPUNOV, RUN, SCENE, WINDOW, Topic, named

HINT = "Space pause   → step   q quit"
STATUS_SECONDS, LOST_SECONDS = 0.5, 2.0  # between questions to the plant, and until an answer is taken to be lost
PATIENCE_SECONDS = 10.0  # for a plant to come
STALE_SECONDS = 1.0  # after a reset: what waits here may still be of the time before it
MOST_SEEN = WINDOW + 500  # messages of a topic; a monitor may be WINDOW behind


class Watch(GraspNode):
    """Node `watch`: draws the newest whole state some times a second. No plant waits for it; keys steer one."""

    def __init__(self, **options: Any) -> None:
        super().__init__("watch", **options)
        self._view: View | None = None
        self._lockstep = True
        self._seen: defaultdict[Topic, dict[int, bytes]] = defaultdict(dict)  # the last messages, by their stamps
        self._found: dict[Topic, bytes] = {}  # those of the newest state of which all have come
        self._state, self._stale = -1, 0.0  # stamp of the last one, and until when nothing later than it is taken
        self._there, self._before, self._rate = time.monotonic(), (time.monotonic(), 0), 0.0  # a plant, at the latest
        self._waiting = f"waiting for a plant {self.where}"
        self._live = Live(self._waiting, auto_refresh=False)
        self._live.start(refresh=True)
        self.subscribe(SCENE, self._on_scene)
        self.subscribe(RUN, self._on_run)
        for topic in (JOINT_STATES, LYAPUNOV, *COMMANDS.values(), *CONTACTS.values()):
            self.create_subscription(
                messages.TYPES[topic.type], topic.name, partial(self._on_message, topic), messages.glance_qos(topic),
                raw=True,
            )
        self._asks = {"steps": self.create_client(SetParameters, "plant/set_parameters")}
        for name in ("pause", "resume", "step", "status"):
            self._asks[name] = self.create_client(Trigger, f"plant/{name}")
        self._reported: tuple[str, int] | None = None  # state and tick, as the plant says
        self._asked = -math.inf  # since when an answer is waited for
        self.wall_timer(STATUS_SECONDS, self._ask_status)
        self.wall_timer(FRAME_SECONDS, self._look)
        self._keys, self._pressed, self._stepped = Keys(), list[Key](), -math.inf  # the last: since when one is done

    def _on_scene(self, message: Any) -> None:
        self._view = View(scenes.parse(message.data, SCENE.name, f"topic {SCENE.name}"))
        self._reader = messages.StateReader([NAMES[body] for body in self._view.scene.system.present])
        self._seen.clear()
        self._found, self._state, self._stale = {}, -1, 0.0

    def _on_run(self, message: Any) -> None:
        self._lockstep = Running.parse(message.data).lockstep

    def _on_message(self, topic: Topic, cdr: bytes) -> None:
        if not SHORTEST <= len(cdr) <= MOST_BYTES:
            return
        stamp, now = raw_stamp_ns(cdr), time.monotonic()
        if topic == JOINT_STATES:
            if stamp < self._state:  # the plant was reset
                self._seen.clear()
                self._stale = now + STALE_SECONDS
            self._state = stamp
        elif now < self._stale and stamp > self._state:
            return
        seen = self._seen[topic]
        seen.pop(stamp, None)
        seen[stamp] = cdr  # the newest is the last
        if len(seen) > MOST_SEEN:
            del seen[next(iter(seen))]

    def _look(self) -> None:
        """Do what keys ask for, and draw."""
        self._pressed += self._keys.pressed()
        self.finished |= Key.QUIT in self._pressed
        if self._view is None:
            self._pressed.clear()
        elif self._reported and all(client.service_is_ready() for client in self._asks.values()):
            # a plant that answers the newest client knows the way back to all of them; otherwise keys wait
            self._view.hint = HINT if self._keys.there else ""
            if self._pressed and time.monotonic() > self._stepped + LOST_SECONDS:
                self._do(self._pressed.pop(0))
        self._draw()

    def _do(self, key: Key) -> None:
        """Do what a key asks for; the next one waits for the answer: a plant refuses a step beside another one."""

        def done(_: Any) -> None:
            self._stepped = -math.inf

        self._stepped = time.monotonic()
        if key is Key.PAUSE:  # refused by a plant that is paused
            self._ask("pause", lambda answer: done(answer) if answer.success else self._ask("resume", done))
        elif key is Key.FORWARD:
            self._ask("pause", lambda _: self._ask("steps", lambda _: self._ask("step", done)))

    def _ask(self, name: str, then: Callable[[Any], None] = lambda _: None) -> None:
        """Call a service of the plant; then go on with its answer."""
        one = [Parameter("steps", value=1).to_parameter_msg()]
        request = SetParameters.Request(parameters=one) if name == "steps" else Trigger.Request()
        self._asks[name].call_async(request).add_done_callback(lambda future: then(future.result()))

    def _ask_status(self) -> None:
        if self._asks["status"].service_is_ready() and time.monotonic() > self._asked + LOST_SECONDS:
            self._asked = time.monotonic()
            self._ask("status", self._on_status)

    def _on_status(self, answer: Any) -> None:
        self._asked, self._reported = -math.inf, None
        with suppress(*messages.UNREADABLE, TypeError, KeyError, OverflowError):  # of a plant that is none of ours
            found = json.loads(answer.message)
            self._reported = printable(str(found["state"])), int(found["tick"])

    def _draw(self) -> None:
        held = COMMANDS.values() if self._lockstep else ()  # in a free run they belong to no state of their own
        there = (topic for topic in (LYAPUNOV, *CONTACTS.values(), *held) if self.writers(topic))
        needed = [self._seen[topic] for topic in (JOINT_STATES, *there)]
        whole = next((stamp for stamp in reversed(needed[0]) if all(stamp in seen for seen in needed)), None)
        if whole is not None:
            self._found = {topic: seen[whole] for topic, seen in self._seen.items() if whole in seen}
        alone = not self.writers(JOINT_STATES)
        if self._view is not None and self._found:
            with suppress(*messages.UNREADABLE):  # of a sender that says something else
                moment = self._moment(self._found, alone)
                self._live.update(self._view.draw(moment, self._live.console.width), refresh=True)
        elif alone and time.monotonic() > self._there + PATIENCE_SECONDS:
            self.fail(f"no plant has come for {PATIENCE_SECONDS:g} s {self.where}")
        else:  # why nothing is seen yet: a paused plant publishes nothing
            state, tick = self._reported or ("", 0)
            hint = "; → steps it, Space lets it go on" if state == PAUSED and self._keys.there else ""
            words = f"the plant is {state} at tick {tick}{hint}" if self._reported else self._waiting
            self._live.update(Text(words), refresh=True)
        if alone:
            self._reported = None
        else:
            self._there = time.monotonic()

    def _moment(self, found: dict[Topic, bytes], alone: bool) -> Moment:
        """One state and all that belongs to it."""
        assert self._view is not None
        now, (before, earlier), stamp = time.monotonic(), self._before, raw_stamp_ns(found[JOINT_STATES])
        if now - before > 1.0:
            self._rate = max(stamp - earlier, 0) / self._view.scene.period_ns / (now - before)
            self._before = now, stamp
        _, numbers, inputs = self._reader.read(found[JOINT_STATES])
        commands, impacts = (
            {side: raw_force(found[topic]) for side, topic in topics.items() if topic in found}
            for topics in (COMMANDS, CONTACTS)
        )
        if not self._lockstep:
            laws = self._view.scene.system.laws
            commands = {side: inputs[body] for side, body in SIDES.items() if body in laws}
        level = named(deserialize_message(found[LYAPUNOV], JointState).position) if LYAPUNOV in found else {}
        phase = self._reported[0] if self._reported else Phase.RUNNING.value
        pace = f"{self._rate:.0f} ticks/s" if phase == Phase.RUNNING.value else phase
        words = "the plant has ended" if alone else pace
        return Moment(stamp / NANOSECONDS, np.array(numbers), commands, impacts, level, words, self._lockstep)

    def close(self) -> None:
        """Leave the last picture on the terminal, and give that back."""
        self._keys.close()
        self._live.stop()

"""Publishes a bag again, with its clock, for whoever wants to look at it with other tools."""

from __future__ import annotations

import math
import time
from itertools import chain
from typing import Any

from grasp_ros.graph.bag import EmptyBagError
from grasp_ros.graph.bag.opening import Opened
from grasp_ros.graph.parameters import check_factor
from grasp_ros.graph.ros.node import GraspNode, Phase
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import JOINT_STATES, WINDOW

# For readers to be found, and at most for the first to come and all to be connected: who missed the announcements at
# the start hears of this node again after 3 s.
DISCOVERY_SECONDS, MATCH_SECONDS = 1.0, 5.0
LOOK_SECONDS = 1e-3


class Player(GraspNode):
    """Node `player`; parameters bag and rate."""

    def __init__(self, **options: Any) -> None:
        super().__init__("player", **options)
        bag = Opened(self.read_only("bag"))
        self._rate = self.read_only("rate")
        check_factor(self._rate, "rate")
        begin = []  # up to the first state
        for row in bag.messages:
            begin.append(row)
            if row[0] == JOINT_STATES:
                break
        else:
            raise EmptyBagError(f"{bag.path}: holds no tick")
        self._rows = chain(begin[1:], bag.messages)
        self._next, self._first_ns = begin[0], begin[0][1].time_ns
        self._outputs = {topic: self.publisher(topic._replace(name=name)) for topic, name in bag.names.items()}
        self.counters["messages"] = 0
        self._created, self._begin = time.monotonic(), math.nan
        self.when(self._ready, self._start)

    def _ready(self) -> bool:
        """Whether somebody is there, and connected."""
        outputs = self._outputs.values()
        matched = any(map(self.readers, outputs)) and all(self.linked(publisher, ()) for publisher in outputs)
        waited = time.monotonic() - self._created
        return waited > DISCOVERY_SECONDS and (matched or waited > MATCH_SECONDS)

    def _start(self) -> None:
        self.phase, self.words, self._begin = Phase.RUNNING, "playing", time.monotonic()
        self.wall_timer(LOOK_SECONDS, self._play)

    def _play(self) -> None:
        now = (time.monotonic() - self._begin) * self._rate
        while (self._next[1].time_ns - self._first_ns) / NANOSECONDS <= now:
            topic, stored = self._next
            self._outputs[topic].publish(stored.cdr)
            self.count("messages")
            if self.counters["messages"] % WINDOW == 0:  # readers may be slower than it
                self.flush(*self._outputs.values())
            following = next(self._rows, None)
            if following is None:
                self.finished = True
                return
            self._next = following

    def close(self) -> None:
        """Let every reader have the end."""
        if self.finished:
            self.flush(*self._outputs.values())

"""Lockstep: publish state k, wait for the commands stamped k, advance exactly one period with them.

The result does not depend on the load of the machine, nor on who answers first: a command topic has one source.
"""

from __future__ import annotations

import math
import time
from functools import partial
from typing import Any

import numpy as np

from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.node import UNKNOWN
from grasp_ros.graph.nodes.steering import Steering
from grasp_ros.graph.nodes.stepped import SteppedNode
from grasp_ros.physics.model import Array
from grasp_ros.scene.topics import LYAPUNOV, WINDOW

PATIENCE_SECONDS = 5.0
NAMES_SECONDS = 2.0  # for discovery to tell the name of a source
UNCONTROLLED_SECONDS = 1e-4  # wall time between the ticks of a scene without controllers


class Lockstep:
    """Takes the commands, and advances the plant when all of a tick are there.

    Parameters
    ----------
    plant : SteppedNode
    steering : Steering

    Attributes
    ----------
    topics : list of Topic
        Where the commands come from.
    """

    def __init__(self, plant: SteppedNode, steering: Steering) -> None:
        self._plant, self._steering = plant, steering
        self._commands: dict[int, float] = {}
        self._recorded = -1  # last tick that the monitor has complete
        self._refused = False  # a second source has come
        self._seen = -1  # tick at the last report
        self._timer: Any = None
        self._going = True  # the timer
        plant.counters.update({"stale commands": 0, "repeated commands": 0, "refused commands": 0})
        self.topics = list(plant.scene.controllers.values())
        self._inputs = {
            topic: plant.subscribe(topic, partial(self._on_command, side))
            for side, topic in zip(plant.scene.system.laws, self.topics, strict=True)
        }
        if plant.monitored:
            plant.subscribe(LYAPUNOV, self._on_lyapunov, raw=True)

    def missing(self) -> list[str]:
        """Command topics that do not have exactly one source, with the names of several."""
        found = {topic.name: self._plant.sources(topic) for topic in self.topics}
        return [f"{name} from one source alone, not {' and '.join(nodes)}" if nodes else name
                for name, nodes in found.items() if len(nodes) != 1]

    def start(self) -> None:
        """Go on without a command where none will ever come."""
        if not self.topics:
            self._timer = self._plant.wall_timer(UNCONTROLLED_SECONDS, self.advance)

    def report(self) -> None:
        """Say who is waited for, when a tick takes longer than a report."""
        plant = self._plant
        waits = plant.started and not plant.finished and plant.tick == self._seen and not self._steering.stands
        self._seen = plant.tick
        silent = [topic.name for topic, side in zip(self.topics, plant.scene.system.laws, strict=True)
                  if side not in self._commands]
        monitor = [LYAPUNOV.name] if plant.monitored and not silent else []
        plant.concern = f"waits for {' and '.join(silent + monitor)} to answer tick {plant.tick}" if waits else ""
        if waits:
            plant.get_logger().warning(plant.concern, throttle_duration_sec=PATIENCE_SECONDS)

    def _on_command(self, side: int, message: Any) -> None:
        force = message.wrench.force.x
        if messages.to_ns(message.header.stamp) != self._plant.tick * self._plant.scene.period_ns:
            self._plant.count("stale commands")
        elif not math.isfinite(force):
            self._plant.count("refused commands")
        elif side in self._commands:
            self._plant.count("repeated commands")
        else:
            self._commands[side] = force
            self.advance()

    def _on_lyapunov(self, cdr: bytes) -> None:
        self._recorded = messages.raw_stamp_ns(cdr) // self._plant.scene.period_ns
        self.advance()

    def advance(self) -> None:
        """Do what is due once the current state has been answered: reset, finish, pause or advance."""
        plant = self._plant
        resetting = self._steering.reset_due
        lead = 0 if resetting or plant.at_end else WINDOW
        ahead = plant.monitored and plant.tick - self._recorded > lead
        self._let_go_on(not ahead and (resetting or not self._steering.stands))
        if self._refused or not plant.started or plant.finished or ahead or len(self._commands) < len(self.topics):
            return
        if any(source.get_publisher_count() > 1 for source in self._inputs.values()):
            self._refuse_sources()
            return
        if resetting:
            self._commands.clear()
            self._recorded = -1
            self._steering.reset_done()
        elif self._steering.go_on():
            if plant.at_end:
                plant.finish()
            else:
                plant.step(self._take_commands())

    def _let_go_on(self, going: bool) -> None:
        """Stop the timer of a scene without controllers while nothing is due: it would keep others from their turn."""
        if self._timer is not None and going is not self._going:
            self._going = going
            (self._timer.reset if going else self._timer.cancel)()

    def _refuse_sources(self) -> None:
        """End the run, with the names of the sources as soon as discovery has them."""
        self._refused = True
        deadline = time.monotonic() + NAMES_SECONDS

        def named() -> bool:
            late = time.monotonic() > deadline
            return late or not any(UNKNOWN in name for topic in self.topics for name in self._plant.sources(topic))

        self._plant.when(named, self._name_sources)

    def _name_sources(self) -> None:
        found = {topic.name: self._plant.sources(topic) for topic in self.topics}
        words = [f"{name}: {len(nodes)} sources, {' and '.join(nodes)}" for name, nodes in found.items()
                 if len(nodes) > 1]
        self._plant.fail(f"{'; '.join(words) or 'a command topic had two sources'};"
                         " allowed in lockstep: one, or who answers first would decide")

    def _take_commands(self) -> Array:
        forces = np.zeros(3)
        for side, force in self._commands.items():
            forces[side] = force
        self._commands.clear()
        return forces

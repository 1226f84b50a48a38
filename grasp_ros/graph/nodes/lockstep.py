"""Lockstep: publish state k, wait for the commands stamped k, advance exactly one period with them.

The result does not depend on the load of the machine, nor on who answers first: a command topic has one source.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from grasp_ros.graph.nodes import messages
from grasp_ros.graph.nodes.node import UNKNOWN
from grasp_ros.graph.nodes.peers import Gone, Need
from grasp_ros.graph.nodes.steering import Steering
from grasp_ros.graph.nodes.stepped import SteppedNode
from grasp_ros.physics.model import Array
from grasp_ros.scene.topics import LYAPUNOV, WINDOW, Topic

REPEAT_SECONDS = 1.0
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
        self._answered = False  # whether a state of this run was
        self._asked = self._heard = 0.0  # wall time of the last repetition, and of the last message of the monitor
        self._timer: Any = None
        self._going = True  # the timer
        plant.counters.update({
            "stale commands": 0, "repeated commands": 0, "refused commands": 0, "repeated states": 0,
            "refused records": 0,
        })
        self.topics = list(plant.scene.controllers.values())
        self._inputs = {
            topic: plant.subscribe(topic, partial(self._on_command, side, topic), raw=True)
            for side, topic in zip(plant.scene.system.laws, self.topics, strict=True)
        }
        if plant.monitored:
            plant.subscribe(LYAPUNOV, self._on_lyapunov, raw=True)

    def missing(self) -> list[str]:
        """Command topics that do not have exactly one source, with the names of several."""
        found = {topic.name: self._plant.living(topic) for topic in self.topics}
        return [f"{name} from one source alone, not {' and '.join(nodes)}" if nodes else name
                for name, nodes in found.items() if len(nodes) != 1]

    def start(self) -> None:
        """Go on without a command where none will ever come."""
        if not self.topics:
            self._timer = self._plant.wall_timer(UNCONTROLLED_SECONDS, self.advance)

    def report(self) -> None:
        """Nothing: who does not answer is named by the plant."""

    def needs(self) -> Iterator[Need]:
        """Controllers that answer the current state, and a monitor that records it."""
        plant = self._plant
        what = f"answer to tick {plant.tick}"
        for topic, side in zip(self.topics, plant.scene.system.laws, strict=True):
            due = math.inf if side in self._commands else plant.asked
            yield Need(topic, Gone.AS_TOLD, what=what, due=due, first=not self._answered)
        if plant.monitored:
            due = max(plant.asked, self._heard) if self._complete and self._ahead else math.inf
            yield Need(LYAPUNOV, Gone.ENDS, what=what, due=due)

    def ask_again(self, now: float) -> None:
        """Publish the current state again if nothing has come of it for a second: it, or an answer, was lost."""
        since = max(self._plant.asked, self._asked, self._heard if self._complete else 0.0)
        if (self._ahead or not self._complete) and now - since > REPEAT_SECONDS:
            self._asked = now
            self._plant.count("repeated states")
            self._plant.repeat()
        elif self._complete:  # the dead process of a controller that was replaced has been forgotten, say
            self.advance()

    @property
    def _complete(self) -> bool:
        """Whether all commands are there that answer the current state."""
        return len(self._commands) == len(self.topics)

    @property
    def _ahead(self) -> bool:
        """Whether the plant has to wait for its monitor."""
        lead = 0 if self._steering.reset_due or self._plant.at_end else WINDOW
        return self._plant.monitored and self._plant.tick - self._recorded > lead

    def _on_command(self, side: int, topic: Topic, cdr: bytes) -> None:
        command = messages.raw_command(cdr)
        if command is None:
            self._plant.refuse("refused commands", topic)
        elif command[0] != self._plant.tick * self._plant.scene.period_ns:
            self._plant.refuse("stale commands", topic)
        elif side in self._commands:
            self._plant.refuse("repeated commands", topic)
        else:
            self._commands[side] = command[1]
            self.advance()

    def _on_lyapunov(self, cdr: bytes) -> None:
        stamp = messages.raw_stamp_ns(cdr) if len(cdr) >= messages.SHORTEST else -1
        tick, rest = divmod(stamp, self._plant.scene.period_ns)
        if rest or not self._recorded <= tick <= self._plant.tick:
            self._plant.refuse("refused records", LYAPUNOV)
            return
        self._recorded, self._heard = tick, time.monotonic()
        self.advance()

    def advance(self) -> None:
        """Do what is due once the current state has been answered: reset, finish, pause or advance."""
        plant = self._plant
        resetting, ahead = self._steering.reset_due, self._ahead
        self._let_go_on(not ahead and (resetting or not self._steering.stands))
        if self._refused or not plant.begun or plant.finished or ahead or not self._complete:
            return
        several = [topic for topic, source in self._inputs.items() if source.get_publisher_count() > 1]
        if any(len(plant.living(topic)) > 1 for topic in several):
            self._refuse_sources()
            return
        self._answered = True
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

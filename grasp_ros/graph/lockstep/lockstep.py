"""Lockstep: publish state k, wait for the commands stamped k, advance exactly one period with them.

The result does not depend on the load of the machine, nor on who answers first: a command topic has one source. While
another one comes or goes no command counts; then the state is published again, and its answers do.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from grasp_ros.graph.health.peers import Need
from grasp_ros.graph.lockstep.loop import Commands, Loop
from grasp_ros.graph.ros.node import NEW
from grasp_ros.graph.serialization import raw_command
from grasp_ros.scene.topics import LYAPUNOV, WINDOW, Topic

if TYPE_CHECKING:  # it imports this one
    from grasp_ros.graph.nodes.plant import Plant

REPEAT_SECONDS, FIRST_SECONDS = 1.0, 0.4  # the first state is the one that a reader may miss: it has just come
SETTLE_SECONDS = 0.3  # after a source has come or gone; its messages are here by then
NAMES_SECONDS = 2.0  # for discovery to tell the name of a source
LATE_TICKS = 10  # a second state within them that is not answered at once: somebody answers when asked again alone
UNCONTROLLED_SECONDS = 1e-4  # wall time between the ticks of a scene without controllers


class Lockstep(Loop):
    """Takes the commands, and advances the plant when all of a tick are there."""

    def __init__(self, plant: Plant, paused: bool) -> None:
        super().__init__(plant, paused, SETTLE_SECONDS)  # what has been received answers the current state
        self._asked, self._asked_ns = 0.0, -1  # wall time of the last repetition, and the stamp of its state
        self._timer: Any = None
        plant.counters.update({
            "stale commands": 0, "repeated commands": 0, "refused commands": 0, "commands beyond a limit": 0,
            "commands while sources change": 0, "late answers": 0, "repeated states": 0,
        })
        self.topics = [own.topic for own in self._commands]
        self._unsettled: dict[Commands, float] = {}  # those that do not count, and since when
        self._seen: set[str] = set()  # their sources, also those that are gone again

    def missing(self) -> list[str]:
        """Command topics that do not have exactly one source, with the names of several."""
        for own in self._commands:
            own.begin()
        return [*filter(None, map(self._plant.missing, self.topics))]

    def start(self) -> None:
        """Go on without a command where none will come."""
        if not self.topics:
            self._timer = self._plant.wall_timer(UNCONTROLLED_SECONDS, self.advance)

    def needs(self) -> Iterator[Need]:
        """Controllers that answer the current state, and a monitor that records it."""
        plant = self._plant
        refused = plant.counters["refused commands"] or plant.counters["commands beyond a limit"]
        what = f"answer{' that is allowed' if refused else ''} to tick {plant.tick}"
        for own in self._commands:
            due = math.inf if own.received or own in self._unsettled else plant.published_at
            yield Need(own.topic, what, due, first=not self.answered, replaceable=True)
        if plant.monitored:
            due = max(plant.published_at, plant.recorded_at) if self._complete and self._ahead else math.inf
            yield Need(LYAPUNOV, what, due)

    def ask_again(self, now: float) -> None:
        """Publish the current state again if nothing has come of it for a while: it, or an answer, was lost."""
        patience = REPEAT_SECONDS if self.answered else FIRST_SECONDS
        since = max(self._plant.published_at, self._asked, self._plant.recorded_at if self._complete else 0.0)
        if self._unsettled:
            self._settle(now)
        elif (self._ahead or not self._complete) and now - since > patience:
            period_ns = self._plant.scene.period_ns
            # Who answers so late that the graph crawls misses no deadline, for each state is answered at last.
            if self._asked_ns >= 0 and 0 < self._plant.tick * period_ns - self._asked_ns <= LATE_TICKS * period_ns:
                why = f"a state is published again after {REPEAT_SECONDS:g} s"
                for own in self._commands:
                    if not own.received:
                        self._plant.refuse("late answers", own.topic, why)
            self._repeat(now)

    def _repeat(self, now: float) -> None:
        self._asked, self._asked_ns = now, self._plant.tick * self._plant.scene.period_ns
        self._plant.count("repeated states")
        self._plant.repeat()

    def _settle(self, now: float) -> None:
        """Ask again once the sources of the commands are the same for a while, and one of each is alive; or end."""
        for own, since in tuple(self._unsettled.items()):
            self._seen.update(names := self._plant.sources(own.topic))
            if own.settled() and (  # one is left, or what DDS still lists beside it is known to be dead
                own.number < 2 or (len(names) >= own.number and len(self._plant.living(own.topic)) < 2)
            ):
                del self._unsettled[own]
            elif now - since > self._plant.patience:
                self._refuse_sources(own.topic, now - since - self._plant.patience)
                return
        if not self._unsettled:
            self._repeat(now)

    @property
    def _complete(self) -> bool:
        """Whether all commands are there that answer the current state."""
        return all(own.received for own in self._commands)

    @property
    def _ahead(self) -> bool:
        """Whether the plant has to wait for its monitor."""
        return self._plant.outrun(0 if self.reset_due or self._plant.at_end else WINDOW)

    def _on_command(self, own: Commands, cdr: bytes) -> None:
        command = raw_command(cdr)
        if command is None:
            self._plant.refuse("refused commands", own.topic)
        elif not self._plant.begun or command[0] != self._plant.tick * self._plant.scene.period_ns:
            self._count_more("stale commands", own.topic, command[0])
        elif own.received:
            self._count_more("repeated commands", own.topic, command[0])
        elif own in self._unsettled or not own.settled():  # it is asked for again
            self._unsettled.setdefault(own, time.monotonic())
            self._plant.refuse("commands while sources change", own.topic)
        elif own.admit(command[1]):
            own.received, own.force = True, command[1]
            self.advance()

    def _count_more(self, counter: str, topic: Topic, stamp_ns: int) -> None:
        """Count an answer that is one too many, and say whose; not where the state was published again, which asks."""
        if stamp_ns == self._asked_ns:
            self._plant.count(counter)
        else:
            self._plant.refuse(counter, topic)

    def advance(self) -> None:
        """Do what is due once the current state has been answered."""
        plant = self._plant
        resetting, ahead = self.reset_due, self._ahead
        going = not ahead and (resetting or not self.halted)
        if self._timer is not None and going is self._timer.is_canceled():  # it would keep others from their turn
            (self._timer.reset if going else self._timer.cancel)()
        if not plant.begun or plant.finished or ahead or not self._complete:
            return
        self.answered = True
        if resetting:
            self.reset_done()
        elif self.go_on():
            if plant.at_end:
                plant.finish()
            else:
                forces = np.zeros(3)
                for own in self._commands:
                    forces[own.body] = own.force
                    own.clear()
                plant.step(forces)

    def _refuse_sources(self, topic: Topic, waited: float) -> None:
        """End the run for the sources of a topic, with their names as soon as discovery has them."""
        found = {topic.name: self._plant.sources(topic) for topic in self.topics}
        if waited < NAMES_SECONDS and any(NEW in nodes for nodes in found.values()):
            return
        words = [f"{name}: {len(nodes)} sources, {' and '.join(nodes)}" for name, nodes in found.items()
                 if len(nodes) > 1]
        gone = f"{topic.name}: sources come and go, seen: {' and '.join(sorted(self._seen - {NEW}))}"
        self._plant.fail(f"{'; '.join(words) or gone};"
                         " allowed in lockstep: one; else the result depends on timing")

"""Putting the messages of a tick together, in the order of the ticks, whatever else arrives."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection, Sequence
from enum import Enum
from typing import NamedTuple

from grasp_ros.graph.ros.messages import UNREADABLE, State, StateReader
from grasp_ros.graph.serialization import MOST_BYTES, force_message, raw_force, raw_stamp_ns
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.topics import COMMANDS, FORCE, JOINT_STATES, WINDOW, Topic

PATIENCE_TICKS = WINDOW + 100  # later states after which a message is given up; who waits is never so far ahead
UNCERTAIN_SECONDS = 1.0  # without a new tick, after which a command is made from what a later state says
GIVE_UP_SECONDS = 4.0  # the same for a message with no such state; DDS repeats what it lost after 3 s at most
MOST_UNCERTAIN = 8  # different commands for one state
ARMS = {topic: SIDES[side] for side, topic in COMMANDS.items()}


class Arrival(Enum):
    """What became of a message."""

    TAKEN = "taken"
    AGAIN = "repeated states"  # of a tick that is complete
    REPEATED = "repeated messages"
    CONTRADICTS = "contradicting messages"
    STAMP = "messages with a wrong stamp"
    REFUSED = "malformed messages"


class Candidates(NamedTuple):
    """What may be the message of a topic with a stamp."""

    found: list[bytes]  # serialized
    sure: bool  # whether it is: that of the right source


class Tick(NamedTuple):
    """What belongs to one state."""

    time_ns: int
    restarted: bool  # whether time went back: the plant was reset
    state: State
    found: dict[Topic, bytes]  # serialized messages; what is lost is not there
    lost: int  # how many are not
    dropped: int  # messages that belong to no state
    restored: int = 0  # commands that were made from the force that acted


NOTHING = Candidates([], False)


class Synchronizer:
    """The messages of each topic by their stamps, and the states of the plant to go by.

    A topic has one source that sends in the order of the ticks, so the first message with the stamp of a state belongs
    to it and what came before belongs to none. What is kept is bounded, whoever sends.

    A command acts over the period that follows its state, or later with a delay, and a later state has it as its
    effort. That decides where a command came before the first state, or when its topic may have had another source, and
    stands for one that did not come at all.

    `topics` are, beside `joint_states`, those with a message for every state; `names` those that every state has. Every
    stamp is a multiple of `period_ns` and not above `end_ns`. A command acts `delay` control periods after its arrival.
    """

    def __init__(
        self, topics: Sequence[Topic], names: Collection[str], period_ns: int, end_ns: int, delay: int = 0
    ) -> None:
        self._reader, self._period_ns, self.end_ns = StateReader(names), period_ns, end_ns
        self._ahead_ns = PATIENCE_TICKS * period_ns
        self._states: deque[tuple[bool, State, bytes]] = deque()  # whether time went back; as read; as it came
        self._others: dict[Topic, dict[int, Candidates]] = {topic: {} for topic in topics}
        self._wait = delay + 1  # ticks until the effort has a command
        self._newest = self._before = -1  # last states put, and taken

    def put(self, topic: Topic, cdr: bytes, sure: bool = True) -> Arrival:
        """Add a serialized message, if it can be true; a command may not be sure to be of the right source."""
        if len(cdr) > MOST_BYTES:
            return Arrival.REFUSED
        try:
            stamp = raw_stamp_ns(cdr)
            if stamp % self._period_ns or not 0 <= stamp <= self.end_ns:
                return Arrival.STAMP
            return self._put_state(stamp, cdr) if topic == JOINT_STATES else self._put_other(topic, stamp, cdr, sure)
        except UNREADABLE:
            return Arrival.REFUSED

    def _put_state(self, stamp: int, cdr: bytes) -> Arrival:
        if stamp == self._newest:
            return Arrival.REPEATED if self._states else Arrival.AGAIN
        if 0 < stamp < self._newest:
            return Arrival.STAMP
        if self._newest < 0:  # what came before it may have had any stamp
            for topic, queue in self._others.items():
                self._others[topic] = {at: known for at, known in queue.items() if at <= stamp + self._ahead_ns}
        self._states.append((stamp < self._newest, self._reader.read(cdr), cdr))
        self._newest = stamp
        return Arrival.TAKEN

    def _put_other(self, topic: Topic, stamp: int, cdr: bytes, sure: bool) -> Arrival:
        # Of who comes late, the first message may have any; a state from before a reset may wait for its own.
        if 0 <= self._newest < stamp - self._ahead_ns and all(state.time_ns != stamp for _, state, _ in self._states):
            return Arrival.STAMP
        if topic.type == FORCE and not math.isfinite(raw_force(cdr)):
            return Arrival.REFUSED
        sure = sure and (self._newest >= 0 or topic not in ARMS)  # it may be the answer to no state
        queue = self._others[topic]
        known = queue.get(stamp, NOTHING)
        others = [other for other in known.found
                  if topic.type == FORCE and raw_force(other) != raw_force(cdr)]
        # A late repetition of the last tick, or what a reset brings before its state: the newer one is right.
        if known.sure and (stamp != self._before or not sure):
            return Arrival.CONTRADICTS if others else Arrival.REPEATED
        queue.pop(stamp, None)
        queue[stamp] = Candidates([cdr], True) if sure else Candidates([*others, cdr][-MOST_UNCERTAIN:], False)
        if len(queue) > 2 * PATIENCE_TICKS:
            del queue[next(iter(queue))]
        return Arrival.CONTRADICTS if others and not sure else Arrival.TAKEN

    def take(self, waited: float = 0.0) -> Tick | None:
        """The next tick that is complete, or after such a wait in s will not be any more; None if that is open."""
        if not self._states:
            return None
        restarted, message, cdr = self._states[0]
        time_ns = message.time_ns
        given_up = len(self._states) > PATIENCE_TICKS or (waited > GIVE_UP_SECONDS and len(self._states) > 1)
        found, restored = {JOINT_STATES: cdr}, 0
        for topic, queue in self._others.items():
            known = queue.get(time_ns, NOTHING)
            other = known.found[0] if known.sure else None
            if other is None and topic in ARMS:
                other, made = self._decide(topic, known.found, time_ns, given_up or waited > UNCERTAIN_SECONDS)
                restored += made
            if other is not None:
                found[topic] = other
            elif not given_up:
                return None
        self._states.popleft()
        self._before = time_ns
        dropped = sum(self._forget(topic, time_ns) for topic in self._others if topic in found)
        return Tick(time_ns, restarted, message, found, 1 + len(self._others) - len(found), dropped, restored)

    def _decide(self, topic: Topic, there: Sequence[bytes], time_ns: int, late: bool) -> tuple[bytes | None, bool]:
        """The command that acted, and whether it was made from the effort, as nobody sent it here."""
        effort_ns = time_ns + self._wait * self._period_ns  # stamp of the state that has its force
        if len(self._states) <= self._wait or (later := self._states[self._wait][1]).time_ns != effort_ns:
            # It is still to come, or it was reset before, or no plant may be so far ahead.
            to_come = len(self._states) <= self._wait < WINDOW and effort_ns <= self.end_ns
            return (there[-1] if there and late and not to_come else None), False
        force = later.inputs[ARMS[topic]]
        for cdr in there:
            if raw_force(cdr) == force:
                return cdr, False
        return (force_message(time_ns, force), True) if late else (None, False)

    def _forget(self, topic: Topic, time_ns: int) -> int:
        """Let go of what belongs to a tick; returns how many messages came before it and belong to none."""
        queue, dropped = self._others[topic], 0
        if time_ns in queue:
            while (first := next(iter(queue))) != time_ns:
                del queue[first]
                dropped += 1
            del queue[time_ns]
        return dropped

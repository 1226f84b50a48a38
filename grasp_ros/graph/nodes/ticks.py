"""Putting the messages of a tick together, in the order of the ticks, whatever else arrives."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Sequence
from enum import Enum
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros.graph.nodes import messages
from grasp_ros.scene.topics import FORCE, JOINT_STATES, WINDOW, Topic

PATIENCE_TICKS = WINDOW + 100  # later states after which a message is given up; who waits is never so far ahead


class Arrival(Enum):
    """What became of a message."""

    TAKEN = "taken"
    AGAIN = "repeated states"  # of a tick that is complete
    REPEATED = "repeated messages"
    CONTRADICTS = "contradicting messages"
    STAMP = "messages with a wrong stamp"
    REFUSED = "malformed messages"


class Tick(NamedTuple):
    """What belongs to one state."""

    time_ns: int
    restarted: bool  # whether time went back: the plant was reset
    state: Any  # message
    found: dict[Topic, bytes]  # serialized messages; what is lost is not there
    lost: int  # how many are not
    dropped: int  # messages that belong to no state


class _State(NamedTuple):
    time_ns: int
    restarted: bool
    message: Any
    cdr: bytes


class Ticks:
    """The messages of each topic by their stamps, and the states of the plant to go by.

    A topic has one source that sends in the order of the ticks, so the first message with the stamp of a state belongs
    to it and what came before belongs to none. What is kept is bounded, whoever sends.

    Parameters
    ----------
    topics : sequence of Topic
        Beside `joint_states`, those with a message for every state.
    names : collection of str
        That every state has.
    period_ns, end_ns : int, ns
        Every stamp is a multiple of the first, and not above the second.
    turn : callable
        How often the plant was reset, as it says itself: the first state may come again for that reason or another.
    """

    def __init__(
        self, topics: Sequence[Topic], names: Collection[str], period_ns: int, end_ns: int, turn: Callable[[], int]
    ) -> None:
        self._names, self._period_ns, self._end_ns, self._turn = names, period_ns, end_ns, turn
        self._ahead_ns = PATIENCE_TICKS * period_ns
        self._states: deque[_State] = deque()
        self._others: dict[Topic, dict[int, bytes]] = {topic: {} for topic in topics}
        self._newest, self._newest_turn = -1, 0
        self._before = -1  # last state taken

    def put(self, topic: Topic, cdr: bytes) -> Arrival:
        """Add a serialized message, if it can be true."""
        if len(cdr) > messages.MOST_BYTES:
            return Arrival.REFUSED
        try:
            stamp = messages.raw_stamp_ns(cdr)
            if stamp % self._period_ns or not 0 <= stamp <= self._end_ns:
                return Arrival.STAMP
            return self._put_state(stamp, cdr) if topic == JOINT_STATES else self._put_other(topic, stamp, cdr)
        except messages.UNREADABLE:
            return Arrival.REFUSED

    def _put_state(self, stamp: int, cdr: bytes) -> Arrival:
        if stamp == self._newest and (stamp or self._turn() == self._newest_turn):
            return Arrival.REPEATED if self._states else Arrival.AGAIN
        if 0 < stamp < self._newest:
            return Arrival.STAMP
        message = deserialize_message(cdr, JointState)
        if not is_state(message, self._names):
            return Arrival.REFUSED
        restarted = stamp <= self._newest
        if restarted or self._newest < 0:
            self._newest_turn = self._turn()
        self._newest = stamp
        self._states.append(_State(stamp, restarted, message, cdr))
        return Arrival.TAKEN

    def _put_other(self, topic: Topic, stamp: int, cdr: bytes) -> Arrival:
        if stamp > max(self._newest, 0) + self._ahead_ns:
            return Arrival.STAMP
        if topic.type == FORCE and not math.isfinite(messages.raw_force(cdr)):
            return Arrival.REFUSED
        queue = self._others[topic]
        # A late repetition of the last tick, or what a reset brings before its state: the newer one is right.
        if stamp != self._before and (known := queue.get(stamp)) is not None:
            same = topic.type != FORCE or messages.raw_force(known) == messages.raw_force(cdr)
            return Arrival.REPEATED if same else Arrival.CONTRADICTS
        queue.pop(stamp, None)
        queue[stamp] = cdr
        if len(queue) > 2 * PATIENCE_TICKS:
            del queue[next(iter(queue))]
        return Arrival.TAKEN

    def take(self, patient: bool = True) -> Tick | None:
        """The next tick that is complete, or that will not be completed any more; None if that is still open.

        Without patience a tick is given up as soon as there is a later state, which the plant has made of the answers
        to it.
        """
        if not self._states:
            return None
        time_ns, restarted, message, cdr = self._states[0]
        given_up = len(self._states) > (PATIENCE_TICKS if patient else 1)
        if not given_up and any(time_ns not in queue for queue in self._others.values()):
            return None
        found, dropped = {JOINT_STATES: cdr}, 0
        for topic, queue in self._others.items():
            if time_ns in queue:
                while (first := next(iter(queue))) != time_ns:
                    del queue[first]
                    dropped += 1
                found[topic] = queue.pop(time_ns)
        self._states.popleft()
        self._before = time_ns
        return Tick(time_ns, restarted, message, found, 1 + len(self._others) - len(found), dropped)


def is_state(message: JointState, names: Collection[str]) -> bool:
    """Whether a message is the state of some bodies, at least of those with these names."""
    number = len(message.name)
    lists = (message.position, message.velocity, message.effort)
    return (
        all(len(values) == number for values in lists) and len(set(message.name)) == number
        and all(name in message.name for name in names)
        and all(math.isfinite(value) for values in lists for value in values)
    )

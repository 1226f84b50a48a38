"""Putting the messages of a tick together, in the order of the ticks, whatever else arrives."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from grasp_ros.graph.nodes import messages
from grasp_ros.scene.topics import JOINT_STATES, WINDOW, Topic

PATIENCE_TICKS = WINDOW + 100  # later states after which a message is given up; who waits is never so far ahead


class Tick(NamedTuple):
    """What belongs to one state."""

    time_ns: int
    restarted: bool  # whether time went back: the plant was reset
    found: dict[Topic, bytes]  # serialized messages; what is lost is not there
    lost: int  # how many are not
    dropped: int  # messages that belong to no state


class Ticks:
    """One queue for each topic, and the states of the plant to go by.

    A topic has one source that sends in the order of the ticks, so the first message with the stamp of a state belongs
    to it and what came before belongs to none.

    Parameters
    ----------
    topics : sequence of Topic
        Beside `joint_states`, those with a message for every state.
    """

    def __init__(self, topics: Sequence[Topic]) -> None:
        self._states: deque[tuple[int, bytes]] = deque()
        self._others: dict[Topic, deque[tuple[int, bytes]]] = {topic: deque() for topic in topics}
        self._before = -1

    def put(self, topic: Topic, cdr: bytes) -> None:
        """Add a serialized message."""
        (self._states if topic == JOINT_STATES else self._others[topic]).append((messages.raw_stamp_ns(cdr), cdr))

    def take(self, patient: bool = True) -> Tick | None:
        """The next tick that is complete, or that will not be completed any more; None if that is still open.

        Without patience a tick is given up as soon as there is a later state, which the plant has made of the answers
        to it.
        """
        if not self._states:
            return None
        time_ns, state = self._states[0]
        given_up = len(self._states) > (PATIENCE_TICKS if patient else 1)
        places = {}
        for topic, queue in self._others.items():
            place = next((i for i, (stamp, _) in enumerate(queue) if stamp == time_ns), None)
            if place is None and not given_up:
                return None
            places[topic] = place
        found, dropped = {JOINT_STATES: state}, 0
        for topic, place in places.items():
            if place is not None:
                queue = self._others[topic]
                for _ in range(place):
                    queue.popleft()
                dropped += place
                found[topic] = queue.popleft()[1]
        self._states.popleft()
        restarted, self._before = time_ns <= self._before, time_ns
        return Tick(time_ns, restarted, found, 1 + len(self._others) - len(found), dropped)

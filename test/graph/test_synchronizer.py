"""Which messages make a tick: what cannot be true is refused, and of several commands the one that acts is taken."""

from __future__ import annotations

from array import array

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from grasp_ros.graph.lockstep.synchronizer import (
    GIVE_UP_SECONDS,
    PATIENCE_TICKS,
    UNCERTAIN_SECONDS,
    Arrival,
    Synchronizer,
    Tick,
)
from grasp_ros.graph.serialization import MOST_BYTES, force_message, raw_force
from grasp_ros.physics.layout import LEFT
from grasp_ros.scene.topics import JOINT_STATES, LEFT_COMMAND, LEFT_CONTACT, Topic
from lab.drills.nodes import plain_messages

PERIOD, END = 1_000_000, 10**10


def state(tick: int, position: float = 0.5, effort: float = 0.0) -> bytes:
    message = plain_messages.joint_state(tick * PERIOD, [LEFT], np.full(6, position), np.full(3, effort))
    return serialize_message(message)  # type: ignore[no-any-return]


def command(tick: int, force: float = 1.0) -> bytes:
    return force_message(tick * PERIOD, force)


def synchronizer(topic: Topic = LEFT_COMMAND, delay: int = 0) -> Synchronizer:
    return Synchronizer([topic], ["left"], PERIOD, END, delay)


def taken(ticks: Synchronizer, waited: float = 0.0) -> Tick:
    """The tick that is complete."""
    found = ticks.take(waited)
    assert found is not None
    return found


def force_in(tick: Tick, topic: Topic = LEFT_COMMAND) -> float:
    return raw_force(tick.found[topic])


def test_messages_that_cannot_be_true_are_refused_by_kind() -> None:
    ticks = synchronizer()
    assert ticks.put(JOINT_STATES, state(0)) is Arrival.TAKEN
    strange, nobody = (plain_messages.joint_state(PERIOD, [LEFT], np.zeros(6), np.zeros(3)) for _ in range(2))
    strange.velocity = array("d", [1.0, 2.0])
    nobody.name = ["nobody"]
    long = plain_messages.wrench(0, 1.0)
    long.header.frame_id = "x" * MOST_BYTES
    for topic, cdr, arrival in (
        (JOINT_STATES, serialize_message(strange), Arrival.REFUSED),
        (JOINT_STATES, serialize_message(nobody), Arrival.REFUSED),
        (JOINT_STATES, state(1, np.nan), Arrival.REFUSED),
        (JOINT_STATES, state(1)[:20], Arrival.REFUSED),
        (JOINT_STATES, state(END // PERIOD + 1), Arrival.STAMP),
        (LEFT_COMMAND, command(1, np.inf), Arrival.REFUSED),
        (LEFT_COMMAND, serialize_message(long), Arrival.REFUSED),
        (LEFT_COMMAND, b"", Arrival.REFUSED),
        (LEFT_COMMAND, force_message(1, 1.0), Arrival.STAMP),  # no tick
        (LEFT_COMMAND, force_message(1_800_000_000_000_000_000, 1.0), Arrival.STAMP),
        (LEFT_COMMAND, command(PATIENCE_TICKS + 1), Arrival.STAMP),
        (LEFT_COMMAND, command(-1), Arrival.STAMP),
        (LEFT_COMMAND, command(1), Arrival.TAKEN),
        (LEFT_COMMAND, command(1), Arrival.REPEATED),
        (LEFT_COMMAND, command(1, 2.0), Arrival.CONTRADICTS),
    ):
        assert ticks.put(topic, cdr) is arrival, (topic.name, cdr[:40])


def test_a_state_that_comes_again_is_one_tick_and_a_reset_is_two() -> None:
    ticks = synchronizer()
    for tick in (0, 0, 1, 1):
        ticks.put(JOINT_STATES, state(tick))
        ticks.put(LEFT_COMMAND, command(tick))
        if tick == 0:
            ticks.take()
    assert [row.time_ns for row in iter(ticks.take, None)] == [PERIOD]
    assert ticks.put(JOINT_STATES, state(1)) is Arrival.AGAIN
    ticks.put(LEFT_COMMAND, command(1, 3.0))  # of the repetition, or the first of another run that has come this far
    for tick in (0, 1):
        assert ticks.put(LEFT_COMMAND, command(tick, 7.0)) is Arrival.TAKEN
        assert ticks.put(JOINT_STATES, state(tick)) is Arrival.TAKEN
    rows = list(iter(ticks.take, None))
    assert [(row.time_ns, row.restarted) for row in rows] == [(0, True), (PERIOD, False)]
    assert [force_in(row) for row in rows] == [7.0, 7.0]
    assert ticks.put(JOINT_STATES, state(0)) is Arrival.TAKEN
    ticks.put(LEFT_COMMAND, command(0))
    taken(ticks)
    assert ticks.put(JOINT_STATES, state(0)) is Arrival.AGAIN


def test_a_command_from_before_the_first_state_gives_way_to_the_one_that_answers_it() -> None:
    ticks = synchronizer()
    assert ticks.put(LEFT_COMMAND, command(0, 0.0)) is Arrival.TAKEN
    ticks.put(JOINT_STATES, state(0))
    assert ticks.take() is None
    assert ticks.put(LEFT_COMMAND, command(0, 1.5)) is Arrival.TAKEN
    assert force_in(taken(ticks)) == 1.5


def test_who_comes_late_takes_what_comes_before_the_first_state() -> None:
    ticks, late = synchronizer(), 6000
    assert ticks.put(LEFT_COMMAND, command(late, 2.0)) is Arrival.TAKEN
    ticks.put(JOINT_STATES, state(late))
    ticks.put(JOINT_STATES, state(late + 1, effort=2.0))  # it has acted, and is no stray
    found = taken(ticks)
    assert (force_in(found), found.lost) == (2.0, 0)
    assert ticks.put(LEFT_COMMAND, command(2 * late, 2.0)) is Arrival.STAMP


def test_the_last_tick_waits_for_no_later_state() -> None:
    ticks, last = synchronizer(), END // PERIOD
    ticks.put(JOINT_STATES, state(last))
    ticks.put(LEFT_COMMAND, command(last), sure=False)
    assert ticks.take() is None
    assert LEFT_COMMAND in taken(ticks, 2.0).found


def test_what_is_kept_is_bounded() -> None:
    ticks = synchronizer()
    for tick in range(4 * PATIENCE_TICKS):
        ticks.put(LEFT_COMMAND, command(tick % (PATIENCE_TICKS + 1)))
        ticks.put(LEFT_COMMAND, command(tick))
    assert len(ticks._others[LEFT_COMMAND]) <= 2 * PATIENCE_TICKS


@pytest.mark.parametrize("delay", [0, 2])
def test_where_two_may_have_sent_the_effort_of_a_later_state_decides(delay: int) -> None:
    ticks = synchronizer(delay=delay)
    ticks.put(JOINT_STATES, state(0))
    assert ticks.put(LEFT_COMMAND, command(0, 1e6), sure=False) is Arrival.TAKEN
    assert ticks.put(LEFT_COMMAND, command(0, 2.0), sure=False) is Arrival.CONTRADICTS
    assert ticks.put(LEFT_COMMAND, command(0, 3.0), sure=False) is Arrival.CONTRADICTS
    for tick in range(1, delay + 1):
        ticks.put(JOINT_STATES, state(tick))
        assert ticks.take() is None
    ticks.put(JOINT_STATES, state(delay + 1, effort=2.0))
    found = taken(ticks)
    assert (force_in(found), found.lost, found.restored) == (2.0, 0, 0)


def test_a_command_that_did_not_come_is_what_acted() -> None:
    ticks = synchronizer()
    ticks.put(JOINT_STATES, state(0))
    ticks.put(JOINT_STATES, state(1, effort=-0.0))
    assert ticks.take(UNCERTAIN_SECONDS) is None
    found = taken(ticks, UNCERTAIN_SECONDS + 0.1)
    assert found.found[LEFT_COMMAND] == command(0, -0.0)
    assert (found.lost, found.restored) == (0, 1)
    assert ticks.take(2 * GIVE_UP_SECONDS) is None  # nobody knows yet
    ticks.put(LEFT_COMMAND, command(1, 5.0), sure=False)
    ticks.put(LEFT_COMMAND, command(1, 6.0), sure=False)
    assert ticks.take(2 * GIVE_UP_SECONDS) is None
    ticks.put(JOINT_STATES, state(0, effort=7.0))  # the plant was reset: neither of them acts
    assert force_in(taken(ticks, UNCERTAIN_SECONDS + 0.1)) == 6.0


def test_what_nothing_stands_for_is_given_up_later() -> None:
    ticks = synchronizer(LEFT_CONTACT)
    ticks.put(JOINT_STATES, state(0))
    ticks.put(JOINT_STATES, state(1))
    assert ticks.take(GIVE_UP_SECONDS) is None
    assert taken(ticks, GIVE_UP_SECONDS + 0.1).lost == 1


def test_a_message_that_a_reset_overtakes_is_of_its_state() -> None:
    ticks, late = synchronizer(LEFT_CONTACT), 3000
    ticks.put(JOINT_STATES, state(late))
    ticks.put(JOINT_STATES, state(0))
    assert ticks.put(LEFT_CONTACT, command(2 * late, 1.0)) is Arrival.STAMP
    assert ticks.put(LEFT_CONTACT, command(late, 1.0)) is Arrival.TAKEN
    assert ticks.put(LEFT_CONTACT, command(0, 2.0)) is Arrival.TAKEN
    for tick, force in ((late, 1.0), (0, 2.0)):
        found = taken(ticks)
        assert (found.time_ns, force_in(found, LEFT_CONTACT), found.lost) == (tick * PERIOD, force, 0)

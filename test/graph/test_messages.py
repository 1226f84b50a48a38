"""A template makes the messages that ROS makes; a reader of states judges each as one that has seen no other."""

from __future__ import annotations

import math
from array import array
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState

from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.messages import State, StateReader
from grasp_ros.graph.serialization import (
    Template,
    list_message,
    raw_force,
    raw_stamp_ns,
    template_of,
)
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.system import NAMES as BODIES
from grasp_ros.scene.topics import CLOCK, FORCE, FRAME, JOINT_STATES, LEFT_COMMAND, LYAPUNOV, LYAPUNOV_NAMES, NAMED_LIST
from lab.drills.nodes import plain_messages

NAMES = ("left", "object", "right")
TEMPLATE = template_of(JOINT_STATES, NAMES)
TIME_NS = 1_234_567_890_123
STATE, INPUTS = np.array([0.1, -0.0, np.inf, 5e-324, -1e300, 0.6]), np.array([7.0, np.pi, -9.0])
NUMBERS = st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=9, max_size=9)


@pytest.mark.parametrize("names", [[], ["left"], ["left", "object", "right"], ["k_N_per_m", "é", ""]])
@pytest.mark.parametrize("frame", ["", "7", "1234567"])
def test_messages_are_those_of_a_library(names: list[str], frame: str) -> None:
    types, kind = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS2_JAZZY).types
    header = kind["std_msgs/msg/Header"](kind["builtin_interfaces/msg/Time"](*divmod(TIME_NS, 10**9)), frame)
    for lists in ([STATE, INPUTS, np.zeros(0)], [np.zeros(0), STATE, STATE[:1]]):
        expected = types.serialize_cdr(kind[NAMED_LIST](header, names, *lists), NAMED_LIST)
        assert list_message(TIME_NS, names, *(part.tolist() for part in lists), frame=frame) == expected
    header.frame_id, zero = FRAME, kind["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    wrench = kind["geometry_msgs/msg/Wrench"](replace(zero, x=-0.1), zero)
    assert template_of(LEFT_COMMAND).fill(TIME_NS, [-0.1]) == types.serialize_cdr(kind[FORCE](header, wrench), FORCE)
    assert template_of(CLOCK).fill(TIME_NS, ()) == types.serialize_cdr(kind[CLOCK.type](header.stamp), CLOCK.type)
    numbers = [math.nan, *range(len(LYAPUNOV_NAMES) - 1)]
    assert template_of(LYAPUNOV).fill(TIME_NS, numbers) == list_message(TIME_NS, LYAPUNOV_NAMES, numbers)


@pytest.mark.parametrize("bodies", [[LEFT, OBJECT, RIGHT], [LEFT, OBJECT], [RIGHT]])
def test_states_are_those_of_the_message(bodies: list[int]) -> None:
    x, v = STATE[[0, 2, 4]], STATE[[1, 3, 5]]
    place = {LEFT: 0, OBJECT: 1, RIGHT: 2}
    numbers = [float(values[place[body]]) for values in (x, v) for body in bodies] + [float(INPUTS[b]) for b in bodies]
    template = template_of(JOINT_STATES, [BODIES[body] for body in bodies])
    template.fill(7, [0.0] * len(numbers))  # leaves nothing behind
    found = deserialize_message(template.fill(TIME_NS, numbers), JointState)
    assert found == plain_messages.joint_state(TIME_NS, bodies, STATE, INPUTS)


def test_forces_and_clocks_have_their_time_and_number_whatever_the_frame() -> None:
    cdr = template_of(LEFT_COMMAND).fill(TIME_NS, [-0.1])
    assert (raw_stamp_ns(cdr), raw_force(cdr)) == (TIME_NS, -0.1)
    assert raw_stamp_ns(template_of(CLOCK).fill(TIME_NS, ())) == TIME_NS
    for length in range(20):
        message = plain_messages.wrench(7, -1.5)
        message.header.frame_id = "x" * length
        assert raw_force(serialize_message(message)) == -1.5


def test_a_wrong_number_of_numbers_is_refused() -> None:
    refused = {template_of(LEFT_COMMAND): 2, template_of(LYAPUNOV): 8, template_of(CLOCK): 1}
    for template, count in refused.items():
        with pytest.raises(ValueError, match="sequence of size"):
            template.fill(0, [1.0] * count)
    with pytest.raises(ValueError, match="subsection"):
        Template(lambda _: b"nothing of it", 1)


def verdict(reader: StateReader, cdr: bytes) -> Any:
    try:
        return repr(reader.read(cdr))
    except messages.UNREADABLE as error:
        return type(error)


def taught(names: tuple[str, ...] = NAMES) -> StateReader:
    reader = StateReader(names)
    reader.read(TEMPLATE.fill(7, range(9)))
    return reader


@settings(deadline=None)  # the first one loads the types of the messages
@given(st.integers(0, 2**31 * 10**9 - 1), NUMBERS)
def test_the_numbers_are_those_that_were_written(time_ns: int, numbers: list[float]) -> None:
    state = taught().read(TEMPLATE.fill(time_ns, numbers))
    x, v, (left, other, right) = numbers[:3], numbers[3:6], numbers[6:]
    assert repr(state) == repr(State(time_ns, [x[0], v[0], x[1], v[1], x[2], v[2]], [left, right, other]))


@given(st.integers(0, len(TEMPLATE.fill(7, range(9))) - 1), st.integers(0, 255), NUMBERS)
@example(8 + 4, 1, [0.0] * 9)
def test_a_damaged_byte_is_judged_as_by_a_new_reader(place: int, byte: int, numbers: list[float]) -> None:
    cdr = bytearray(TEMPLATE.fill(7, numbers))
    cdr[place] = byte
    assert verdict(taught(), bytes(cdr)) == verdict(StateReader(NAMES), bytes(cdr))


@given(st.binary(max_size=200), st.integers(0, 190))
def test_what_is_cut_off_or_no_message_at_all_is_judged_as_by_a_new_reader(noise: bytes, length: int) -> None:
    for cdr in (noise, TEMPLATE.fill(7, range(9))[:length], TEMPLATE.fill(7, range(9)) + noise):
        assert verdict(taught(), cdr) == verdict(StateReader(NAMES), cdr)


@pytest.mark.parametrize("names", [NAMES, ("object",), ("right", "left", "x" * 30), ()])
def test_messages_of_rclpy_are_read_too(names: tuple[str, ...]) -> None:
    message = JointState(name=list(names))
    message.header.stamp.sec, message.header.frame_id = 3, "world"
    message.position, message.velocity, message.effort = (array("d", range(k, k + len(names))) for k in (1, 2, 3))
    reader = StateReader(())
    for number in (1.5, -0.0, 1e300):
        if names:
            message.position[0] = number
        state = reader.read(serialize_message(message))
        lists = zip(message.position, message.velocity, message.effort, strict=True)
        there = dict(zip(names, lists, strict=True))
        x, v, force = zip(*(there.get(name, (math.nan, math.nan, 0.0)) for name in NAMES), strict=True)
        wanted = State(3_000_000_000, [x[0], v[0], x[1], v[1], x[2], v[2]], [force[0], force[2], force[1]])
        assert repr(state) == repr(wanted)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(9))
def test_what_is_not_finite_is_refused(number: float, place: int) -> None:
    numbers = [0.0] * 9
    numbers[place] = number
    for reader in (taught(), StateReader(NAMES)):
        assert verdict(reader, TEMPLATE.fill(7, numbers)) is Refused


def test_another_set_of_bodies_is_learnt_and_a_missing_one_refused() -> None:
    reader = taught(("left",))
    other = template_of(JOINT_STATES, ("left", "object"))
    for k in range(3):
        state, n = reader.read(other.fill(k, [k + 0.5] * 6)), k + 0.5
        assert repr(state) == repr(State(k, [n, n, n, n, math.nan, math.nan], [n, 0.0, n]))
    for names in (("object", "right"), ("left", "left")):
        assert verdict(reader, template_of(JOINT_STATES, names).fill(1, [1.0] * 6)) is Refused

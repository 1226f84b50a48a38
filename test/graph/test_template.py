"""A template makes the same messages as those who serialize each anew."""

from __future__ import annotations

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from grasp_ros.graph import rosbag2
from grasp_ros.graph.ros import messages
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.system import NAMES
from grasp_ros.scene.topics import LYAPUNOV_NAMES
from lab.drills.nodes import plain_messages

TIME_NS = 1_234_567_890_123
STATE, INPUTS = np.array([0.1, -0.0, np.inf, 5e-324, -1e300, 0.6]), np.array([7.0, np.pi, -9.0])


def test_lists_are_those_of_the_bag() -> None:
    template = rosbag2.lyapunov_template()
    for values in (np.arange(len(LYAPUNOV_NAMES)), np.full(len(LYAPUNOV_NAMES), np.nan)):
        expected = rosbag2.list_message(TIME_NS, LYAPUNOV_NAMES, values.astype(float))
        assert template.fill(TIME_NS, values.tolist()) == expected


@pytest.mark.parametrize("bodies", [[LEFT, OBJECT, RIGHT], [LEFT, OBJECT], [RIGHT]])
def test_states_are_those_of_the_message(bodies: list[int]) -> None:
    x, v = STATE[[0, 2, 4]], STATE[[1, 3, 5]]
    place = {LEFT: 0, OBJECT: 1, RIGHT: 2}
    numbers = [float(values[place[body]]) for values in (x, v) for body in bodies] + [float(INPUTS[b]) for b in bodies]
    template = rosbag2.state_template([NAMES[body] for body in bodies])
    template.fill(7, [0.0] * len(numbers))  # leaves nothing behind
    found = deserialize_message(template.fill(TIME_NS, numbers), JointState)
    assert found == plain_messages.joint_state(TIME_NS, bodies, STATE, INPUTS)


def test_forces_and_clocks_have_their_time_and_number() -> None:
    cdr = rosbag2.force_template().fill(TIME_NS, [-0.1])
    assert (messages.raw_stamp_ns(cdr), messages.raw_force(cdr)) == (TIME_NS, -0.1)
    assert messages.raw_stamp_ns(rosbag2.clock_template().fill(TIME_NS, ())) == TIME_NS


def test_a_wrong_number_of_numbers_is_refused() -> None:
    refused = {rosbag2.force_template(): 2, rosbag2.lyapunov_template(): 8, rosbag2.clock_template(): 1}
    for template, count in refused.items():
        with pytest.raises(ValueError, match="sequence of size"):
            template.fill(0, [1.0] * count)
    with pytest.raises(ValueError, match="subsection"):
        rosbag2.Template(lambda _: b"nothing of it", 1)

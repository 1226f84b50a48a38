"""Messages as rclpy makes them: what a node sends that is not of this package.

Jazzy does not check fields: an int or a numpy scalar in a float field travels as garbage. Every number that enters
a message goes through float() here.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import WrenchStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from grasp_ros.graph.ros.messages import to_time
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import FRAME, LYAPUNOV_NAMES


def to_ns(stamp: Time) -> int:
    """Integer time in ns of a stamp."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def joint_state(time_ns: int, bodies: Sequence[int], state: Array, inputs: Array) -> JointState:
    """State (6,) of some bodies, and the input forces (3,) in N by body."""
    message = JointState(name=[NAMES[body] for body in bodies])
    message.header.stamp = to_time(time_ns)
    message.position = array("d", [state[COLUMN[body]] for body in bodies])
    message.velocity = array("d", [state[COLUMN[body] + 1] for body in bodies])
    message.effort = array("d", [inputs[body] for body in bodies])
    return message


def wrench(time_ns: int, force: float) -> WrenchStamped:
    """A force along the line in N."""
    message = WrenchStamped()
    message.header.stamp = to_time(time_ns)
    message.header.frame_id = FRAME
    message.wrench.force.x = float(force)
    return message


def lyapunov(time_ns: int, values: Sequence[float]) -> JointState:
    """What the monitor computes at a tick, see `topics.LYAPUNOV_NAMES`."""
    message = JointState(name=LYAPUNOV_NAMES)
    message.header.stamp = to_time(time_ns)
    message.position = array("d", [float(value) for value in values])
    return message


def clock(time_ns: int) -> Clock:
    """Simulated time."""
    return Clock(clock=to_time(time_ns))

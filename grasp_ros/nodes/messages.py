"""Conversion between numbers and messages, in one place.

Jazzy does not check fields: an int or a numpy scalar in a float field travels as garbage. Every number that enters
a message goes through float() here.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Mapping, Sequence

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from grasp_ros.physics.model import Array
from grasp_ros.scene import NANOSECONDS
from grasp_ros.topics import (
    BODY_NAMES,
    CLOCK,
    DEPTH,
    DIAGNOSTICS,
    JOINT_STATES,
    LEFT_COMMAND,
    LEFT_CONTACT,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    RIGHT_COMMAND,
    RIGHT_CONTACT,
    SCENE,
    Topic,
)

TYPES = {
    JOINT_STATES: JointState,
    LEFT_COMMAND: WrenchStamped,
    RIGHT_COMMAND: WrenchStamped,
    LEFT_CONTACT: WrenchStamped,
    RIGHT_CONTACT: WrenchStamped,
    LYAPUNOV: JointState,
    SCENE: String,
    CLOCK: Clock,
    DIAGNOSTICS: DiagnosticArray,
}
_STAMP = struct.Struct("<iI")  # sec, nanosec of the header that a stamped message begins with
_CDR_HEADER = 4


def qos(topic: Topic) -> QoSProfile:
    """Reliable everywhere: a lost message would stop the lockstep."""
    return QoSProfile(
        depth=1 if topic.latched else DEPTH,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE,
    )


def to_time(time_ns: int) -> Time:
    """Stamp of an integer time in ns."""
    return Time(sec=time_ns // NANOSECONDS, nanosec=time_ns % NANOSECONDS)


def to_ns(stamp: Time) -> int:
    """Integer time in ns of a stamp."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def raw_stamp_ns(cdr: bytes) -> int:
    """Integer time in ns of a serialized stamped message, without deserializing it."""
    sec, nanosec = _STAMP.unpack_from(cdr, _CDR_HEADER)
    return int(sec * NANOSECONDS + nanosec)


def joint_state(time_ns: int, state: Array, efforts: Sequence[float]) -> JointState:
    """State (6,) and the input forces of the arms in N."""
    message = JointState(name=BODY_NAMES)
    message.header.stamp = to_time(time_ns)
    message.position = array("d", state[0::2])
    message.velocity = array("d", state[1::2])
    message.effort = array("d", (efforts[0], 0.0, efforts[1]))
    return message


def state_of(message: JointState) -> Array:
    """State (6,) of a `joint_state`, by the names of the bodies.

    Raises
    ------
    ValueError
        If a body is missing.
    """
    rows = [message.name.index(name) for name in BODY_NAMES]
    return np.array([number for row in rows for number in (message.position[row], message.velocity[row])])


def wrench(time_ns: int, force: float) -> WrenchStamped:
    """A force along the line in N."""
    message = WrenchStamped()
    message.header.stamp = to_time(time_ns)
    message.wrench.force.x = float(force)
    return message


def lyapunov(time_ns: int, values: Sequence[float]) -> JointState:
    """V, V_c, V_rate and mode as a named, stamped list that plotters show by name."""
    message = JointState(name=LYAPUNOV_NAMES)
    message.header.stamp = to_time(time_ns)
    message.position = array("d", values)
    return message


def clock(time_ns: int) -> Clock:
    """Simulated time."""
    return Clock(clock=to_time(time_ns))


def text(content: str) -> String:
    """A text."""
    return String(data=content)


def diagnostics(stamp: Time, name: str, summary: str, healthy: bool, values: Mapping[str, object]) -> DiagnosticArray:
    """One node's health."""
    status = DiagnosticStatus(
        level=DiagnosticStatus.OK if healthy else DiagnosticStatus.WARN,
        name=name,
        message=summary,
        hardware_id="grasp_ros",
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message

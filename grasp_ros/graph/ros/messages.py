"""Messages of ROS: their types and qualities of service, and how a state is read.

The layout of messages with numbers, byte by byte, is in `graph.serialization`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection, Iterable
from itertools import chain
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.duration import Infinite
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from grasp_ros.graph.serialization import Template, template_of
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.system import BODIES, NAMES
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import CLOCK, JOINT_STATES, SCENE, Topic

TYPES = {
    "sensor_msgs/msg/JointState": JointState,
    "geometry_msgs/msg/WrenchStamped": WrenchStamped,
    "std_msgs/msg/String": String,
    "rosgraph_msgs/msg/Clock": Clock,
    "diagnostic_msgs/msg/DiagnosticArray": DiagnosticArray,
    "visualization_msgs/msg/MarkerArray": MarkerArray,
}
READER_DEPTH = 10  # of texts, which may be large
FOREVER = Infinite.nanoseconds
AUTOMATIC = LivelinessPolicy.SYSTEM_DEFAULT, LivelinessPolicy.AUTOMATIC
ABSENT = [0.0, math.nan]  # force on a body that a state does not name, and its position and velocity
UNREADABLE = (RuntimeError, ValueError, struct.error)  # raised for bytes that are no message of a type


def qos(topic: Topic) -> QoSProfile:
    """Reliable everywhere: a lost message would stop the lockstep."""
    return QoSProfile(
        depth=topic.depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE,
    )


def reader_qos(topic: Topic) -> QoSProfile:
    """QoS of a reader, which keeps more messages than a writer.

    All writers of a topic share the queue of a reader. If it kept only the last messages, a writer that floods the
    topic would push out those of the others. So it keeps all, up to the 5000 of Fast DDS, which lets the writers wait.
    """
    if topic == CLOCK:  # whose readers are ROS's own
        return glance_qos(topic)
    profile = qos(topic)
    if topic.type == SCENE.type:
        profile.depth = max(profile.depth, READER_DEPTH)
    else:
        profile.history = HistoryPolicy.KEEP_ALL
    return profile


def glance_qos(topic: Topic) -> QoSProfile:
    """QoS of a reader that may miss messages, except latched ones, so that nobody waits for it."""
    return qos(topic) if topic.latched else QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.BEST_EFFORT)


def connects(writer: QoSProfile, reader: QoSProfile) -> bool:
    """Whether DDS connects them; `rclpy.qos.qos_check_compatible` takes an infinite deadline for a finite one."""
    # A smaller reliability or durability promises more, and so does a shorter time; a time of 0 means forever.
    times = ((writer.deadline, reader.deadline), (writer.liveliness_lease_duration, reader.liveliness_lease_duration))
    return (writer.reliability <= reader.reliability and writer.durability <= reader.durability
            and reader.liveliness in (*AUTOMATIC, writer.liveliness)
            and all((offered.nanoseconds or FOREVER) <= (asked.nanoseconds or FOREVER) for offered, asked in times))


def to_time(time_ns: int) -> Time:
    """Stamp of an integer time in ns."""
    return Time(sec=time_ns // NANOSECONDS, nanosec=time_ns % NANOSECONDS)


class State(NamedTuple):
    """A state of the plant."""

    time_ns: int
    numbers: list[float]  # (6,) m and m/s, in the order of `system.COLUMN`; NaN for a body that it does not name
    inputs: list[float]  # (3,) forces of the controllers that acted until then, N by body; 0 for such a body


class StateReader:
    """Reads serialized states; those laid out as this package does it at a tenth of the cost."""

    def __init__(self, names: Collection[str]) -> None:
        self._needed = names  # of bodies that every state has
        self._template: Template | None = None
        self._indices: list[int] = []  # of the six numbers and three inputs in a message

    def read(self, cdr: bytes) -> State:
        """A state.

        Raises
        ------
        RuntimeError, Refused or struct.error, which is `UNREADABLE`
            If a message is none: not to be decoded, lists that differ in length, names missing or there twice, NaN.
        """
        found = self._template.read(cdr) if self._template is not None else None
        seconds, nanoseconds, *numbers = found or self._decoded(cdr)
        # A finite sum says that all are, at once; one that overflows says nothing.
        if not math.isfinite(sum(numbers)) and not all(map(math.isfinite, numbers)):
            raise Refused("a number of a state is not finite")
        numbers += ABSENT
        picked = [numbers[i] for i in self._indices]
        return State(seconds * NANOSECONDS + nanoseconds, picked[:6], picked[6:])

    def _decoded(self, cdr: bytes) -> Iterable[Any]:
        """Time and numbers of a message of any make; those of the same names are read by template from now on."""
        message = deserialize_message(cdr, JointState)
        name, lists = tuple(message.name), (message.position, message.velocity, message.effort)
        if any(len(values) != len(name) for values in lists) or not {*self._needed} <= {*name} or (
            len({*name}) < len(name)
        ):
            raise Refused(f"no state of {', '.join(self._needed)}: {', '.join(name)}")
        self._template, n = template_of(JOINT_STATES, name), len(name)
        at = {body: name.index(word) if word in name else None for body, word in NAMES.items()}
        kinds = [(body, kind) for body in BODIES for kind in (0, 1)] + [(body, 2) for body in sorted(BODIES)]
        self._indices = [-1 - (kind == 2) if (i := at[body]) is None else kind * n + i for body, kind in kinds]
        return chain((message.header.stamp.sec, message.header.stamp.nanosec), *lists)

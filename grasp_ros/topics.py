"""The topics of the graph, by their relative names; shared by the nodes and the bags."""

from __future__ import annotations

from typing import NamedTuple

DEPTH = 1000  # samples that a publisher keeps for a reader that is behind
WINDOW = 500  # ticks that the plant may be ahead of a monitor it waits for; below DEPTH, so that nothing is lost


class Topic(NamedTuple):
    """A topic of the graph."""

    name: str
    type: str
    latched: bool = False  # transient local: who comes later gets the last message


JOINT_STATES = Topic("joint_states", "sensor_msgs/msg/JointState")
LEFT_COMMAND = Topic("left/effort_command", "geometry_msgs/msg/WrenchStamped")
RIGHT_COMMAND = Topic("right/effort_command", "geometry_msgs/msg/WrenchStamped")
LEFT_CONTACT = Topic("contact/left", "geometry_msgs/msg/WrenchStamped")
RIGHT_CONTACT = Topic("contact/right", "geometry_msgs/msg/WrenchStamped")
LYAPUNOV = Topic("lyapunov", "sensor_msgs/msg/JointState")
SCENE = Topic("scene", "std_msgs/msg/String", latched=True)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock")
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")

PER_TICK = (JOINT_STATES, LEFT_COMMAND, RIGHT_COMMAND, LEFT_CONTACT, RIGHT_CONTACT, LYAPUNOV)
BODY_NAMES = ["left", "object", "right"]
LYAPUNOV_NAMES = ["V", "V_c", "V_rate", "mode"]

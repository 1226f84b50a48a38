"""The topics of the graph, by their relative names; shared by the nodes and the bags."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES

FRAME = "line"  # in which the forces are given: x along the line on which all moves
DEPTH = 1000  # samples that a publisher keeps for a reader that is behind
WINDOW = 500  # ticks that the plant may be ahead of a monitor it waits for; below DEPTH, so that nothing is lost


class Topic(NamedTuple):
    """A topic of the graph."""

    name: str
    type: str
    latched: bool = False  # transient local: who comes later gets what was sent before
    depth: int = DEPTH


FORCE = "geometry_msgs/msg/WrenchStamped"
NAMED_LIST = "sensor_msgs/msg/JointState"
JOINT_STATES = Topic("joint_states", NAMED_LIST)
LEFT_COMMAND = Topic("left/effort_command", FORCE)
RIGHT_COMMAND = Topic("right/effort_command", FORCE)
LEFT_CONTACT = Topic("contact/left", FORCE)
RIGHT_CONTACT = Topic("contact/right", FORCE)
LYAPUNOV = Topic("lyapunov", NAMED_LIST)
SCENE = Topic("scene", "std_msgs/msg/String", latched=True, depth=1)
RUN = Topic("run", "std_msgs/msg/String", latched=True, depth=1)
TIMING = Topic("timing", NAMED_LIST)
MARKERS = Topic("markers", "visualization_msgs/msg/MarkerArray", depth=1)
ROBOT_DESCRIPTION = Topic("robot_description", "std_msgs/msg/String", latched=True, depth=1)
ALIVE = Topic("alive", "std_msgs/msg/String", depth=10)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock")
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")

COMMANDS = {"left": LEFT_COMMAND, "right": RIGHT_COMMAND}
CONTACTS = {"left": LEFT_CONTACT, "right": RIGHT_CONTACT}
EXTERNAL_FORCES = {name: Topic(f"external_force/{name}", FORCE) for name in ("left_arm", "object", "right_arm")}
CHANGES = {side: Topic(f"{side}/parameters", NAMED_LIST, latched=True, depth=1) for side in ("left", "right")}
MOST_DIGITS = 10  # of a number of an announcement
LYAPUNOV_NAMES = ["V", "V_c", "V_rate", "mode", "unexplained", "alarm", "V_plant", "work", "closed"]


class Numbers:
    """Counts the announcements of a controller that are missing: they are numbered from 1 on, where it numbers them."""

    def __init__(self) -> None:
        self._last = 0

    def take(self, message: Any) -> int:
        """How many are missing between the message before and this one."""
        word = message.header.frame_id
        number = int(word) if word.isascii() and word.isdecimal() and len(word) < MOST_DIGITS else 0
        before, self._last = self._last, number
        return max(number - before - 1, 0) if before and number else 0


def state_of(message: Any, many: tuple[int, ...] = ()) -> tuple[Array, Array]:
    """State (6,) and input forces (3,) of a `joint_states` message; NaN and 0 for a body that it does not name.

    Where the numbers of the message are columns (n,), with `many` = (n,), they are (6, n) and (3, n).
    """
    state, inputs = np.full((6, *many), np.nan), np.zeros((3, *many))
    for body, name in NAMES.items():
        if name in message.name:
            row = message.name.index(name)
            state[COLUMN[body] : COLUMN[body] + 2] = message.position[row], message.velocity[row]
            inputs[body] = message.effort[row]
    return state, inputs

"""The topics of the graph, by their relative names; shared by the nodes and the bags."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

FRAME = "line"  # in which the forces are given: x along the line on which all moves
DEPTH = 1000  # samples that a publisher keeps for a reader that is behind
WINDOW = 500  # ticks that the plant may be ahead of a monitor it waits for; below DEPTH, so that nothing is lost


class Topic(NamedTuple):
    """A topic of the graph."""

    name: str
    type: str
    sender: str = ""
    text: str = ""  # what its messages mean
    latched: bool = False  # transient local: a late subscriber gets what was sent before
    depth: int = DEPTH


FORCE = "geometry_msgs/msg/WrenchStamped"
NAMED_LIST = "sensor_msgs/msg/JointState"
TEXT = "std_msgs/msg/String"

JOINT_STATES = Topic(
    "joint_states", NAMED_LIST, "plant", "`left`, `object`, `right`, those in the scene: position in m, velocity in"
    " m/s; effort: the input force applied until this stamp in N.")
COMMANDS = {
    side: Topic(f"{side}/effort_command", FORCE, f"{side} controller",
                "force.x: force on the arm in N; the stamp is that of the state that it answers.")
    for side in ("left", "right")
}
CONTACTS = {
    side: Topic(f"contact/{side}", FORCE, "plant", "force.x: impact force at this stamp in N.")
    for side in ("left", "right")
}
LEFT_COMMAND, RIGHT_COMMAND = COMMANDS.values()
LEFT_CONTACT, RIGHT_CONTACT = CONTACTS.values()
LYAPUNOV = Topic("lyapunov", NAMED_LIST, "monitor", "position: the values below, by name.")
SCENE = Topic("scene", TEXT, "plant", "The whole scene as YAML.", latched=True, depth=1)
RUN = Topic("run", TEXT, "plant", "How it runs, as YAML: lockstep or free-running, accuracy, timeouts.",
            latched=True, depth=1)
TIMING = Topic("timing", NAMED_LIST, "plant", "Free-running only: quality of the timing, once a second.")
MARKERS = Topic("markers", "visualization_msgs/msg/MarkerArray", "monitor", "Bodies, springs and forces for RViz.",
                depth=1)
ROBOT_DESCRIPTION = Topic("robot_description", TEXT, "monitor", "URDF with a joint for each name of `joint_states`.",
                          latched=True, depth=1)
ALIVE = Topic("alive", TEXT, "all nodes", "Heartbeat of each process.", depth=10)
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", "plant", "Simulated time.")
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "all nodes",
                    "State and counters of each node, once a second.")

EXTERNAL_FORCES = {
    name: Topic(f"external_force/{name}", FORCE, "plant", "force.x: external force from this stamp on in N.")
    for name in ("left_arm", "object", "right_arm")
}
CHANGES = {
    side: Topic(f"{side}/parameters", NAMED_LIST, f"{side} controller",
                "Numbers of the feedback law; the stamp is that of the first state to which they apply.",
                latched=True, depth=1)
    for side in ("left", "right")
}
MOST_DIGITS = 10  # of a number of an announcement
LYAPUNOV_VALUES = {
    "V": "the paper's function (16), twice the energy, J; NaN unless `closed`",
    "V_c": "V with the elastic term of a pair kept whenever u >= 0, J; NaN unless `closed`",
    "V_rate": "(18), the rate of V_c under continuous feedback, W; NaN unless `closed`",
    "mode": "contacts: 0 none, 1 left, 2 right, 3 both",
    "unexplained": "residual of the energy balance over the last period, J: energy gained less work of the held forces;"
                   " dissipation makes it negative",
    "alarm": "1 if the residual is positive by more than rounding",
    "V_plant": "twice the energy of the plant without feedback, J",
    "work": "twice the work of the held forces over the last period, J",
    "closed": "1 while every controller runs the law that it announced",
}
LYAPUNOV_NAMES = [*LYAPUNOV_VALUES]


def timing_names(sides: Iterable[str]) -> list[str]:
    """Names of what `timing` carries, in their order, see `free_running.Timing`."""
    return ["period_s", "jitter_s", "late_p99_s", "overruns", "lost_s", "reached", *(
        f"{side}_{name}" for side in sides
        for name in ("age_p99", "age_max", "age_p99_all", "age_max_all", "timed_out_all"))]


def named(values: Iterable[float]) -> dict[str, float]:
    """What `lyapunov` carries, by name."""
    return dict(zip(LYAPUNOV_NAMES, (float(value) for value in values), strict=True))


class Numbers:
    """Counts the announcements of a controller that are missing: they are numbered from 1 on, where it numbers them.

    `late`: for a subscriber that may have come late, which misses none before its first one.
    """

    def __init__(self, late: bool = False) -> None:
        self._last = None if late else 0

    def take(self, message: Any) -> int:
        """How many are missing between the message before and this one."""
        word = message.header.frame_id
        number = int(word) if word.isascii() and word.isdecimal() and len(word) < MOST_DIGITS else 0
        before, self._last = self._last, number
        return max(number - before - 1, 0) if before is not None and number else 0

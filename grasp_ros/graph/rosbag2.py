"""What rosbag2 wants to know of a bag: messages and their definitions, QoS profiles, metadata of the directory."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from grasp_ros.physics.errors import Refused
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import (
    CHANGES,
    CLOCK,
    DIAGNOSTICS,
    FORCE,
    FRAME,
    LYAPUNOV_NAMES,
    NAMED_LIST,
    RUN,
    SCENE,
    TIMING,
    Topic,
)

VERSION = 9  # of the metadata
PROFILE, ENCODING, SCHEMA_ENCODING = "ros2", "cdr", "ros2msg"
METADATA_RECORD, METADATA_KEY = "rosbag2", "serialized_metadata"  # where rosbag2 looks within an MCAP file
TOPIC = "topic "  # how the keys of topics' full names begin
INFORMATION = "rosbag2_bagfile_information"
_TYPES = get_typestore(Stores.ROS2_JAZZY)
NOTHING = np.zeros(0)
_STAMP, _NUMBER = struct.Struct("<iI"), struct.Struct("<d")
_STAMP_AT = 4  # behind the header of CDR, in a stamped message and in /clock
_MARK = 1.2345678901234567e-200  # of which nothing else in a message has a multiple
_NO_LIMIT = {"sec": 9223372036, "nsec": 854775807}  # what Fast DDS reports for an infinite duration


class BagError(Refused):
    """A bag that cannot be written or read: names the path and the reason."""


def topics_of(scene: Scene) -> list[Topic]:
    """Topics of a bag, in the order of their connections."""
    return [SCENE, RUN, CLOCK, *scene.topics, *CHANGES.values(), TIMING, DIAGNOSTICS]


def names_of(scene: Scene, custom: Mapping[str, str]) -> dict[Topic, str]:
    """Full names of the topics of a bag; where it says nothing of one, without a namespace."""
    return {topic: custom.get(f"{TOPIC}{topic.name}", f"/{topic.name.lstrip('/')}") for topic in topics_of(scene)}


def qos_profiles(topic: Topic) -> list[dict[str, Any]]:
    """What the publisher of a topic offers."""
    return [{
        "history": "keep_last", "depth": topic.depth, "reliability": "reliable",
        "durability": "transient_local" if topic.latched else "volatile", "deadline": _NO_LIMIT.copy(),
        "lifespan": _NO_LIMIT.copy(), "liveliness": "automatic", "liveliness_lease_duration": _NO_LIMIT.copy(),
        "avoid_ros_namespace_conventions": False,
    }]


@cache
def definition(kind: str) -> bytes:
    """Definition of a message type with all types that it uses."""
    return _TYPES.generate_msgdef(kind, ros_version=2)[0].encode()


def metadata(
    file: str, counts: Mapping[Topic, int], names: Mapping[Topic, str], last_ns: int, custom: Mapping[str, str]
) -> dict[str, Any]:
    """Document of metadata.yaml: of one file from time 0 to `last_ns`, with `custom` for rosbag2 to carry along."""
    start, duration = {"nanoseconds_since_epoch": 0}, {"nanoseconds": last_ns}
    total = sum(counts.values())
    return {INFORMATION: {
        "version": VERSION, "storage_identifier": "mcap", "duration": duration, "starting_time": start,
        "message_count": total,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": names[topic], "type": topic.type, "serialization_format": ENCODING,
                    "offered_qos_profiles": qos_profiles(topic),
                    "type_description_hash": _TYPES.hash_rihs01(topic.type),
                },
                "message_count": count,
            }
            for topic, count in counts.items()
        ],
        "compression_format": "", "compression_mode": "", "relative_file_paths": [file],
        "files": [
            {"path": file, "starting_time": dict(start), "duration": dict(duration), "message_count": total}
        ],
        "custom_data": dict(custom), "ros_distro": "jazzy",
    }}


def text_message(text: str) -> bytes:
    """A text, serialized."""
    return bytes(_TYPES.serialize_cdr(_TYPES.types[SCENE.type](data=text), SCENE.type))


def list_message(
    time_ns: int, names: Sequence[str], position: Array, velocity: Array = NOTHING, effort: Array = NOTHING,
    frame: str = "",
) -> bytes:
    """A stamped list of numbers with names, serialized; rclpy would pad it with stray bytes."""
    return bytes(_TYPES.serialize_cdr(_TYPES.types[NAMED_LIST](
        header=_header(time_ns, frame), name=list(names), position=position, velocity=velocity, effort=effort
    ), NAMED_LIST))


def numbers_message(time_ns: int, numbers: Mapping[str, float], number: int = 0) -> bytes:
    """The same of numbers by their names; numbered where none may be missed."""
    return list_message(time_ns, list(numbers), np.array([*numbers.values()], dtype=float), frame=str(number or ""))


class Template:
    """A message that is serialized once; with another time and other numbers it costs a tenth of making it anew.

    `serialize` makes it of a list of `count` numbers; it begins with a stamp. What it writes it also reads.
    """

    def __init__(self, serialize: Callable[[list[float]], bytes], count: int) -> None:
        self.count, size = count, _NUMBER.size
        marks = [_MARK * (number + 1) for number in range(count)]
        cdr = bytes(serialize(marks))
        places = [cdr.index(_NUMBER.pack(mark)) for mark in marks]
        ends = [_STAMP_AT + _STAMP.size, *(place + size for place in places)]
        gaps = [begin - end for end, begin in zip(ends, [*places, len(cdr)], strict=True)]  # before, between and behind
        self._form = struct.Struct(f"<{_STAMP_AT}siI" + "d".join(f"{gap}s" for gap in gaps))
        self._parts = list(self._form.unpack(cdr))  # head, seconds, nanoseconds; then gaps and numbers in turn
        self._gaps = tuple(self._parts[3::2])

    def fill(self, time_ns: int, numbers: Sequence[float]) -> bytes:
        """The serialized message of a time and some numbers."""
        self._parts[1:3] = divmod(time_ns, NANOSECONDS)
        self._parts[4::2] = numbers
        return self._form.pack(*self._parts)

    def read(self, cdr: bytes) -> tuple[Any, ...] | None:
        """Seconds, nanoseconds and numbers of a message that differs in nothing else; None of any other."""
        if len(cdr) != self._form.size:
            return None
        parts = self._form.unpack(cdr)
        return parts[1:3] + parts[4::2] if parts[0] == self._parts[0] and parts[3::2] == self._gaps else None


def lyapunov_template() -> Template:
    """Of what the monitor computes at a tick, see `topics.LYAPUNOV_NAMES`."""
    return Template(lambda numbers: list_message(0, LYAPUNOV_NAMES, np.array(numbers)), len(LYAPUNOV_NAMES))


def clock_template() -> Template:
    """Of simulated times."""
    clock = _TYPES.types[CLOCK.type](clock=_header(0).stamp)
    return Template(lambda _: bytes(_TYPES.serialize_cdr(clock, CLOCK.type)), 0)


def state_template(names: Sequence[str]) -> Template:
    """Of the states of some bodies: all positions, all velocities, all input forces."""
    return Template(lambda numbers: list_message(0, names, *np.array(numbers).reshape(3, -1)), 3 * len(names))


def force_template() -> Template:
    """Of forces along the line, in N."""
    return Template(lambda numbers: force_message(0, *numbers), 1)


def force_message(time_ns: int, force: float) -> bytes:
    """A stamped force along the line in N, serialized."""
    kind = _TYPES.types
    vector = partial(kind["geometry_msgs/msg/Vector3"], y=0.0, z=0.0)
    wrench = kind["geometry_msgs/msg/Wrench"](force=vector(x=float(force)), torque=vector(x=0.0))
    return bytes(_TYPES.serialize_cdr(kind[FORCE](header=_header(time_ns, FRAME), wrench=wrench), FORCE))


def _header(time_ns: int, frame: str = "") -> Any:
    seconds, nanoseconds = divmod(time_ns, NANOSECONDS)
    stamp = _TYPES.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return _TYPES.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def decode(topic: Topic, cdr: bytes) -> Any:
    """A serialized message of a topic.

    Raises
    ------
    rosbags.serde.SerdeError, or what `scene.files.DAMAGE` lists
        If it is none.
    """
    return _TYPES.deserialize_cdr(cdr, topic.type)

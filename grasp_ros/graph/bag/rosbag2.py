"""What rosbag2 wants to know of a bag: definitions of messages, QoS profiles, metadata of the directory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rosbags.typesys import Stores, get_typestore

from grasp_ros.scene import Scene
from grasp_ros.scene.topics import CHANGES, CLOCK, DIAGNOSTICS, RUN, SCENE, TIMING, Topic

VERSION = 9  # of the metadata
PROFILE, ENCODING, SCHEMA_ENCODING = "ros2", "cdr", "ros2msg"
METADATA_RECORD, METADATA_KEY = "rosbag2", "serialized_metadata"  # where rosbag2 looks within an MCAP file
TOPIC = "topic "  # how the keys of topics' full names begin
INFORMATION = "rosbag2_bagfile_information"
_TYPES = get_typestore(Stores.ROS2_JAZZY)
_NO_LIMIT = {"sec": 9223372036, "nsec": 854775807}  # what Fast DDS reports for an infinite duration


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


def decode(topic: Topic, cdr: bytes) -> Any:
    """A serialized message of a topic.

    Raises
    ------
    rosbags.serde.SerdeError, or what `scene.files.DAMAGE` lists
        If it is none.
    """
    return _TYPES.deserialize_cdr(cdr, topic.type)

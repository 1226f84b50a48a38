"""Recording and reading bags: rosbag2 directories with MCAP storage, stamped in simulated time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer, WriterError
from rosbags.typesys import Stores, get_typestore

from grasp_ros import scene as scenes
from grasp_ros.physics.model import Array
from grasp_ros.topics import (
    DEPTH,
    JOINT_STATES,
    LEFT_COMMAND,
    LEFT_CONTACT,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    PER_TICK,
    RIGHT_COMMAND,
    RIGHT_CONTACT,
    SCENE,
    Topic,
)

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_NO_LIMIT = QosTime(9223372036, 854775807)  # what Fast DDS reports for an infinite duration


class BagError(ValueError):
    """A bag that cannot be written or read: names the path and the reason."""


def _qos(topic: Topic) -> Qos:
    return Qos(
        QosHistory.KEEP_LAST, 1 if topic.latched else DEPTH, QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if topic.latched else QosDurability.VOLATILE, _NO_LIMIT, _NO_LIMIT,
        QosLiveliness.AUTOMATIC, _NO_LIMIT, False,
    )


class Recorder:
    """Writes one bag: the scene and the versions first, then ticks.

    Parameters
    ----------
    path : Path
        Directory that does not exist yet.
    scene_yaml : str
        The resolved scene.
    versions : mapping of str to str
        Stored in the bag's metadata.

    Raises
    ------
    BagError
        If the directory exists or cannot be written.
    """

    def __init__(self, path: Path, scene_yaml: str, versions: dict[str, str]) -> None:
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        try:
            self._writer.open()
        except (WriterError, OSError) as error:
            raise BagError(f"{path}: cannot be written: {error}") from None
        self._writer.set_custom_data("scene", scene_yaml)
        for name, version in sorted(versions.items()):
            self._writer.set_custom_data(f"version {name}", version)
        self._connections: dict[str, Connection] = {
            topic.name: self._writer.add_connection(
                f"/{topic.name}", topic.type, typestore=_TYPES, offered_qos_profiles=[_qos(topic)]
            )
            for topic in (SCENE, *PER_TICK)
        }
        string = _TYPES.types[SCENE.type](data=scene_yaml)
        self.write(SCENE, 0, bytes(_TYPES.serialize_cdr(string, SCENE.type)))

    def write(self, topic: Topic, time_ns: int, cdr: bytes) -> None:
        """Append one serialized message with its simulated time."""
        self._writer.write(self._connections[topic.name], time_ns, cdr)

    def write_lyapunov(self, time_ns: int, values: Sequence[float]) -> None:
        """Append the monitor's own values; serialized here, because rclpy pads this type with stray bytes."""
        types = _TYPES.types
        seconds, nanoseconds = divmod(time_ns, scenes.NANOSECONDS)
        stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        nothing = np.zeros(0)
        message = types[LYAPUNOV.type](
            header=header, name=LYAPUNOV_NAMES, position=np.array(values), velocity=nothing, effort=nothing
        )
        self.write(LYAPUNOV, time_ns, bytes(_TYPES.serialize_cdr(message, LYAPUNOV.type)))

    def close(self) -> None:
        """Finish the bag; only now it has its metadata."""
        self._writer.close()



@dataclass(frozen=True)
class Recording:
    """What is in a bag.

    Attributes
    ----------
    path : Path
    scene : Scene
    versions : dict of str to str
        What the recording process ran with.
    counts : dict of str to int
        Messages by topic.
    tick : int array (n,)
        Ticks whose state is in the bag.
    state : array (n, 6), m and m/s
    effort, command, contact : arrays (n, 2), N
        Input forces applied until the tick, commands answered to it, impact forces at it; NaN where missing.
    lyapunov : array (n, 4)
        V, V_c, V_rate and mode as the monitor computed them; NaN where missing.
    """

    path: Path
    scene: scenes.Scene
    versions: dict[str, str]
    counts: dict[str, int]
    tick: np.ndarray
    state: Array
    effort: Array
    command: Array
    contact: Array
    lyapunov: Array

    @property
    def t(self) -> Array:
        """Times in s."""
        return np.array([self.scene.time_of(tick) for tick in self.tick.tolist()])

    @property
    def missing(self) -> dict[str, int]:
        """Ticks up to the last one recorded that have no message, by topic."""
        ticks = int(self.tick.max(initial=-1)) + 1
        return {topic.name: ticks - self.counts[topic.name] for topic in PER_TICK}


def read(path: Path) -> Recording:
    """Read a bag that the monitor recorded, with the rosbags reader.

    Raises
    ------
    BagError
        If the path is not such a bag.
    """
    try:
        metadata = yaml.safe_load((path / "metadata.yaml").read_text(encoding="utf-8"))
        custom = metadata["rosbag2_bagfile_information"]["custom_data"]
        with Reader(path) as reader:
            scene = scenes.parse(custom["scene"], path.name, str(path))
            columns = {topic.name: _column(reader, topic, scene) for topic in PER_TICK}
    except (ReaderError, KeyError, TypeError, OSError, ValueError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise BagError(f"{path}: not a bag of this package: {reason}") from None
    ticks, joints = columns[JOINT_STATES.name]

    def aligned(topic: Topic) -> Array:
        found, values = columns[topic.name]
        result = np.full((len(ticks), values.shape[1]), np.nan)
        _, here, there = np.intersect1d(ticks, found, return_indices=True)
        result[here] = values[there]
        return result

    return Recording(
        path, scene, {k.removeprefix("version "): v for k, v in custom.items() if k.startswith("version ")},
        {name: len(found) for name, (found, _) in columns.items()}, ticks, joints[:, :6], joints[:, [6, 8]],
        np.hstack([aligned(LEFT_COMMAND), aligned(RIGHT_COMMAND)]),
        np.hstack([aligned(LEFT_CONTACT), aligned(RIGHT_CONTACT)]), aligned(LYAPUNOV),
    )


def _column(reader: Reader, topic: Topic, scene: scenes.Scene) -> tuple[np.ndarray, Array]:
    connections = [connection for connection in reader.connections if connection.topic == f"/{topic.name}"]
    ticks, rows = [], []
    for _, time_ns, raw in reader.messages(connections) if connections else ():
        message = _TYPES.deserialize_cdr(raw, topic.type)
        ticks.append(time_ns // scene.period_ns)
        rows.append(_values(topic, message))
    return np.array(ticks, dtype=np.int64), np.array(rows).reshape(len(rows), -1)


def _values(topic: Topic, message: object) -> np.ndarray:
    if topic == JOINT_STATES:
        pairs = np.stack([message.position, message.velocity], axis=1)  # type: ignore[attr-defined]
        return np.concatenate([pairs.ravel(), message.effort])  # type: ignore[attr-defined]
    if topic == LYAPUNOV:
        return np.asarray(message.position)  # type: ignore[attr-defined]
    return np.array([message.wrench.force.x])  # type: ignore[attr-defined]

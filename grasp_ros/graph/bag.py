"""Recording and reading bags: rosbag2 directories with MCAP storage, stamped in simulated time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

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
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from grasp_ros import scene as scenes
from grasp_ros.graph import running as runnings
from grasp_ros.graph.running import Running
from grasp_ros.physics.energy import Energy, energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.effects.force import SECTIONS
from grasp_ros.scene.files import decoding, writing
from grasp_ros.scene.topics import (
    CHANGES,
    CLOCK,
    DIAGNOSTICS,
    EXTERNAL_FORCES,
    JOINT_STATES,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    RUN,
    SCENE,
    TIMING,
    Topic,
    state_of,
)

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_NO_LIMIT = QosTime(9223372036, 854775807)  # what Fast DDS reports for an infinite duration


class BagError(Refused):
    """A bag that cannot be written or read: names the path and the reason."""


def _qos(topic: Topic) -> Qos:
    return Qos(
        QosHistory.KEEP_LAST, topic.depth, QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if topic.latched else QosDurability.VOLATILE, _NO_LIMIT, _NO_LIMIT,
        QosLiveliness.AUTOMATIC, _NO_LIMIT, False,
    )


class Recorder:
    """Writes one bag: the scene and the versions first, then ticks.

    Parameters
    ----------
    path : Path
        Directory that does not exist yet.
    scene : Scene
        Its topics get a connection each.
    versions : mapping of str to str
        Stored in the bag's metadata.
    names : mapping of Topic to str, optional
        Full names of the topics in the graph; of those without a name here, the one without a namespace.
    running : Running, optional
        How the plant runs; default: in lockstep.

    Raises
    ------
    BagError
        If the directory exists or cannot be written, now or later.
    """

    def __init__(
        self, path: Path, scene: scenes.Scene, versions: dict[str, str], names: Mapping[Topic, str] | None = None,
        running: Running | None = None,
    ) -> None:
        self._path = path
        try:
            self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
            self._writer.open()
        except (WriterError, OSError) as error:
            raise BagError(f"{path}: cannot be written: {error}") from None
        scene_yaml = scene.to_yaml()
        self._writer.set_custom_data("scene", scene_yaml)
        for name, version in sorted(versions.items()):
            self._writer.set_custom_data(f"version {name}", version)
        run_yaml, names = (running or Running()).to_yaml(), names or {}
        self._writer.set_custom_data("run", run_yaml)
        self._connections: dict[str, Connection] = {}
        for topic in _topics(scene):
            name = names.get(topic, topic.name if topic.name.startswith("/") else f"/{topic.name}")
            self._writer.set_custom_data(f"topic {topic.name}", name)
            self._connections[topic.name] = self._writer.add_connection(
                name, topic.type, typestore=_TYPES, offered_qos_profiles=[_qos(topic)]
            )
        for topic, text in ((RUN, run_yaml), (SCENE, scene_yaml)):
            string = _TYPES.types[SCENE.type](data=text)
            self.write(topic, 0, bytes(_TYPES.serialize_cdr(string, SCENE.type)))

    def write(self, topic: Topic, time_ns: int, cdr: bytes) -> None:
        """Append one serialized message with its simulated time."""
        with writing(self._path, BagError):
            self._writer.write(self._connections[topic.name], time_ns, cdr)

    def write_tick(
        self, time_ns: int, messages: Iterable[tuple[Topic, bytes]], lyapunov: Sequence[float],
        stamp_ns: int | None = None,
    ) -> None:
        """Append all of one tick, and its /clock.

        Parameters
        ----------
        time_ns : int, ns
            Time in the bag, which goes on where a reset puts simulated time back.
        messages : iterable of Topic and bytes
            Serialized messages.
        lyapunov : sequence of float
            The monitor's own values, see `topics.LYAPUNOV_NAMES`.
        stamp_ns : int, ns, optional
            Simulated time, where it is another one.
        """
        stamp_ns = time_ns if stamp_ns is None else stamp_ns
        seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
        clock = _TYPES.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        message = _TYPES.types[CLOCK.type](clock=clock)
        self.write(CLOCK, time_ns, bytes(_TYPES.serialize_cdr(message, CLOCK.type)))
        for topic, cdr in messages:
            self.write(topic, time_ns, cdr)
        self._write_lyapunov(time_ns, stamp_ns, lyapunov)

    def _write_lyapunov(self, time_ns: int, stamp_ns: int, values: Sequence[float]) -> None:
        """Append the monitor's own values; serialized here, because rclpy pads this type with stray bytes."""
        types = _TYPES.types
        seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
        stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        nothing = np.zeros(0)
        message = types[LYAPUNOV.type](
            header=header, name=LYAPUNOV_NAMES, position=np.array(values), velocity=nothing, effort=nothing
        )
        self.write(LYAPUNOV, time_ns, bytes(_TYPES.serialize_cdr(message, LYAPUNOV.type)))

    def close(self) -> None:
        """Finish the bag; only now it has its metadata."""
        with writing(self._path, BagError):
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
        Messages by topic, of those that have one per tick.
    tick : int array (n,)
        Ticks whose state is in the bag.
    state : array (n, 6), m and m/s
        NaN for a body that is not there.
    effort, command : arrays (n, 2), N
        Forces of the controllers that acted until the tick, commands answered to it, which act later if there is a
        delay; 0 without a controller, NaN where missing.
    outputs : dict of str to array (n,), N
        Impact and external forces by topic; NaN where missing.
    lyapunov : array (n, 9)
        What the monitor computed, see `topics.LYAPUNOV_NAMES`; NaN where missing.
    changes : dict of int to dict of str to float
        Numbers that were set while the graph ran, by the tick from which they act.
    running : Running
        How the plant ran: in lockstep or with the wall clock, and with which accuracy.
    starts : int array (k,)
        Ticks of the bag at which the plant began the scene, again after each reset; the first is 0 in a bag that has
        the beginning. `tick` and `t` go on where a reset puts simulated time back.
    """

    path: Path
    scene: scenes.Scene
    versions: dict[str, str]
    counts: dict[str, int]
    tick: np.ndarray
    state: Array
    effort: Array
    command: Array
    outputs: dict[str, Array]
    lyapunov: Array
    changes: dict[int, dict[str, float]]
    running: Running
    starts: np.ndarray

    @property
    def t(self) -> Array:
        """Times in s."""
        return np.array([self.scene.time_of(tick) for tick in self.tick.tolist()])

    @property
    def inputs(self) -> Array:
        """What acted on the bodies from each tick to the next: forces (n, 3) in N by body, LEFT, RIGHT, OBJECT.

        The commands that had arrived, which the next tick names as its effort, and the external forces. NaN where the
        bag does not hold the next tick: at its end, and before a gap. `simulation.Trajectory.inputs` is the same.
        """
        inputs = np.zeros((len(self.tick), 3))
        inputs[:-1, [LEFT, RIGHT]] = self.effort[1:]
        external = {body: EXTERNAL_FORCES[name].name for name, body in SECTIONS.items()}
        if any(topic in self.outputs for topic in external.values()):
            nothing = np.zeros(len(self.tick))
            inputs += np.stack([self.outputs.get(external[body], nothing) for body in (LEFT, RIGHT, OBJECT)], axis=1)
        inputs[np.append(np.diff(self.tick) != 1, True)] = np.nan
        return inputs

    @property
    def closed(self) -> bool:
        """Whether V belongs to laws that were known and ran, at every tick."""
        return bool((self.lyapunov[:, LYAPUNOV_NAMES.index("closed")] == 1.0).all())

    @property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode at the ticks, from the states and the numbers that were in force.

        Of the plant alone, without its controllers, unless `closed`.
        """
        if not self.closed:
            return energy(self.scene.system.alone, self.state)
        scene, begins = self.scene, [0, *sorted(self.changes), int(self.tick[-1]) + 1]
        parts = []
        for begin, end in pairwise(begins):
            scene = scene.changed(self.changes.get(begin, {}))
            parts.append(energy(scene.system, self.state[(self.tick >= begin) & (self.tick < end)]))
        return Energy(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    @property
    def alarms(self) -> int:
        """Ticks at which the monitor found energy that the held forces do not explain."""
        return int(np.count_nonzero(self.lyapunov[:, LYAPUNOV_NAMES.index("alarm")] > 0.0))

    @property
    def missing(self) -> dict[str, int]:
        """Ticks up to the last one recorded that have no message, by topic; without the commands of a free run."""
        ticks = int(self.tick.max(initial=-1)) + 1
        held = () if self.running.lockstep else [topic.name for topic in self.scene.controllers.values()]
        return {name: ticks - count for name, count in self.counts.items() if name not in held}


def read(path: Path) -> Recording:
    """Read a bag that the monitor recorded, with the rosbags reader.

    Raises
    ------
    BagError
        If the path is not such a bag.
    """
    with decoding(path, "a bag of this package", BagError, (ReaderError, SerdeError, yaml.YAMLError)):
        metadata = yaml.safe_load((path / "metadata.yaml").read_text(encoding="utf-8"))
        custom = metadata["rosbag2_bagfile_information"]["custom_data"]
        scene = scenes.parse(custom["scene"], path.name, str(path))
        running = runnings.parse(custom["run"])
        names = {key.removeprefix("topic "): word for key, word in custom.items() if key.startswith("topic ")}
        with Reader(path) as reader:
            columns = {topic: _column(reader, names[topic.name], topic, scene) for topic in scene.topics}
            changes = _changes(reader, names, scene)
    ticks, joints = columns[JOINT_STATES]
    joints, stamps = joints[:, :8], joints[:, 8]
    if not len(ticks):
        raise BagError(f"{path}: holds no tick")

    def aligned(topic: Topic) -> Array:
        found, values = columns[topic]
        result = np.full((len(ticks), values.shape[1]), np.nan)
        _, here, there = np.intersect1d(ticks, found, return_indices=True)
        result[here] = values[there]
        return result

    command = np.zeros((len(ticks), 2))
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        command[:, side] = aligned(topic)[:, 0]
    return Recording(
        path, scene, {k.removeprefix("version "): v for k, v in custom.items() if k.startswith("version ")},
        {topic.name: len(found) for topic, (found, _) in columns.items()}, ticks, joints[:, :6], joints[:, 6:], command,
        {output.topic.name: aligned(output.topic)[:, 0] for output in scene.outputs}, aligned(LYAPUNOV), changes,
        running, ticks[stamps == 0.0],
    )


def names(path: Path) -> dict[str, Topic]:
    """Topics of a bag by their full names in the graph that it was recorded from.

    Raises
    ------
    BagError
        If the path is not such a bag.
    """
    with decoding(path, "a bag of this package", BagError, (ReaderError, SerdeError, yaml.YAMLError)):
        metadata = yaml.safe_load((path / "metadata.yaml").read_text(encoding="utf-8"))
        custom = metadata["rosbag2_bagfile_information"]["custom_data"]
        scene = scenes.parse(custom["scene"], path.name, str(path))
        return {custom[f"topic {topic.name}"]: topic for topic in _topics(scene)}


def raw(path: Path) -> Iterator[tuple[str, int, bytes]]:
    """Full name of the topic, time in ns and serialized message of everything in a bag, in the order of time.

    Raises
    ------
    BagError
        If the path is not such a bag.
    """
    with decoding(path, "a bag of this package", BagError, (ReaderError, SerdeError)), Reader(path) as reader:
        for connection, time_ns, cdr in reader.messages():
            yield connection.topic, time_ns, bytes(cdr)


def _topics(scene: scenes.Scene) -> list[Topic]:
    """What a bag of a scene holds."""
    return list(dict.fromkeys((RUN, SCENE, CLOCK, *scene.topics, *CHANGES.values(), TIMING, DIAGNOSTICS)))


def _messages(reader: Reader, name: str, topic: Topic, scene: scenes.Scene) -> Iterator[tuple[int, Any]]:
    """Tick and message of everything on a topic."""
    connections = [connection for connection in reader.connections if connection.topic == name]
    for _, time_ns, raw in reader.messages(connections) if connections else ():
        yield time_ns // scene.period_ns, _TYPES.deserialize_cdr(raw, topic.type)


def _column(reader: Reader, name: str, topic: Topic, scene: scenes.Scene) -> tuple[np.ndarray, Array]:
    found = [(tick, _values(topic, message)) for tick, message in _messages(reader, name, topic, scene)]
    rows = np.array([row for _, row in found], dtype=float).reshape(len(found), -1)
    return np.array([tick for tick, _ in found], dtype=np.int64), rows


def _values(topic: Topic, message: Any) -> Array:
    if topic == JOINT_STATES:
        state, inputs = state_of(message)
        stamp = message.header.stamp
        return np.concatenate([state, inputs[[LEFT, RIGHT]], [stamp.sec * NANOSECONDS + stamp.nanosec]])
    return np.asarray(message.position if topic == LYAPUNOV else [message.wrench.force.x])


def _changes(reader: Reader, names: Mapping[str, str], scene: scenes.Scene) -> dict[int, dict[str, float]]:
    """Numbers that differ from those in force before, by the tick from which they act."""
    changes: dict[int, dict[str, float]] = {}
    for topic in CHANGES.values():
        now = {name: scene.values[name.split(".")[0]][name.split(".")[1]] for name in scene.live}
        for tick, message in _messages(reader, names[topic.name], topic, scene):
            numbers = dict(zip(message.name, message.position.tolist(), strict=True))
            if new := {name: number for name, number in numbers.items() if now[name] != number}:
                changes.setdefault(tick, {}).update(new)
                now.update(new)
    return dict(sorted(changes.items()))

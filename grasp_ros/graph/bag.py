"""Reading bags: rosbag2 directories with MCAP storage, stamped in simulated time.

`recorder` writes them, `storage` knows their records, `recover` makes a new bag of one that is damaged.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.serde import SerdeError

from grasp_ros import scene as scenes
from grasp_ros.graph import running as runnings
from grasp_ros.graph.recorder import BESIDE, LOST_RECORD, OWN_RECORD, Recorder, checksum
from grasp_ros.graph.recording import Recording
from grasp_ros.graph.rosbag2 import BagError, decode, names_of
from grasp_ros.graph.running import Running
from grasp_ros.graph.storage import Storage, Stored
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import decoding, read_text
from grasp_ros.scene.topics import CHANGES, JOINT_STATES, LYAPUNOV, LYAPUNOV_NAMES, Topic, state_of

__all__ = ["BagError", "Recorder", "Recording", "names", "open_storage", "raw", "read", "scene_of"]
KIND = "a bag of this package"
VERSION = "version "  # how the keys of versions begin
WIDTH = {JOINT_STATES: 9, LYAPUNOV: len(LYAPUNOV_NAMES)}  # numbers of a message; 1 of a force


def open_storage(path: Path, salvage: bool = False) -> Storage:
    """The storage file of a bag, or of a directory that holds one.

    Raises
    ------
    BagError
        If there is none, or more than one.
    """
    with decoding(path, KIND, BagError):
        files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
        if len(files) != 1:
            raise BagError(f"{path}: not {KIND}: holds {len(files)} .mcap files; allowed: one")
        return Storage(files[0], salvage)


def scene_of(storage: Storage, path: Path) -> scenes.Scene:
    """The scene of a bag, once its first record has been read.

    Raises
    ------
    BagError
        If the bag has none.
    """
    if OWN_RECORD not in storage.records:
        raise BagError(f"{path}: not {KIND}: its scene is missing")
    return scenes.parse(storage.records[OWN_RECORD]["scene"], path.name, str(path))


def running_of(storage: Storage) -> Running:
    """How the plant of a bag ran, once its first record has been read."""
    return runnings.parse(storage.records[OWN_RECORD]["run"])


def names(path: Path) -> dict[str, Topic]:
    """Topics of a bag by their full names in the graph that it was recorded from.

    Raises
    ------
    BagError
        If the path is not such a bag.
    """
    storage = open_storage(path)
    with decoding(path, KIND, BagError, (SerdeError,)):
        next(storage.messages())
        scene = scene_of(storage, path)
        return {name: topic for topic, name in names_of(scene, storage.records[OWN_RECORD]).items()}


def raw(path: Path) -> Iterator[Stored]:
    """Everything in a bag, in the order of time, as it lies in the file.

    Raises
    ------
    BagError
        If the path is not such a bag, or if it is damaged.
    """
    with decoding(path, KIND, BagError):
        yield from open_storage(path).messages()


def read(path: Path) -> Recording:
    """Read a bag that the monitor recorded, also one that was not closed.

    Raises
    ------
    BagError
        If the path is not such a bag, or if it is damaged.
    """
    storage = open_storage(path)
    with decoding(path, KIND, BagError, (SerdeError, AttributeError)):
        columns, changes, scene = _Columns(), _Changes(), None
        for stored in storage.messages():
            if scene is None:
                scene = scene_of(storage, path)
                known = {name: topic for topic, name in names_of(scene, storage.records[OWN_RECORD]).items()}
                held = () if running_of(storage).lockstep else scene.controllers.values()
            topic = known.get(stored.topic)
            if topic is None or topic.type != stored.type:
                raise BagError(f"{path}: {stored.topic}: {stored.type} is not a topic of its scene")
            if topic in CHANGES.values():
                changes.add(topic, stored, scene)
            elif topic in held:  # as they came, not one for each tick
                columns.held[topic] = columns.held.get(topic, 0) + 1
            elif topic in scene.topics:
                columns.add(topic, stored, scene)
        if scene is None or not columns.ticks.get(JOINT_STATES):
            raise BagError(f"{path}: holds no tick")
        _check_metadata(path, storage)
        return _recording(path, scene, columns, changes, storage)


def _check_metadata(path: Path, storage: Storage) -> None:
    """Refuse a metadata.yaml that is not the one that was written when the bag was closed."""
    file = path / "metadata.yaml"
    there = storage.closed and path.is_dir() and file.exists()
    if there and checksum(read_text(file, BagError)) != storage.records[LOST_RECORD][BESIDE]:
        raise BagError(f"{file}: was changed; `grasp recover` makes a new bag with metadata of its own")


class _Columns:
    """Ticks and numbers by topic, as they come."""

    def __init__(self) -> None:
        self.ticks: dict[Topic, array[int]] = {}
        self.values: dict[Topic, array[float]] = {}
        self.held: dict[Topic, int] = {}  # numbers of messages

    def add(self, topic: Topic, stored: Stored, scene: scenes.Scene) -> None:
        tick, rest = divmod(stored.time_ns, scene.period_ns)
        ticks = self.ticks.setdefault(topic, array("q"))
        row = _values(topic, decode(topic, stored.cdr))
        if row.shape != (WIDTH.get(topic, 1),):
            raise BagError(f"{stored.topic}: {row.size} numbers; allowed: {WIDTH.get(topic, 1)}")
        beyond = topic == JOINT_STATES and row[-1] > scene.ticks * scene.period_ns
        if rest or beyond or (ticks and ticks[-1] >= tick):
            raise BagError(f"{stored.topic}: {stored.time_ns} ns; allowed: ticks of the scene in their order")
        ticks.append(tick)
        self.values.setdefault(topic, array("d")).extend(row.tolist())

    def count(self, topic: Topic) -> int:
        """Messages of a topic."""
        return self.held.get(topic, len(self.ticks.get(topic, ())))

    def of(self, topic: Topic) -> tuple[np.ndarray, Array]:
        """Ticks (n,) and rows (n, k) of a topic."""
        width = WIDTH.get(topic, 1)
        found = np.array(self.ticks.get(topic, ()), dtype=np.int64)
        return found, np.array(self.values.get(topic, ()), dtype=float).reshape(-1, width)


class _Changes(dict[int, dict[str, float]]):
    """Numbers that differ from those in force before, by the tick of the bag from which they act."""

    def __init__(self) -> None:
        self._now: dict[str, float] = {}

    def add(self, topic: Topic, stored: Stored, scene: scenes.Scene) -> None:
        message, tick = decode(topic, stored.cdr), stored.time_ns // scene.period_ns
        numbers = dict(zip(message.name, message.position.tolist(), strict=True))
        known = {name: number for node in scene.controllers for name, number in scene.numbers_of(node).items()}
        if not numbers.keys() <= known.keys():
            raise BagError(f"{stored.topic}: {numbers} at tick {tick}; allowed: {', '.join(known)}")
        now = {**known, **self._now}
        if new := {name: number for name, number in numbers.items() if now[name] != number}:
            self.setdefault(tick, {}).update(new)
            self._now.update(new)


def _values(topic: Topic, message: Any) -> Array:
    if topic == JOINT_STATES:
        state, inputs = state_of(message)
        stamp = message.header.stamp
        return np.concatenate([state, inputs[[LEFT, RIGHT]], [stamp.sec * NANOSECONDS + stamp.nanosec]])
    return np.asarray(message.position if topic == LYAPUNOV else [message.wrench.force.x])


def _recording(path: Path, scene: scenes.Scene, columns: _Columns, changes: _Changes, storage: Storage) -> Recording:
    ticks, joints = columns.of(JOINT_STATES)
    joints, stamps = joints[:, :8], joints[:, 8]

    def aligned(topic: Topic) -> Array:
        found, values = columns.of(topic)
        result = np.full((len(ticks), values.shape[1]), np.nan)
        _, here, there = np.intersect1d(ticks, found, return_indices=True)
        result[here] = values[there]
        return result

    command = np.zeros((len(ticks), 2))
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        command[:, side] = aligned(topic)[:, 0]
    own = storage.records[OWN_RECORD]
    return Recording(
        path, scene, {key.removeprefix(VERSION): word for key, word in own.items() if key.startswith(VERSION)},
        {topic.name: columns.count(topic) for topic in scene.topics}, ticks, joints[:, :6], joints[:, 6:], command,
        {output.topic.name: aligned(output.topic)[:, 0] for output in scene.outputs}, aligned(LYAPUNOV),
        dict(changes), running_of(storage), ticks[stamps == 0.0], _lost(storage),
    )


def _lost(storage: Storage) -> dict[str, str]:
    """What the bag says about its end; in place of a word that it does not have, what its reader has seen."""
    if storage.closed:
        return {key: word for key, word in storage.records[LOST_RECORD].items() if key != BESIDE}
    left_out = sum(size for _, size, _ in storage.left_out)
    return {"end": f"not closed; {left_out} bytes behind the last whole chunk are left out"}

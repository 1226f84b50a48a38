"""Reading bags: rosbag2 directories with MCAP storage, stamped in simulated time.

`recorder` writes them, `storage` knows their records, `recover` makes a new bag of one that is damaged.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.serde import SerdeError

from grasp_ros import scene as scenes
from grasp_ros.graph.recorder import BESIDE, LOST_RECORD, OWN_RECORD, Recorder, checksum
from grasp_ros.graph.rosbag2 import BagError, decode, topics_of
from grasp_ros.graph.storage import Storage, Stored
from grasp_ros.physics.energy import PLANT_AND_FEEDBACK, Energy, energy
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.effects.force import SECTIONS
from grasp_ros.scene.files import decoding, read_text
from grasp_ros.scene.topics import (
    CHANGES,
    EXTERNAL_FORCES,
    JOINT_STATES,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    SCENE,
    Topic,
    state_of,
)

__all__ = ["BagError", "Recorder", "Recording", "open_storage", "read", "scene_of"]
KIND = "a bag of this package"
VERSION = "version "  # how the keys of versions begin
WIDTH = {JOINT_STATES: 8, LYAPUNOV: len(LYAPUNOV_NAMES)}  # numbers of a message; 1 of a force


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
    lyapunov : array (n, 6)
        What the monitor computed, see `topics.LYAPUNOV_NAMES`; NaN where missing.
    changes : dict of int to dict of str to float
        Numbers that were set while the graph ran, by the tick from which they act.
    lost : dict of str to str
        How the recording ended and what is missing from it, as the bag itself says; if it was not closed, what the
        reader has found.
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
    lost: dict[str, str] = field(default_factory=dict)

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
    def energy_of(self) -> str:
        """What `energy` is the energy of: the controllers of a graph are those of its scene."""
        return PLANT_AND_FEEDBACK

    @property
    def energy(self) -> Energy:
        """V, V_c, V' and the contact mode at the ticks, from the states and the numbers that were in force."""
        scene, starts = self.scene, [0, *sorted(self.changes), int(self.tick[-1]) + 1]
        parts = []
        for begin, end in pairwise(starts):
            scene = scene.changed(self.changes.get(begin, {}))
            parts.append(energy(scene.system, self.state[(self.tick >= begin) & (self.tick < end)]))
        return Energy(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    @property
    def alarms(self) -> int:
        """Ticks at which the monitor found energy that the held forces do not explain."""
        return int(np.count_nonzero(self.lyapunov[:, LYAPUNOV_NAMES.index("alarm")] > 0.0))

    @property
    def missing(self) -> dict[str, int]:
        """Ticks up to the last one recorded that have no message, by topic."""
        ticks = int(self.tick.max(initial=-1)) + 1
        return {name: ticks - count for name, count in self.counts.items()}


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
                known = {f"/{topic.name}": topic for topic in topics_of(scene)}
            topic = known.get(stored.topic)
            if topic is None or topic.type != stored.type:
                raise BagError(f"{path}: {stored.topic}: {stored.type} is not a topic of its scene")
            if topic in CHANGES.values():
                changes.add(topic, stored, scene)
            elif topic != SCENE:
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

    def add(self, topic: Topic, stored: Stored, scene: scenes.Scene) -> None:
        tick, rest = divmod(stored.time_ns, scene.period_ns)
        ticks = self.ticks.setdefault(topic, array("q"))
        if rest or tick > scene.ticks or (ticks and ticks[-1] >= tick):
            raise BagError(f"{stored.topic}: {stored.time_ns} ns; allowed: ticks of the scene in their order")
        row = _values(topic, decode(topic, stored.cdr))
        if row.shape != (WIDTH.get(topic, 1),):
            raise BagError(f"{stored.topic}: {row.size} numbers; allowed: {WIDTH.get(topic, 1)}")
        ticks.append(tick)
        self.values.setdefault(topic, array("d")).extend(row.tolist())

    def of(self, topic: Topic) -> tuple[np.ndarray, Array]:
        """Ticks (n,) and rows (n, k) of a topic."""
        width = WIDTH.get(topic, 1)
        found = np.array(self.ticks.get(topic, ()), dtype=np.int64)
        return found, np.array(self.values.get(topic, ()), dtype=float).reshape(-1, width)


class _Changes(dict[int, dict[str, float]]):
    """Numbers that were set, by the tick from which they act."""

    def add(self, topic: Topic, stored: Stored, scene: scenes.Scene) -> None:
        message = decode(topic, stored.cdr)
        stamp = message.header.stamp  # a monitor that came late has recorded it late
        tick = (stamp.sec * NANOSECONDS + stamp.nanosec) // scene.period_ns
        numbers = dict(zip(message.name, message.position.tolist(), strict=True))
        if not 0 <= tick <= scene.ticks or not numbers.keys() <= set(scene.live):
            raise BagError(f"{stored.topic}: {numbers} at tick {tick}; allowed: {', '.join(scene.live)}")
        self.setdefault(tick, {}).update(numbers)


def _values(topic: Topic, message: Any) -> Array:
    if topic == JOINT_STATES:
        state, inputs = state_of(message)
        return np.concatenate([state, inputs[[LEFT, RIGHT]]])
    return np.asarray(message.position if topic == LYAPUNOV else [message.wrench.force.x])


def _recording(path: Path, scene: scenes.Scene, columns: _Columns, changes: _Changes, storage: Storage) -> Recording:
    ticks, joints = columns.of(JOINT_STATES)

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
        {topic.name: len(columns.ticks.get(topic, ())) for topic in scene.topics}, ticks, joints[:, :6], joints[:, 6:],
        command, {output.topic.name: aligned(output.topic)[:, 0] for output in scene.outputs}, aligned(LYAPUNOV),
        dict(changes), _lost(storage),
    )


def _lost(storage: Storage) -> dict[str, str]:
    """What the bag says about its end; in place of a word that it does not have, what its reader has seen."""
    if storage.closed:
        return {key: word for key, word in storage.records[LOST_RECORD].items() if key != BESIDE}
    left_out = sum(size for _, size, _ in storage.left_out)
    return {"end": f"not closed; {left_out} bytes behind the last whole chunk are left out"}

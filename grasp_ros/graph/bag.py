"""Reading bags: rosbag2 directories with MCAP storage, stamped in simulated time.

`recorder` writes them, `storage` knows their records, `recover` makes a new bag of one that is damaged.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.graph.columns import Alike, alike
from grasp_ros.graph.opening import Opened, decoding_bag
from grasp_ros.graph.recorder import BESIDE, LOST_RECORD, Recorder, checksum
from grasp_ros.graph.recording import Recording, acted_from
from grasp_ros.graph.rosbag2 import BagError, decode
from grasp_ros.graph.storage import Storage, Stored
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import read_text
from grasp_ros.scene.topics import (
    CHANGES,
    JOINT_STATES,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    TIMING,
    Numbers,
    Topic,
    state_of,
)

__all__ = ["BagError", "Recorder", "Recording", "read"]
BATCH_BYTES = 2**18  # of the messages of a topic that are decoded at once
MOST_NS = 2**63 - 1
WIDTH = {JOINT_STATES: 9, LYAPUNOV: len(LYAPUNOV_NAMES)}  # numbers of a message; 1 of a force


def read(path: str | os.PathLike[str]) -> Recording:
    """Read a bag that the monitor recorded, also one that was not closed.

    Raises
    ------
    BagError
        If the path is not such a bag, or if it is damaged.
    """
    opened = Opened(path)
    with decoding_bag(opened.path):
        content = _Content(opened)
        for stored in opened.messages:
            content.take(stored)
        if not len(content.columns[JOINT_STATES].of()[0]):
            raise BagError(f"{opened.path}: holds no tick")
        _check_metadata(opened.path, opened.storage)
        return content.recording()


def _check_metadata(path: Path, storage: Storage) -> None:
    """Refuse a metadata.yaml that is not the one that was written when the bag was closed."""
    file = path / "metadata.yaml"
    there = storage.closed and LOST_RECORD in storage.records and path.is_dir() and file.exists()
    if there and checksum(read_text(file, BagError)) != storage.records[LOST_RECORD][BESIDE]:
        raise BagError(f"{file}: was changed; `grasp recover` makes a new bag with metadata of its own")


class _Content:
    """What of a bag comes into its recording."""

    def __init__(self, opened: Opened) -> None:
        self._bag, self._changes, self._timing = opened, _Changes(), list[Any]()
        self.columns = {topic: _Columns(name, topic, opened.scene) for topic, name in opened.names.items()}
        self._counts = dict.fromkeys(opened.names, 0)
        self._takers = {(name, topic.type): (topic, self._taker(topic)) for topic, name in opened.names.items()}

    def _taker(self, topic: Topic) -> Callable[[Stored], object]:
        """What is done with the messages of a topic."""
        scene = self._bag.scene
        if topic in CHANGES.values():
            return lambda stored: self._changes.add(topic, stored, scene)
        if topic == TIMING:
            return lambda stored: self._timing.append(decode(topic, stored.cdr))
        one_a_tick = topic in scene.topics and topic not in self._bag.held  # the others as they came
        return self.columns[topic].add if one_a_tick else lambda _: None

    def take(self, stored: Stored) -> None:
        """Take a message."""
        known = self._takers.get((stored.topic, stored.type))
        if known is None:
            raise BagError(f"{self._bag.path}: {stored.topic}: {stored.type} is not a topic of its scene")
        topic, taker = known
        self._counts[topic] += 1
        taker(stored)

    def recording(self) -> Recording:
        """All of it, as arrays."""
        scene = self._bag.scene
        ticks, joints = self.columns[JOINT_STATES].of()
        joints, stamps = joints[:, :8], joints[:, 8]

        def aligned(topic: Topic) -> Array:
            found, values = self.columns[topic].of()
            result = np.full((len(ticks), values.shape[1]), np.nan)
            _, here, there = np.intersect1d(ticks, found, return_indices=True)
            result[here] = values[there]
            return result

        command, held = np.zeros((len(ticks), 2)), self._bag.held
        for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
            command[:, side] = acted_from(ticks, joints[:, 6 + side]) if topic in held else aligned(topic)[:, 0]
        return Recording(
            self._bag.path, scene, self._bag.versions,
            {topic.name: count for topic, count in self._counts.items()}, ticks, joints[:, :6], joints[:, 6:], command,
            {output.topic.name: aligned(output.topic)[:, 0] for output in scene.outputs}, aligned(LYAPUNOV),
            dict(self._changes), self._bag.running, ticks[stamps == 0.0], _lost(self._bag.storage),
            _table(self._timing), dict(+self._changes.unheard),
        )


class _Columns:
    """Ticks and numbers of one topic: taken as they come, and decoded many at a time."""

    def __init__(self, name: str, topic: Topic, scene: scenes.Scene) -> None:
        self._name, self._topic, self._width = name, topic, WIDTH.get(topic, 1)
        self._period_ns, self._end_ns = scene.period_ns, scene.ticks * scene.period_ns
        self._times: list[int] = []
        self._cdrs: list[bytes] = []
        self._bytes = 0
        self._ticks, self._rows = [np.array([-1])], [np.zeros((1, self._width))]  # before the first

    def add(self, stored: Stored) -> None:
        """Take a message."""
        self._times.append(stored.time_ns)
        self._cdrs.append(stored.cdr)
        self._bytes += len(stored.cdr)
        if self._bytes > BATCH_BYTES:
            self._decode()

    def of(self) -> tuple[np.ndarray, Array]:
        """Ticks (n,) and rows (n, k)."""
        if self._cdrs:
            self._decode()
        ticks, rows = np.concatenate(self._ticks), np.concatenate(self._rows)
        self._ticks, self._rows = [ticks], [rows]
        return ticks[1:], rows[1:]

    def _decode(self) -> None:
        rows = np.empty((len(self._cdrs), self._width))
        for group in alike(self._topic, self._cdrs):
            found = _values(self._topic, group)
            if found.shape[1] != self._width:
                raise BagError(f"{self._name}: {found.shape[1]} numbers; allowed: {self._width}")
            rows[group.places] = found
        ticks = self._checked(rows)
        self._ticks.append(ticks)
        self._rows.append(rows)
        self._times, self._cdrs, self._bytes = [], [], 0

    def _checked(self, rows: Array) -> np.ndarray:
        """Ticks of the rows."""
        times, period = np.array(self._times, dtype=np.uint64), np.uint64(self._period_ns)
        ticks = (times // period).astype(np.int64)
        wrong = (times % period != 0) | (times > MOST_NS) | (np.diff(ticks, prepend=self._ticks[-1][-1]) <= 0)
        if self._topic == JOINT_STATES:
            wrong |= rows[:, -1] > self._end_ns
        if wrong.any():
            time_ns = self._times[int(np.argmax(wrong))]
            raise BagError(f"{self._name}: {time_ns} ns; allowed: ticks of the scene in their order")
        return ticks


class _Changes(dict[int, dict[str, float]]):
    """Numbers that differ from those in force before, by the tick of the bag from which they act."""

    def __init__(self) -> None:
        self._now: dict[str, float] = {}
        self._numbers = {topic: Numbers() for topic in CHANGES.values()}
        self.unheard: Counter[str] = Counter()

    def add(self, topic: Topic, stored: Stored, scene: scenes.Scene) -> None:
        message, tick = decode(topic, stored.cdr), stored.time_ns // scene.period_ns
        numbers = dict(zip(message.name, message.position.tolist(), strict=True))
        self.unheard[topic.name] += self._numbers[topic].take(message)
        known = {name: number for node in scene.controllers for name, number in scene.numbers_of(node).items()}
        if not numbers.keys() <= known.keys():
            raise BagError(f"{stored.topic}: {numbers} at tick {tick}; allowed: {', '.join(known)}")
        now = {**known, **self._now}
        if new := {name: number for name, number in numbers.items() if now[name] != number}:
            self.setdefault(tick, {}).update(new)
            self._now.update(new)


def _table(messages: Sequence[Any]) -> dict[str, Array]:
    """Lists of numbers with names as columns; those that have not the names of the last one are left out."""
    if not messages:
        return {}
    names = messages[-1].name
    columns = np.array([message.position for message in messages if message.name == names]).T
    return dict(zip(names, columns, strict=True))


def _values(topic: Topic, group: Alike) -> Array:
    """Numbers (n, k) of messages that a recording has."""
    numbers = group.numbers
    if topic == JOINT_STATES:
        lists = {name: numbers[name].T for name in ("position", "velocity", "effort")}
        state, inputs = state_of(SimpleNamespace(name=group.first.name, **lists), numbers.shape)
        stamps = numbers["header.stamp.sec"].astype(np.int64) * NANOSECONDS + numbers["header.stamp.nanosec"]
        return np.vstack([state, inputs[[LEFT, RIGHT]], stamps]).T
    return np.asarray(numbers["position"] if topic == LYAPUNOV else numbers["wrench.force.x"][:, None])


def _lost(storage: Storage) -> dict[str, str]:
    """What the bag says about its end; in place of a word that it does not have, what its reader has seen."""
    if not storage.closed:
        left_out = sum(size for _, size, _ in storage.left_out)
        return {"end": f"not closed; {left_out} bytes behind the last whole chunk are left out"}
    anew = {"end": "written anew by another program, which does not say what was lost"}
    return {key: word for key, word in storage.records.get(LOST_RECORD, anew).items() if key != BESIDE}

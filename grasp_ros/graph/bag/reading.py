"""Reading bags: rosbag2 directories with MCAP storage, stamped in simulated time.

`recorder` writes them, `storage` knows their records, `recover` makes a new bag of one that is damaged.
"""

from __future__ import annotations

import os
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.graph.bag import BagError, EmptyBagError
from grasp_ros.graph.bag.opening import UNREADABLE, Opened, decoding_bag
from grasp_ros.graph.bag.recorder import BESIDE, LOST_RECORD, OWN_RECORD, checksum
from grasp_ros.graph.bag.recording import Recording, acted_from
from grasp_ros.graph.bag.rosbag2 import decode
from grasp_ros.graph.bag.storage import Storage, Stored
from grasp_ros.graph.serialization import template_of
from grasp_ros.physics.layout import OBJECT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import read_text
from grasp_ros.scene.topics import (
    CHANGES,
    CLOCK,
    COMMANDS,
    FORCE,
    JOINT_STATES,
    LYAPUNOV,
    LYAPUNOV_NAMES,
    RUN,
    SCENE,
    TIMING,
    Numbers,
    Topic,
    timing_names,
)

MOST_NS = 2**63 - 1
LARGEST = 1e100  # of a number: its square is one, too
NOT_FINITE, PUSHED = f"a number is not finite, or beyond {LARGEST:g}", "an effort of the object; allowed: 0"
NOT_NEXT = "its stamp is not the next one of the scene"


def read(path: str | os.PathLike[str]) -> Recording:
    """Read a bag that the monitor recorded, also one that was not closed.

    Raises
    ------
    BagError
        If the path is not such a bag, or if it is damaged.
    """
    opened = Opened(path)
    with decoding_bag(opened.path):
        scene, changes, timing = opened.scene, Changes(), list[Sequence[float]]()
        quality = () if opened.running.lockstep else timing_names(NAMES[body] for body in scene.system.laws)
        columns, held = columns_of(opened), {topic: array("d") for topic in opened.held}
        takers: dict[Topic, Callable[[Stored], object]] = {
            **{topic: column.add for topic, column in columns.items()},
            **{topic: partial(changes.add, topic, scene) for topic in CHANGES.values()},
            TIMING: lambda stored: timing.extend(_of_a_plant(quality, stored)),
            **{topic: partial(_check_text, opened, topic) for topic in (SCENE, RUN)},
            **{topic: partial(_take_command, forces, Columns(opened.names[topic], topic, scene))
               for topic, forces in held.items()},
        }
        counts = dict.fromkeys(opened.names, 0)
        for topic, stored in opened.messages:
            counts[topic] += 1
            if topic in takers:
                takers[topic](stored)
        if not columns[JOINT_STATES].times:
            raise EmptyBagError(f"{opened.path}: holds no tick")
        _check_metadata(opened.path, opened.storage)
        table = dict(zip(quality, np.array(timing).T, strict=True)) if timing else {}
        commands = {side: np.array(held[topic]) for side, topic in COMMANDS.items() if topic in held}
        named = {topic.name: count for topic, count in counts.items()}
        return _recording(opened, columns, changes, named, table, commands)


def _take_command(forces: array[float], column: Columns, stored: Stored) -> None:
    """Take a command of a free run, which belongs to no tick."""
    force = column.numbers(stored.cdr)[-1]
    if not abs(force) <= LARGEST:
        raise BagError(f"{stored.topic}: {NOT_FINITE}")
    forces.append(force)


def _check_text(opened: Opened, topic: Topic, stored: Stored) -> None:
    """Refuse another scene, or another run, than that of the bag."""
    if decode(topic, stored.cdr).data != opened.storage.records[OWN_RECORD][topic.name]:
        raise BagError(f"{opened.path}: {stored.topic}: another {topic.name} than in the bag's own record")


def columns_of(opened: Opened) -> dict[Topic, Columns]:
    """An empty table for each topic that has one message for each tick."""
    return {topic: Columns(opened.names[topic], topic, opened.scene) for topic in (CLOCK, *opened.scene.topics)
            if topic not in opened.held}


def follows(step: Any, passed: Any, period_ns: int) -> Any:
    """Whether a stamp is that much later than the one before, after so much time in the bag, in ns.

    Or the plant was reset, perhaps in a gap.
    """
    return (step == passed) | (step <= 0) | (passed > period_ns)


def stamp_of(columns: Mapping[Topic, Columns], tick: Mapping[Topic, bytes]) -> int:
    """Stamp in ns of the messages of one tick.

    Raises
    ------
    BagError, or what `decoding_bag` makes one of
        If they are not such as `read` takes.
    """
    rows = {topic: columns[topic].numbers(cdr) for topic, cdr in tick.items() if topic in columns}
    if not all(abs(number) <= LARGEST for topic, row in rows.items() if topic != LYAPUNOV for number in row):
        raise BagError(NOT_FINITE)
    if columns[JOINT_STATES].efforts_of_object(np.array([rows[JOINT_STATES]])).any():
        raise BagError(PUSHED)
    stamps = {tuple(row[:2]) for row in rows.values()}
    if len(stamps) > 1:
        raise BagError("its messages have different stamps")
    [(seconds, nanoseconds)] = stamps
    return int(seconds) * NANOSECONDS + int(nanoseconds)


def _check_metadata(path: Path, storage: Storage) -> None:
    """Refuse a metadata.yaml that is not the one that was written when the bag was closed."""
    file = path / "metadata.yaml"
    there = storage.closed and LOST_RECORD in storage.records and path.is_dir() and file.exists()
    if there and not file.is_file():
        raise BagError(f"{file}: not a file")
    if there and checksum(read_text(file, BagError)) != storage.records[LOST_RECORD][BESIDE]:
        raise BagError(f"{file}: was changed; `grasp recover` makes a new bag with metadata of its own")


def _recording(
    opened: Opened, columns: Mapping[Topic, Columns], changes: Changes, counts: dict[str, int],
    timing: dict[str, Array], held: dict[str, Array],
) -> Recording:
    """All of it, as arrays."""
    scene, states = opened.scene, columns[JOINT_STATES]
    ticks, rows, stamps = states.of()
    state, effort = np.full((len(ticks), 6), np.nan), np.zeros((len(ticks), 2))
    for body, numbers in zip(scene.system.present, rows.reshape(len(rows), 3, -1).T, strict=True):
        state[:, COLUMN[body]], state[:, COLUMN[body] + 1] = numbers[:2]
        if body != OBJECT:
            effort[:, body] = numbers[2]

    def aligned(topic: Topic) -> Array:
        found, values, stamped = columns[topic].of()
        result = np.full((len(ticks), values.shape[1]), np.nan)
        _, here, there = np.intersect1d(ticks, found, return_indices=True)
        columns[topic].refuse(found[there], stamped[there] != stamps[here], "its stamp is not that of the state")
        result[here] = values[there]
        return result

    aligned(CLOCK)
    command = np.zeros((len(ticks), 2))
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        command[:, side] = aligned(topic)[:, 0] if topic in columns else acted_from(ticks, effort[:, side])
    return Recording(
        opened.path, scene, opened.versions, counts, ticks, state, effort, command,
        {output.topic.name: aligned(output.topic)[:, 0] for output in scene.outputs}, aligned(LYAPUNOV),
        dict(changes), opened.running, ticks[stamps == 0], _lost(opened.storage), timing,
        dict(+changes.unheard), held,
    )


class Columns:
    """Ticks and numbers of one topic, taken as they come.

    A recorder writes messages that differ from each other in time and numbers alone; any other is decoded as a whole.
    """

    def __init__(self, name: str, topic: Topic, scene: scenes.Scene) -> None:
        self._name, self._topic = name, topic
        self._period_ns, self._end_ns = scene.period_ns, scene.ticks * scene.period_ns
        self.names = [NAMES[body] for body in scene.system.present]
        self._template = template_of(topic, self.names)
        self.times, self._rows = array("Q"), array("d")

    def add(self, stored: Stored) -> None:
        """Take a message."""
        self._rows.extend(self.numbers(stored.cdr))
        self.times.append(stored.time_ns)

    def numbers(self, cdr: bytes) -> Sequence[float]:
        """Seconds, nanoseconds and numbers of a message."""
        return self._template.read(cdr) or self._decoded(cdr)

    def _decoded(self, cdr: bytes) -> list[float]:
        """Time and numbers of a message of another make, in the order of those of a recorder."""
        message, names = decode(self._topic, cdr), self.names
        if self._topic == CLOCK:
            return [message.clock.sec, message.clock.nanosec]
        numbers = self._along_x(message.wrench) if self._topic.type == FORCE else message.position
        if self._topic == JOINT_STATES:
            lists = message.position, message.velocity, message.effort
            once = len({*message.name}) == len(message.name)
            if not (once and {*names} <= {*message.name} and all(len(row) == len(message.name) for row in lists)):
                raise BagError(f"{self._name}: {', '.join(message.name)}; allowed: three numbers of {', '.join(names)}")
            numbers = np.array(lists)[:, [message.name.index(name) for name in names]].ravel()
        if len(numbers) != self._template.count:
            raise BagError(f"{self._name}: {len(numbers)} numbers; allowed: {self._template.count}")
        if self._topic == LYAPUNOV:
            if sorted(message.name) != sorted(LYAPUNOV_NAMES):
                raise BagError(f"{self._name}: {', '.join(message.name)}; allowed: {', '.join(LYAPUNOV_NAMES)}")
            numbers = [numbers[message.name.index(name)] for name in LYAPUNOV_NAMES]
        return [message.header.stamp.sec, message.header.stamp.nanosec, *numbers]

    def _along_x(self, wrench: Any) -> list[float]:
        """The force of a wrench: all that is read of a command, whoever sends it; others of ours have no other."""
        force, torque = wrench.force, wrench.torque
        if self._topic not in COMMANDS.values() and any((force.y, force.z, torque.x, torque.y, torque.z)):
            raise BagError(f"{self._name}: a force or torque beside force.x; allowed: 0")
        return [force.x]

    def efforts_of_object(self, rows: Array) -> Array:
        """Efforts (n, 1) of the object in rows (n, 2 + k) of states; (n, 0) without one."""
        return rows[:, -len(self.names) :][:, [name == NAMES[OBJECT] for name in self.names]]

    def refuse(self, ticks: np.ndarray, wrong: Any, why: str) -> None:
        """Refuse the first tick (n,) that is wrong."""
        if wrong.any():
            raise BagError(f"{self._name}: tick {ticks[np.argmax(wrong)]}: {why}")

    def of(self) -> tuple[np.ndarray, Array, np.ndarray]:
        """Ticks (n,), rows (n, k) of numbers, and their stamps (n,) in ns."""
        rows, times = np.array(self._rows).reshape(-1, 2 + self._template.count), np.array(self.times)
        ticks = (times // np.uint64(self._period_ns)).astype(np.int64)
        stamps = rows[:, :2].astype(np.int64) @ (NANOSECONDS, 1)  # numbers beyond 2^53 ns would be rounded
        wrong = (times % np.uint64(self._period_ns) != 0) | (times > MOST_NS) | (np.diff(ticks, prepend=-1) <= 0)
        if wrong.any():
            time_ns = times[int(np.argmax(wrong))]
            raise BagError(f"{self._name}: {time_ns} ns; allowed: ticks of the scene in their order")
        if self._topic == JOINT_STATES:
            step, passed = np.diff(stamps, prepend=0), np.diff(ticks, prepend=0) * self._period_ns
            known = (stamps >= 0) & (stamps <= self._end_ns) & (stamps % self._period_ns == 0)
            self.refuse(ticks, ~(known & follows(step, passed, self._period_ns)), NOT_NEXT)
            self.refuse(ticks, self.efforts_of_object(rows).any(axis=1), PUSHED)
        if self._topic != LYAPUNOV:
            self.refuse(ticks, ~(np.abs(rows) <= LARGEST).all(axis=1), NOT_FINITE)
        return ticks, rows[:, 2:], stamps


class Changes(dict[int, dict[str, float]]):
    """Numbers that differ from those in force before, by the tick of the bag from which they act."""

    def __init__(self) -> None:
        self._now: dict[str, float] = {}
        self._numbers = {topic: Numbers() for topic in CHANGES.values()}
        self.unheard: Counter[str] = Counter()

    def add(self, topic: Topic, scene: scenes.Scene, stored: Stored) -> None:
        """Take an announcement."""
        message, tick = decode(topic, stored.cdr), stored.time_ns // scene.period_ns
        if len(message.name) != len(message.position):
            raise BagError(f"{stored.topic}: tick {tick}: {len(message.name)} names of {len(message.position)} numbers")
        numbers = dict(zip(message.name, message.position.tolist(), strict=True))
        self.unheard[topic.name] += self._numbers[topic].take(message)
        known = {name: number for node in scene.controllers for name, number in scene.numbers_of(node).items()}
        if not numbers.keys() <= known.keys():
            raise BagError(f"{stored.topic}: {numbers} at tick {tick}; allowed: {', '.join(known)}")
        now = {**known, **self._now}
        if new := {name: number for name, number in numbers.items() if now[name] != number}:
            self.setdefault(tick, {}).update(new)
            self._now.update(new)


def _of_a_plant(known: Sequence[str], stored: Stored) -> Iterator[Sequence[float]]:
    """The numbers of a message on `timing`, unless somebody else has sent it: anybody may."""
    with suppress(*UNREADABLE):
        message = decode(TIMING, stored.cdr)
        if [*known] == message.name and len(known) == len(message.position) and np.isfinite(message.position).all():
            yield message.position


def _lost(storage: Storage) -> dict[str, str]:
    """What the bag says about its end; in place of a word that it does not have, what its reader has seen."""
    if not storage.closed:
        left_out = sum(size for _, size, _ in storage.left_out)
        return {"end": f"not closed; {left_out} bytes behind the last whole chunk are left out"}
    anew = {"end": "written anew by another program, which does not say what was lost"}
    return {key: word for key, word in storage.records.get(LOST_RECORD, anew).items() if key != BESIDE}

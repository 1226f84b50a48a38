"""Reading bags: rosbag2 directories with MCAP storage, stamped in simulated time."""

from __future__ import annotations

import math
import os
from array import array
from collections import Counter
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import NoReturn

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.graph.bag import BagError, EmptyBagError
from grasp_ros.graph.bag.opening import UNREADABLE, Opened, decoding_bag
from grasp_ros.graph.bag.recorder import LOST_RECORD, METADATA_DIGEST, OWN_RECORD, checksum
from grasp_ros.graph.bag.recording import Recording, acted_from
from grasp_ros.graph.bag.rosbag2 import decode
from grasp_ros.graph.bag.storage import Storage, Stored
from grasp_ros.graph.serialization import has_raw_stamp, raw_stamp_ns, template_of
from grasp_ros.physics.layout import OBJECT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene import topics
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import read_text
from grasp_ros.scene.topics import Numbers, Topic, timing_names

MOST_NS = 2**63 - 1
LARGEST = 1e100  # of a number: its square is one, too
OUR_TIMES = "allowed: a bag of `grasp run`, or of its monitor, whose times are simulated ones"
IN_ORDER = "allowed: ticks of the scene in their order"
NOT_FINITE = f"a number is not finite, or beyond {LARGEST:g}"


def read(path: str | os.PathLike[str]) -> Recording:
    """Read a bag that the monitor recorded, also one that was not closed.

    Raises
    ------
    BagError
        If the path is not such a bag, or if it is damaged.
    """
    opened = Opened(path)
    with decoding_bag(opened.path):
        return _recording(opened)


def _recording(opened: Opened) -> Recording:
    scene, reader = opened.scene, BagReader(opened)
    counts = Counter(dict.fromkeys(opened.names, 0))
    stamps, rows = array("q"), array("d")
    for time_ns, tick, others in reader.ticks(reader.topics):
        counts.update([*tick, *(topic for topic, _ in others)])
        try:
            for topic, stored in others:
                reader.take(topic, stored)
            row = reader.row(time_ns, tick) if tick else []
        except UNREADABLE as error:
            raise BagError(f"{opened.path}: {error or type(error).__name__}; `grasp recover` leaves it out") from None
        if topics.JOINT_STATES in tick:
            stamps.extend((time_ns, reader.stamp_ns))
            rows.extend(row)
    if not stamps:
        raise EmptyBagError(f"{opened.path}: holds no tick")
    _check_metadata(opened.path, opened.storage)
    times = np.array(stamps).reshape(-1, 2)
    ticks = times[:, 0] // scene.period_ns
    ends = np.cumsum([template.count for template in reader.topics.values()])[:-1]
    parts = dict(zip(reader.topics, np.split(np.array(rows).reshape(len(times), -1), ends, axis=1), strict=True))
    state, effort, command = _motion(scene, ticks, parts)
    if 1.0 in parts[topics.LYAPUNOV][:, topics.LYAPUNOV_NAMES.index("closed")]:  # the monitor had heard of all laws
        laws = (topics.CHANGES[side] for side, topic in topics.COMMANDS.items() if topic in scene.topics)
        reader.unheard.update(topic.name for topic in laws if not counts[topic])
    timing = zip(reader.quality, np.array(reader.timing).T, strict=True) if reader.timing else ()
    return Recording(
        path=opened.path, scene=scene, versions=opened.versions, running=opened.running, tick=ticks, state=state,
        effort=effort, command=command, outputs={own.topic.name: parts[own.topic][:, 0] for own in scene.outputs},
        lyapunov=parts[topics.LYAPUNOV], changes=reader.changes, starts=ticks[times[:, 1] == 0],
        counts={topic.name: count for topic, count in counts.items()}, unheard=dict(+reader.unheard),
        timing=dict(timing), lost=_lost(opened.storage),
        held={side: np.array(reader.held[topic]) for side, topic in topics.COMMANDS.items() if topic in reader.held},
    )


def _motion(scene: scenes.Scene, ticks: np.ndarray, parts: Mapping[Topic, Array]) -> tuple[Array, Array, Array]:
    """State, effort and command of a `Recording` from the numbers (n, ...) of each topic."""
    state, effort, command = np.full((len(ticks), 6), np.nan), *np.zeros((2, len(ticks), 2))
    of_bodies = parts[topics.JOINT_STATES].reshape(len(ticks), 3, -1)
    for body, numbers in zip(scene.system.present, of_bodies.T, strict=True):
        state[:, COLUMN[body]], state[:, COLUMN[body] + 1] = numbers[:2]
        if body != OBJECT:
            effort[:, body] = numbers[2]
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        command[:, side] = parts[topic][:, 0] if topic in parts else acted_from(ticks, effort[:, side])
    return state, effort, command


def _check_metadata(path: Path, storage: Storage) -> None:
    """Refuse a metadata.yaml that is not the one that was written when the bag was closed."""
    file = path / "metadata.yaml"
    there = storage.closed and LOST_RECORD in storage.records and path.is_dir() and file.exists()
    if there and not file.is_file():
        raise BagError(f"{file}: not a file")
    if there and checksum(read_text(file, BagError)) != storage.records[LOST_RECORD][METADATA_DIGEST]:
        raise BagError(f"{file}: was changed; `grasp recover` makes a new bag with metadata of its own")


class BagReader:
    """Reads the messages of a bag, and refuses what no recorder writes.

    A recorder writes messages that differ from each other in time and numbers alone; any other is decoded as a whole.
    """

    def __init__(self, opened: Opened) -> None:
        scene, self._opened, self._full = opened.scene, opened, opened.names
        self._period_ns, self._end_ns = scene.period_ns, scene.ticks * scene.period_ns
        self.names = [NAMES[body] for body in scene.system.present]
        self._templates = {topic: template_of(topic, self.names) for topic in (topics.CLOCK, *scene.topics)}
        # In the order of a row.
        self.topics = {topic: own for topic, own in self._templates.items() if topic not in opened.held}
        self._time_ns, self.stamp_ns = 0, 0  # of the last tick; the first one counts from the begin of the scene
        self._before = -1
        # What `take` has taken: forces, numbers of `timing` by `quality`, and those that differ from the ones in force
        # before, by the tick of the bag from which they act; how many announcements are missing.
        self.held = {topic: array("d") for topic in opened.held}
        self.quality = () if opened.running.lockstep else timing_names(NAMES[body] for body in scene.system.laws)
        self.timing: list[Sequence[float]] = []
        self.changes: dict[int, dict[str, float]] = {}
        self._now = scene.numbers_of(*scene.controllers)
        self._announced = {topic: Numbers() for topic in topics.CHANGES.values()}
        self.unheard: Counter[str] = Counter()

    def ticks(
        self, wanted: Container[Topic]
    ) -> Iterator[tuple[int, dict[Topic, bytes], list[tuple[Topic, Stored]]]]:
        """Time in ns of each tick, its messages on these topics, and all others of that time, in the order of the bag.

        A topic has one message for a tick; of more the last one is salvaged.
        """
        opened = self._opened
        messages = opened.messages if opened.storage.ours else self._with_our_times(wanted)
        for time_ns, group in groupby(messages, key=lambda message: message[1].time_ns):
            tick, others = dict[Topic, bytes](), list[tuple[Topic, Stored]]()
            for topic, stored in group:
                if topic not in wanted:
                    others.append((topic, stored))
                    continue
                if topic in tick:
                    if not opened.salvage:
                        raise BagError(f"{stored.topic}: {time_ns} ns: a second message of this tick; allowed: one")
                    opened.left_out[f"messages on {stored.topic} before another one of their tick"] += 1
                tick[topic] = stored.cdr
            yield time_ns, tick, others

    def _with_our_times(self, wanted: Container[Topic]) -> Iterator[tuple[Topic, Stored]]:
        """Messages of a bag that another program has written; refused if their times are not the stamps.

        Until a reset, from which on the times of our own bags are ahead of the stamps.
        """
        stamp_ns = 0
        for topic, stored in self._opened.messages:
            if topic in wanted and has_raw_stamp(stored.cdr):
                before_ns, stamp_ns = stamp_ns, raw_stamp_ns(stored.cdr)
                if stamp_ns < before_ns:
                    yield topic, stored
                    break
                if stamp_ns != stored.time_ns:
                    raise BagError(f"{self._opened.path}: {stored.topic}: time {stored.time_ns} ns in the bag, stamp"
                                   f" {stamp_ns} ns: another recorder wrote it; {OUR_TIMES}")
            yield topic, stored
        yield from self._opened.messages

    def take(self, topic: Topic, stored: Stored) -> None:
        """Take a message that comes beside the ticks: an announcement, a command of a free run, how that went."""
        if topic in self._announced:
            self._change(topic, stored)
        elif topic == topics.TIMING:
            self.timing.extend(_timing(self.quality, stored))
        elif topic in self.held:
            force = self.numbers(topic, stored.cdr)[-1]
            if not abs(force) <= LARGEST:
                raise BagError(f"{stored.topic}: {NOT_FINITE}")
            self.held[topic].append(force)
        elif topic in (topics.SCENE, topics.RUN) and (
            decode(topic, stored.cdr).data != self._opened.storage.records[OWN_RECORD][topic.name]
        ):
            raise BagError(f"{stored.topic}: another {topic.name} than in the bag's own record")

    def _change(self, topic: Topic, stored: Stored) -> None:
        message, tick = decode(topic, stored.cdr), stored.time_ns // self._period_ns
        if len(message.name) != len(message.position):
            raise BagError(f"{stored.topic}: tick {tick}: {len(message.name)} names of {len(message.position)} numbers")
        numbers = dict(zip(message.name, message.position.tolist(), strict=True))
        self.unheard[topic.name] += self._announced[topic].take(message)
        if not numbers.keys() <= self._now.keys():
            raise BagError(f"{stored.topic}: {numbers} at tick {tick}; allowed: {', '.join(self._now)}")
        if new := {name: number for name, number in numbers.items() if self._now[name] != number}:
            self.changes.setdefault(tick, {}).update(new)
            self._now.update(new)

    def row(self, time_ns: int, tick: Mapping[Topic, bytes]) -> list[float]:
        """Numbers of the messages of a tick, NaN where one is missing.

        Raises
        ------
        BagError, or what `decoding_bag` makes one of
            If they are not those of the next tick.
        """
        if time_ns % self._period_ns or not self._before < time_ns <= MOST_NS:
            raise BagError(f"{self._full[next(iter(tick))]}: {time_ns} ns; {IN_ORDER}")
        found, row = dict[Topic, Sequence[float]](), list[float]()
        for topic, template in self.topics.items():
            if (cdr := tick.get(topic)) is None:
                row += [math.nan] * template.count
                continue
            found[topic] = numbers = self.numbers(topic, cdr)
            row += numbers[2:]
            if topic != topics.LYAPUNOV and not sum(map(abs, numbers)) <= LARGEST:
                self._refuse(topic, time_ns, NOT_FINITE)
        self._before = time_ns
        if states := found.get(topics.JOINT_STATES):
            stamp_ns = int(states[0]) * NANOSECONDS + int(states[1])
            step, passed = stamp_ns - self.stamp_ns, time_ns - self._time_ns
            follows = step == passed or step <= 0 or passed > self._period_ns  # or it was reset, perhaps in a gap
            if stamp_ns % self._period_ns or not 0 <= stamp_ns <= self._end_ns or not follows:
                self._refuse(topics.JOINT_STATES, time_ns, "its stamp is not the next one of the scene")
            efforts = zip(self.names, states[-len(self.names) :], strict=True)
            if any(effort for name, effort in efforts if name == NAMES[OBJECT]):
                self._refuse(topics.JOINT_STATES, time_ns, "an effort of the object; allowed: 0")
            for topic, own in found.items():
                if own[0] != states[0] or own[1] != states[1]:
                    self._refuse(topic, time_ns, "its stamp is not that of the state")
            self._time_ns, self.stamp_ns = time_ns, stamp_ns
        return row

    def _refuse(self, topic: Topic, time_ns: int, why: str) -> NoReturn:
        raise BagError(f"{self._full[topic]}: tick {time_ns // self._period_ns}: {why}")

    def numbers(self, topic: Topic, cdr: bytes) -> Sequence[float]:
        """Seconds, nanoseconds and numbers of a message."""
        return self._templates[topic].read(cdr) or self._decoded(topic, cdr)

    def _decoded(self, topic: Topic, cdr: bytes) -> list[float]:
        """Time and numbers of a message of another program, in the order of those of a recorder."""
        message, names, name = decode(topic, cdr), self.names, self._full[topic]
        if topic == topics.CLOCK:
            return [message.clock.sec, message.clock.nanosec]
        if topic.type == topics.FORCE:  # of a command only its force is read, whoever sends it; others have no more
            force, torque = message.wrench.force, message.wrench.torque
            if topic not in topics.COMMANDS.values() and any((force.y, force.z, torque.x, torque.y, torque.z)):
                raise BagError(f"{name}: a force or torque other than force.x; allowed: 0")
        numbers = [force.x] if topic.type == topics.FORCE else message.position
        if topic == topics.JOINT_STATES:
            lists = message.position, message.velocity, message.effort
            once = len({*message.name}) == len(message.name)
            if not (once and {*names} <= {*message.name} and all(len(row) == len(message.name) for row in lists)):
                raise BagError(f"{name}: {', '.join(message.name)}; allowed: three numbers of {', '.join(names)}")
            numbers = np.array(lists)[:, [message.name.index(name) for name in names]].ravel()
        if len(numbers) != self._templates[topic].count:
            raise BagError(f"{name}: {len(numbers)} numbers; allowed: {self._templates[topic].count}")
        if topic == topics.LYAPUNOV:
            if sorted(message.name) != sorted(topics.LYAPUNOV_NAMES):
                raise BagError(f"{name}: {', '.join(message.name)}; allowed: {', '.join(topics.LYAPUNOV_NAMES)}")
            numbers = [numbers[message.name.index(name)] for name in topics.LYAPUNOV_NAMES]
        return [message.header.stamp.sec, message.header.stamp.nanosec, *numbers]


def _timing(names: Sequence[str], stored: Stored) -> Iterator[Sequence[float]]:
    """The numbers of a message on `timing`; none of one that is not a plant's: any node may publish there."""
    with suppress(*UNREADABLE):
        message = decode(topics.TIMING, stored.cdr)
        if [*names] == message.name and len(names) == len(message.position) and np.isfinite(message.position).all():
            yield message.position


def _lost(storage: Storage) -> dict[str, str]:
    """How the recording ended and what is missing, as the bag says it; without its word, what the reader has found."""
    if not storage.closed:
        left_out = sum(size for _, size, _ in storage.unread)
        return {"end": f"not closed; {left_out} bytes behind the last whole chunk are left out"}
    anew = {"end": "written anew by another program, which does not say what was lost"}
    return {key: word for key, word in storage.records.get(LOST_RECORD, anew).items() if key != METADATA_DIGEST}

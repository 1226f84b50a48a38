"""An open bag: its file, its scene, and its ticks, also where another program has written it anew."""

from __future__ import annotations

import math
import os
from array import array
from collections import Counter
from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from itertools import chain, groupby, islice, pairwise
from operator import attrgetter
from pathlib import Path
from typing import NoReturn

import numpy as np
from rosbags.serde import SerdeError

from grasp_ros import scene as scenes
from grasp_ros.graph.bag import BagError, EmptyBagError
from grasp_ros.graph.bag.recorder import OWN_RECORD, VERSION
from grasp_ros.graph.bag.rosbag2 import TOPIC, decode, names_of, topics_of
from grasp_ros.graph.bag.storage import CONVERT, Storage, Stored
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.serialization import has_raw_stamp, raw_stamp_ns, template_of
from grasp_ros.physics import given
from grasp_ros.physics.layout import OBJECT
from grasp_ros.physics.system import NAMES
from grasp_ros.scene import topics
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import DAMAGE, decoding, reading
from grasp_ros.scene.topics import CLOCK, JOINT_STATES, LYAPUNOV, RUN, SCENE, Numbers, Topic, timing_names

KIND = "a bag of this package"
MOST_AHEAD = 16  # messages, of which two say what the bag holds
# What is raised for bytes that are no message, by rosbags the last two.
UNREADABLE: tuple[type[Exception], ...] = (*DAMAGE, SerdeError, AttributeError)
PACKED = ".zstd"  # ending of a file that rosbag2 has compressed as a whole
ZSTD = b"\x28\xb5\x2f\xfd"
MOST_NS = 2**63 - 1
LARGEST = 1e100  # of a number: its square is one, too
OUR_TIMES = "allowed: a bag of `grasp run`, or of its monitor, whose times are simulated ones"
IN_ORDER = "allowed: ticks of the scene in their order"
NOT_FINITE = f"a number is not finite, or beyond {LARGEST:g}"


def decoding_bag(path: Path) -> AbstractContextManager[None]:
    """Refuse a bag of which something is not as it should be."""
    return decoding(path, KIND, BagError, UNREADABLE)


def _file_of(path: Path) -> Path:
    """The storage file of a bag: the path itself, or the one in a directory."""
    files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    if files and files[0].is_fifo():
        raise BagError(f"{path}: not {KIND}: a pipe; allowed: a file")
    if path.name == "metadata.yaml" and path.is_file():
        raise BagError(f"{path}: the metadata of a bag; the bag is its directory, {path.parent}")
    if len(files) == 1 and files[0].suffix not in (".db3", PACKED):
        return files[0]
    if any((path / "bag").glob("*.mcap")):
        raise BagError(f"{path}: the directory of a run; its bag is {path / 'bag'}")
    if any(path.glob("*.db3*")) or ".db3" in path.suffixes:
        raise BagError(f"{path}: its storage is sqlite3; allowed: MCAP, {CONVERT}")
    if any(path.glob("*.mcap.*")) or path.suffix == PACKED:
        raise BagError(f"{path}: its file is compressed as a whole; allowed: chunks, {CONVERT}")
    joined = f", {CONVERT}" if files else ""
    raise BagError(f"{path}: not {KIND}: holds {len(files)} .mcap files; allowed: one{joined}")


class Opened:
    """A bag whose own record says which scene it holds, and how that ran.

    In a bag that another program has written anew, from ours, the topics `scene` and `run` say it. A recorder writes
    messages that differ from each other in time and numbers alone; any other is decoded as a whole.
    """

    def __init__(self, path: str | os.PathLike[str], salvage: bool = False) -> None:
        self.path = path = given.path("path", path)
        self._salvage = salvage  # what is damaged is left out
        with decoding_bag(path):
            with reading(path, BagError):
                self.storage = Storage(_file_of(path), salvage)
            messages, records = self.storage.messages(), self.storage.records
            first = list(islice(messages, 1))
            if first and OWN_RECORD not in records:
                first += islice(messages, MOST_AHEAD)
                if any(stored.cdr.startswith(ZSTD) for stored in first):
                    raise BagError(f"{path}: its messages are compressed one by one; allowed: chunks, {CONVERT}")
                records[OWN_RECORD] = _record_from_topics(first, path)
            if OWN_RECORD not in records:
                why = "".join(f": {why}" for _, _, why in self.storage.unread[:1])
                raise EmptyBagError(f"{path}: holds no tick{why}")
            own = records[OWN_RECORD]
            self.scene = scenes.parse(own["scene"], path.name, str(path))
            self.running = Running.parse(own["run"])
            self.versions = {key.removeprefix(VERSION): word for key, word in own.items() if key.startswith(VERSION)}
            self.names = names_of(self.scene, own)
            everything: Iterable[Stored] = chain(first, messages)
            if not self.storage.ours:
                again = Storage(self.storage.path, salvage).messages()
                if any(after.time_ns < before.time_ns for before, after in pairwise(again)):  # topic by topic, say
                    everything = sorted(everything, key=attrgetter("time_ns"))
            self.left_out: Counter[str] = Counter()  # messages that a bag which is salvaged is left without, by reason
            self.messages = self._known(everything)  # each with its topic
        scene, lockstep = self.scene, self.running.lockstep
        self._period_ns, self._end_ns = scene.period_ns, scene.ticks * scene.period_ns
        self._bodies = [NAMES[body] for body in scene.system.present]
        self._templates = {topic: template_of(topic, self._bodies) for topic in (CLOCK, *scene.topics)}
        # Forces of topics whose messages are as they came, not one for each tick: those of commands in a free run.
        self.held = {topic: array("d") for topic in (() if lockstep else scene.controllers.values())}
        # Topics of a row, in its order.
        self.topics = {topic: own for topic, own in self._templates.items() if topic not in self.held}
        self._time_ns, self.stamp_ns = 0, 0  # of the last tick; the first one counts from the begin of the scene
        self._before = -1
        # What `take` has taken beside forces: numbers of `timing` by `quality`, and those that differ from the ones in
        # force before, by the tick of the bag from which they act; how many announcements are missing.
        self.quality = () if lockstep else timing_names(NAMES[body] for body in scene.system.laws)
        self.timing: list[Sequence[float]] = []
        self.changes: dict[int, dict[str, float]] = {}
        self._now = scene.numbers_of(*scene.controllers)
        self._announced = {topic: Numbers() for topic in topics.CHANGES.values()}
        self.unheard: Counter[str] = Counter()

    def _known(self, messages: Iterable[Stored]) -> Iterator[tuple[Topic, Stored]]:
        known = {(name, topic.type): topic for topic, name in self.names.items()}
        with decoding_bag(self.path):
            for stored in messages:
                if topic := known.get((stored.topic, stored.type)):
                    yield topic, stored
                elif self._salvage:
                    self.left_out[f"messages on {stored.topic}, no topic of its scene"] += 1
                else:
                    raise BagError(f"{self.path}: {stored.topic}: {stored.type} is not a topic of its scene;"
                                   " `grasp recover` leaves it out")

    def ticks(
        self, wanted: Container[Topic]
    ) -> Iterator[tuple[int, dict[Topic, bytes], list[tuple[Topic, Stored]]]]:
        """Time in ns of each tick, its messages on these topics, and all others of that time, in the order of the bag.

        A topic has one message for a tick; of more the last one is salvaged.
        """
        messages = self.messages if self.storage.ours else self._with_our_times(wanted)
        for time_ns, group in groupby(messages, key=lambda message: message[1].time_ns):
            tick, others = dict[Topic, bytes](), list[tuple[Topic, Stored]]()
            for topic, stored in group:
                if topic not in wanted:
                    others.append((topic, stored))
                    continue
                if topic in tick:
                    if not self._salvage:
                        raise BagError(f"{stored.topic}: {time_ns} ns: a second message of this tick; allowed: one")
                    self.left_out[f"messages on {stored.topic} before another one of their tick"] += 1
                tick[topic] = stored.cdr
            yield time_ns, tick, others

    def _with_our_times(self, wanted: Container[Topic]) -> Iterator[tuple[Topic, Stored]]:
        """Messages of a bag that another program has written; refused if their times are not the stamps.

        Until a reset, from which on the times of our own bags are ahead of the stamps.
        """
        stamp_ns = 0
        for topic, stored in self.messages:
            if topic in wanted and has_raw_stamp(stored.cdr):
                before_ns, stamp_ns = stamp_ns, raw_stamp_ns(stored.cdr)
                if stamp_ns < before_ns:
                    yield topic, stored
                    break
                if stamp_ns != stored.time_ns:
                    raise BagError(f"{self.path}: {stored.topic}: time {stored.time_ns} ns in the bag, stamp"
                                   f" {stamp_ns} ns: another recorder wrote it; {OUR_TIMES}")
            yield topic, stored
        yield from self.messages

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
        elif topic in (SCENE, RUN) and (
            decode(topic, stored.cdr).data != self.storage.records[OWN_RECORD][topic.name]
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
            raise BagError(f"{self.names[next(iter(tick))]}: {time_ns} ns; {IN_ORDER}")
        found, row = dict[Topic, Sequence[float]](), list[float]()
        for topic, template in self.topics.items():
            if (cdr := tick.get(topic)) is None:
                row += [math.nan] * template.count
                continue
            found[topic] = numbers = self.numbers(topic, cdr)
            row += numbers[2:]
            if topic != LYAPUNOV and not sum(map(abs, numbers)) <= LARGEST:
                self._refuse(topic, time_ns, NOT_FINITE)
        self._before = time_ns
        if states := found.get(JOINT_STATES):
            stamp_ns = int(states[0]) * NANOSECONDS + int(states[1])
            step, passed = stamp_ns - self.stamp_ns, time_ns - self._time_ns
            follows = step == passed or step <= 0 or passed > self._period_ns  # or it was reset, perhaps in a gap
            if stamp_ns % self._period_ns or not 0 <= stamp_ns <= self._end_ns or not follows:
                self._refuse(JOINT_STATES, time_ns, "its stamp is not the next one of the scene")
            efforts = zip(self._bodies, states[-len(self._bodies) :], strict=True)
            if any(effort for name, effort in efforts if name == NAMES[OBJECT]):
                self._refuse(JOINT_STATES, time_ns, "an effort of the object; allowed: 0")
            for topic, own in found.items():
                if own[0] != states[0] or own[1] != states[1]:
                    self._refuse(topic, time_ns, "its stamp is not that of the state")
            self._time_ns, self.stamp_ns = time_ns, stamp_ns
        return row

    def _refuse(self, topic: Topic, time_ns: int, why: str) -> NoReturn:
        raise BagError(f"{self.names[topic]}: tick {time_ns // self._period_ns}: {why}")

    def numbers(self, topic: Topic, cdr: bytes) -> Sequence[float]:
        """Seconds, nanoseconds and numbers of a message."""
        return self._templates[topic].read(cdr) or self._decoded(topic, cdr)

    def _decoded(self, topic: Topic, cdr: bytes) -> list[float]:
        """Time and numbers of a message of another program, in the order of those of a recorder."""
        message, names, name = decode(topic, cdr), self._bodies, self.names[topic]
        if topic == CLOCK:
            return [message.clock.sec, message.clock.nanosec]
        if topic.type == topics.FORCE:  # of a command only its force is read, whoever sends it; others have no more
            force, torque = message.wrench.force, message.wrench.torque
            if topic not in topics.COMMANDS.values() and any((force.y, force.z, torque.x, torque.y, torque.z)):
                raise BagError(f"{name}: a force or torque other than force.x; allowed: 0")
        numbers = [force.x] if topic.type == topics.FORCE else message.position
        if topic == JOINT_STATES:
            lists = message.position, message.velocity, message.effort
            once = len({*message.name}) == len(message.name)
            if not (once and {*names} <= {*message.name} and all(len(row) == len(message.name) for row in lists)):
                raise BagError(f"{name}: {', '.join(message.name)}; allowed: three numbers of {', '.join(names)}")
            numbers = np.array(lists)[:, [message.name.index(name) for name in names]].ravel()
        if len(numbers) != self._templates[topic].count:
            raise BagError(f"{name}: {len(numbers)} numbers; allowed: {self._templates[topic].count}")
        if topic == LYAPUNOV:
            if sorted(message.name) != sorted(topics.LYAPUNOV_NAMES):
                raise BagError(f"{name}: {', '.join(message.name)}; allowed: {', '.join(topics.LYAPUNOV_NAMES)}")
            numbers = [numbers[message.name.index(name)] for name in topics.LYAPUNOV_NAMES]
        return [message.header.stamp.sec, message.header.stamp.nanosec, *numbers]


def _record_from_topics(first: Collection[Stored], path: Path) -> dict[str, str]:
    """The own record of a bag that has lost it, from the topics `scene` and `run`, and the names of all topics."""
    there = {stored.topic.rpartition("/")[2]: stored for stored in first if stored.type == SCENE.type}
    if not {SCENE.name, RUN.name} <= there.keys():
        missing = " and ".join(topic.name for topic in (SCENE, RUN) if topic.name not in there)
        raise BagError(f"{path}: not {KIND}: nothing at its beginning on {missing}; allowed: all topics of a graph")
    found = {topic.name: decode(topic, there[topic.name].cdr).data for topic in (SCENE, RUN)}
    scene, root = scenes.parse(found["scene"], path.name, str(path)), there[SCENE.name].topic.removesuffix(SCENE.name)
    names = {topic: f"{root}{topic.name.lstrip('/')}" for topic in topics_of(scene) if topic != topics.DIAGNOSTICS}
    for stored in first:
        if stored.type == CLOCK.type:  # whose name only a remapping changes
            names[CLOCK] = stored.topic
    return {**found, **{f"{TOPIC}{topic.name}": name for topic, name in names.items()}}


def _timing(names: Sequence[str], stored: Stored) -> Iterator[Sequence[float]]:
    """The numbers of a message on `timing`; none of one that is not a plant's: any node may publish there."""
    with suppress(*UNREADABLE):
        message = decode(topics.TIMING, stored.cdr)
        if [*names] == message.name and len(names) == len(message.position) and np.isfinite(message.position).all():
            yield message.position

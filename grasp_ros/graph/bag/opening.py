"""Opening a bag: its file, its scene, and how that ran, also where another program has written it anew."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import AbstractContextManager
from itertools import chain, islice, pairwise
from operator import attrgetter
from pathlib import Path

from rosbags.serde import SerdeError

from grasp_ros import scene as scenes
from grasp_ros.graph import running as runnings
from grasp_ros.graph.bag import BagError, EmptyBagError
from grasp_ros.graph.bag.recorder import OWN_RECORD, VERSION
from grasp_ros.graph.bag.rosbag2 import TOPIC, decode, names_of, topics_of
from grasp_ros.graph.bag.storage import CONVERT, Storage, Stored
from grasp_ros.physics import given
from grasp_ros.scene.files import DAMAGE, decoding, reading
from grasp_ros.scene.topics import CLOCK, DIAGNOSTICS, RUN, SCENE, Topic

KIND = "a bag of this package"
MOST_AHEAD = 16  # messages, of which two say what the bag holds
# What is raised for bytes that are no message, by rosbags the last two.
UNREADABLE: tuple[type[Exception], ...] = (*DAMAGE, SerdeError, AttributeError)
PACKED = ".zstd"  # ending of a file that rosbag2 has compressed as a whole
ZSTD = b"\x28\xb5\x2f\xfd"


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
    """A bag whose first messages have been read: its own record says which scene it holds, and how that ran.

    In a bag that another program has written anew, from ours, the topics `scene` and `run` say it.
    """

    def __init__(self, path: str | os.PathLike[str], salvage: bool = False) -> None:
        self.path = path = given.path("path", path)
        self.salvage = salvage  # what is damaged is left out
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
            self.running = runnings.parse(own["run"])
            self.versions = {key.removeprefix(VERSION): word for key, word in own.items() if key.startswith(VERSION)}
            self.names = names_of(self.scene, own)
            everything: Iterable[Stored] = chain(first, messages)
            if not self.storage.ours:
                again = Storage(self.storage.path, salvage).messages()
                if any(after.time_ns < before.time_ns for before, after in pairwise(again)):  # topic by topic, say
                    everything = sorted(everything, key=attrgetter("time_ns"))
            self.left_out: Counter[str] = Counter()  # messages that a bag which is salvaged is left without, by reason
            self.messages = self._known(everything)  # each with its topic
            # Topics whose messages are as they came, not one for each tick: those of commands in a free run.
            self.held: Collection[Topic] = () if self.running.lockstep else self.scene.controllers.values()

    def _known(self, messages: Iterable[Stored]) -> Iterator[tuple[Topic, Stored]]:
        known = {(name, topic.type): topic for topic, name in self.names.items()}
        with decoding_bag(self.path):
            for stored in messages:
                if topic := known.get((stored.topic, stored.type)):
                    yield topic, stored
                elif self.salvage:
                    self.left_out[f"messages on {stored.topic}, no topic of its scene"] += 1
                else:
                    raise BagError(f"{self.path}: {stored.topic}: {stored.type} is not a topic of its scene;"
                                   " `grasp recover` leaves it out")


def _record_from_topics(first: Collection[Stored], path: Path) -> dict[str, str]:
    """The own record of a bag that has lost it, from the topics `scene` and `run`, and the names of all topics."""
    there = {stored.topic.rpartition("/")[2]: stored for stored in first if stored.type == SCENE.type}
    if not {SCENE.name, RUN.name} <= there.keys():
        missing = " and ".join(topic.name for topic in (SCENE, RUN) if topic.name not in there)
        raise BagError(f"{path}: not {KIND}: nothing at its beginning on {missing}; allowed: all topics of a graph")
    found = {topic.name: decode(topic, there[topic.name].cdr).data for topic in (SCENE, RUN)}
    scene, root = scenes.parse(found["scene"], path.name, str(path)), there[SCENE.name].topic.removesuffix(SCENE.name)
    names = {topic: f"{root}{topic.name.lstrip('/')}" for topic in topics_of(scene) if topic != DIAGNOSTICS}
    for stored in first:
        if stored.type == CLOCK.type:  # whose name only a remapping changes
            names[CLOCK] = stored.topic
    return {**found, **{f"{TOPIC}{topic.name}": name for topic, name in names.items()}}

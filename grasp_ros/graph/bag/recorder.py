"""The recorder: a bag that can be read whenever and however its recording ends.

Ticks are collected in a compressed chunk with a checksum. A thread ends the chunk and hands it to the disk every
FLUSH_SECONDS, whether or not more ticks come. A reserve on the disk is there for the index: when the disk is full, the
bag is closed, not cut off.
"""

from __future__ import annotations

import hashlib
import os
import struct
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, MessageIndex
from mcap.writer import CompressionType, IndexType, Writer

from grasp_ros.graph.bag import BagError, rosbag2
from grasp_ros.graph.bag.disk import CHUNK_BYTES, RESERVE_BYTES, Sink
from grasp_ros.graph.parameters import Running
from grasp_ros.graph.serialization import template_of
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.files import new_directory, writing
from grasp_ros.scene.strict_yaml import dump
from grasp_ros.scene.topics import CLOCK, RUN, SCENE, Topic

PRIVATE = [f"_Writer__{name}" for name in ("chunk_builder", "statistics", "chunk_indices")]  # of the library
FLUSH_SECONDS = 0.1  # a kill loses what came after the last flush; flush and disk have as long again
INDEX_BYTES = 512  # that are reserved for what the index holds of one chunk: twice the most that it needs
HEAD: struct.Struct = struct.Struct("<BQ")  # opcode and length of every record of MCAP
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # the same of a message, its channel, number and both times
OWN_RECORD, LOST_RECORD = "grasp_ros", "grasp_ros/lost"
LIBRARY = "grasp_ros-"  # how the name of what has written a bag begins
# Counted in LOST_RECORD: all that is in the bag, and what came between the states and was too much.
WRITTEN, NOT_RECORDED = "messages written", "messages not recorded"
SOURCE, LEFT_OUT = "recovered from", "what was left out"  # of a bag that was recovered
VERSION = "version "  # how the keys of versions begin
DIGEST, METADATA_DIGEST = "digest", "digest of metadata.yaml"  # keys of checksums in these records


def checksum(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def signed(record: Mapping[str, str]) -> dict[str, str]:
    """A metadata record with its checksum: MCAP itself has none before the file is closed."""
    content = {key: value for key, value in record.items() if key != DIGEST}
    return {**content, DIGEST: checksum(repr(sorted(content.items())))}


class ChunkIndexes:
    """The indexes of all chunks, serialized already, in place of a writer's list: a day has a million chunks."""

    def __init__(self) -> None:
        self._serialized = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Add one."""
        index.write(self._serialized)

    def __iter__(self) -> Iterator[ChunkIndexes]:
        """All of them as one."""
        yield self

    def write(self, stream: RecordBuilder) -> None:
        """Write all of them."""
        stream.write(self._serialized.end())  # type: ignore[no-untyped-call]


def check_path(path: Path) -> None:
    """Refuse a path at which a bag cannot be made."""
    with writing(f"bag: {path}"):
        with suppress(FileNotFoundError):  # any other error refuses the path
            path.lstat()
            raise FileExistsError
        there = next(parent for parent in path.absolute().parents if parent.exists())
        TemporaryDirectory(dir=there).cleanup()


class Recorder:
    """Writes one bag, into a directory that does not exist yet: the scene and the versions first, then ticks.

    Topics that have no full name in `names` get the one without a namespace.

    Raises
    ------
    BagError
        If the directory exists or cannot be written, now or later. When the disk, or the size that the system allows a
        file, has come to its end, the bag has been closed and is whole up to the last tick.
    """

    def __init__(
        self, path: Path, scene: Scene, versions: Mapping[str, str], names: Mapping[Topic, str] | None = None,
        running: Running | None = None,
    ) -> None:
        self._path, self._period_ns = path, scene.period_ns
        self._topics = rosbag2.topics_of(scene)
        self._last_ns = self._next = 0
        self._gaps: list[tuple[int, int]] = []
        self._closed, self._error = False, ""
        self._lock, self._stop = threading.Lock(), threading.Event()
        words = {f"{VERSION}{name}": word for name, word in sorted(versions.items())}
        topics = {f"{rosbag2.TOPIC}{topic.name}": name for topic, name in (names or {}).items()}
        self._custom = {"scene": scene.to_yaml(), "run": (running or Running()).to_yaml(), **words, **topics}
        self._names = rosbag2.names_of(scene, self._custom)
        self._clock = template_of(CLOCK)
        with new_directory(path, BagError):
            self._sink = Sink(path / f"{path.name}.mcap", path / ".reserve")
            self._begin()
        self._thread = threading.Thread(target=self._flush_regularly, name="recorder", daemon=True)
        self._thread.start()

    def _begin(self) -> None:
        """All that a reader needs to know before the first tick, on the disk."""
        self._writer = Writer(
            self._sink, chunk_size=2**62, compression=CompressionType.ZSTD, index_types=IndexType.ALL,  # type: ignore[arg-type]
            enable_data_crcs=True,
        )
        own: list[Any] = [getattr(self._writer, name, None) for name in PRIVATE]
        if None in own or own[-1] != []:
            raise BagError(f"mcap {version('mcap')}: its writer is another one; allowed: mcap>=1.5,<1.7")
        self._chunk, self._statistics, _ = own
        setattr(self._writer, PRIVATE[-1], ChunkIndexes())
        self._writer.start(rosbag2.PROFILE, f"{LIBRARY}{version('grasp_ros')}")
        self._writer.add_metadata(OWN_RECORD, signed(self._custom))
        schemas = {
            kind: self._writer.register_schema(kind, rosbag2.SCHEMA_ENCODING, rosbag2.definition(kind))
            for kind in dict.fromkeys(topic.type for topic in self._topics)
        }
        self._channels = {
            topic: self._writer.register_channel(
                self._names[topic], rosbag2.ENCODING, schemas[topic.type],
                {"offered_qos_profiles": dump(rosbag2.qos_profiles(topic)).strip()},
            )
            for topic in self._topics
        }
        for topic, key in ((SCENE, "scene"), (RUN, "run")):
            self._add(topic, 0, rosbag2.text_message(self._custom[key]))
        self._flush()
        directory = os.open(self._path, os.O_RDONLY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)

    def write_tick(
        self, time_ns: int, messages: Iterable[tuple[Topic, bytes]], stamp_ns: int | None = None
    ) -> None:
        """Append all messages of one tick, the monitor's own last, and its /clock: as a whole, or not at all.

        Time in the bag never goes back; it goes on where a reset puts simulated time, the stamp, back.

        Raises
        ------
        BagError
            If the bag could not be written up to here, or ends with this tick.
        """
        clock = self._clock.fill(time_ns if stamp_ns is None else stamp_ns, ())
        with self._lock, writing(self._path, BagError):
            if self._closed:
                raise BagError(self._error or f"{self._path}: is closed")
            self._add(CLOCK, time_ns, clock)
            for topic, cdr in messages:
                self._add(topic, time_ns, cdr)
            tick = time_ns // self._period_ns
            if tick > self._next:
                self._gaps.append((self._next, tick - 1))
            self._last_ns, self._next = time_ns, tick + 1
            if self._chunk.count > CHUNK_BYTES:
                self._flush()

    def write(self, topic: Topic, cdr: bytes) -> None:
        """Append what does not come with every tick, at the time of the last one; nothing once the bag is closed."""
        with self._lock, writing(self._path, BagError):
            if not self._closed:
                self._add(topic, self._last_ns, cdr)

    def _add(self, topic: Topic, time_ns: int, cdr: bytes) -> None:
        """Add a message, not earlier than the last: with the bytes of the library's way, in a third of its time."""
        channel, chunk, statistics = self._channels[topic], self._chunk, self._statistics
        number = statistics.channel_message_counts[channel]
        if channel not in chunk.message_indices:
            chunk.message_indices[channel] = MessageIndex(channel, [])
        chunk.message_indices[channel].records.append((time_ns, chunk.count))
        if not chunk.num_messages:
            chunk.message_start_time = time_ns
        chunk.message_end_time = statistics.message_end_time = time_ns
        chunk.num_messages += 1
        statistics.message_count += 1
        statistics.channel_message_counts[channel] = number + 1
        length = MESSAGE_HEAD.size - HEAD.size + len(cdr)
        head = MESSAGE_HEAD.pack(Opcode.MESSAGE, length, channel, number, time_ns, time_ns)
        chunk.record_writer.write(head + cdr)

    def _flush(self) -> None:
        """End the chunk; close the bag while there is room for its end, and say why."""
        if not self._chunk.num_messages:
            return
        self._writer.flush()  # type: ignore[no-untyped-call]
        if why := self._sink.reserve(RESERVE_BYTES + INDEX_BYTES * self._statistics.chunk_count):
            until = f"the recording ends at {self._last_ns / NANOSECONDS} s"
            self._error = (f"{self._path}: {until}: {why}; the bag is closed, and whole up to there" if self._next else
                           f"{self._path}: no tick could be recorded: {why}")
            self._finish(why, {})
            raise BagError(self._error)

    def _flush_regularly(self) -> None:
        while not self._stop.wait(FLUSH_SECONDS):
            try:
                with writing(self._path, BagError):
                    with self._lock:
                        self._flush()
                    self._sink.check()
                    file, there = os.fstat(self._sink.file), self._path / f"{self._path.name}.mcap"
                    if not file.st_nlink:  # its end could not be written behind it
                        raise BagError(f"{self._path}: was deleted during the recording")
                    if not there.exists() or not os.path.samestat(file, there.stat()):
                        raise BagError(f"{self._path}: was moved during the recording, which ends there;"
                                       " `grasp recover` closes it")
                    os.fdatasync(self._sink.file)
            except BagError as error:  # for whoever writes or closes next
                self._error, self._closed = str(error), True
                return

    @property
    def gaps(self) -> str:
        """Ticks of the scene that were not written so far, "3, 7-9", say."""
        return ", ".join(f"{first}" if first == last else f"{first}-{last}" for first, last in self._gaps)

    def close(self, counters: Mapping[str, object] | None = None) -> None:
        """Finish the bag, with what else was lost or dropped; only now it has its metadata. Nothing the second time.

        Raises
        ------
        BagError
            If it cannot be written, or if that was already so before.
        """
        self._stop.set()
        self._thread.join()
        try:
            with writing(self._path, BagError):
                if not self._closed:
                    self._flush()
                    self._finish("closed", {name: str(value) for name, value in (counters or {}).items()})
        finally:
            self._closed = True
            self._sink.close()
        if self._error:
            raise BagError(self._error)

    def _finish(self, why: str, counters: Mapping[str, str]) -> None:
        """Write what was lost, the index, and the metadata."""
        self._closed = True
        self._sink.release()
        written = self._statistics.channel_message_counts
        counts = {topic: written[channel] for topic, channel in self._channels.items()}
        document = rosbag2.metadata(f"{self._path.name}.mcap", counts, self._names, self._last_ns, self._custom)
        text = dump(document)
        lost = {"end": why, "ticks that are missing": self.gaps or "none", WRITTEN: str(sum(counts.values())),
                **counters, METADATA_DIGEST: checksum(text)}
        self._writer.add_metadata(LOST_RECORD, signed(lost))
        self._writer.add_metadata(rosbag2.METADATA_RECORD, {
            rosbag2.METADATA_KEY: dump(document[rosbag2.INFORMATION]).strip()
        })
        self._writer.finish()  # type: ignore[no-untyped-call]
        os.fsync(self._sink.file)
        part = self._path / "metadata.part"
        part.write_text(text, encoding="utf-8")
        part.replace(self._path / "metadata.yaml")

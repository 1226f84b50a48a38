"""The messages in the chunks of a bag, and the index of its chunks, in a fraction of the library's time and memory.

A tick has seven messages, and a recording of a day a million chunks. The library writes all else; a bag has the same
bytes as if it had added the messages, too.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from importlib.metadata import version

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, MessageIndex
from mcap.writer import Writer

from grasp_ros.graph.bag import BagError

HEAD: struct.Struct = struct.Struct("<BQ")  # opcode and length of every record
RECORD = struct.Struct("<BQHIQQ")  # the same of a message, its channel, number and both times
_OWN_BYTES = RECORD.size - HEAD.size  # of a message, beside its data
_CHUNK, _INDEXES, _STATISTICS = (f"_Writer__{name}" for name in ("chunk_builder", "chunk_indices", "statistics"))


class Messages:
    """Takes the messages for a writer of MCAP that has no chunk yet.

    Raises
    ------
    BagError
        If the writer is of another make than those that pyproject.toml allows: it has no public door for this.
    """

    def __init__(self, writer: Writer) -> None:
        if getattr(writer, _INDEXES, None) != [] or not hasattr(writer, _CHUNK) or not hasattr(writer, _STATISTICS):
            raise BagError(f"mcap {version('mcap')}: its writer is another one; allowed: mcap>=1.5,<1.7")
        setattr(writer, _INDEXES, _ChunkIndexes())
        self._writer, self._chunk, self._statistics = writer, getattr(writer, _CHUNK), getattr(writer, _STATISTICS)
        self.counts: dict[int, int] = self._statistics.channel_message_counts  # messages so far, by channel

    def add(self, channel: int, time_ns: int, data: bytes) -> None:
        """Add one, not earlier than the last, the first at 0; its number is that of those before on its channel."""
        chunk, statistics, number = self._chunk, self._statistics, self.counts[channel]
        if channel not in chunk.message_indices:
            chunk.message_indices[channel] = MessageIndex(channel, [])
        chunk.message_indices[channel].records.append((time_ns, chunk.count))
        if not chunk.num_messages:
            chunk.message_start_time = time_ns
        chunk.message_end_time = statistics.message_end_time = time_ns
        chunk.num_messages += 1
        statistics.message_count += 1
        self.counts[channel] = number + 1
        head = RECORD.pack(Opcode.MESSAGE, _OWN_BYTES + len(data), channel, number, time_ns, time_ns)
        chunk.record_writer.write(head + data)


class _ChunkIndexes:
    """The indexes of all chunks, serialized already, in place of the writer's list."""

    def __init__(self) -> None:
        self._content = bytearray()

    def append(self, index: ChunkIndex) -> None:
        """Add one."""
        builder = RecordBuilder()
        index.write(builder)
        self._content += builder.end()  # type: ignore[no-untyped-call]

    def __iter__(self) -> Iterator[_ChunkIndexes]:
        """All of them as one."""
        yield self

    def write(self, stream: RecordBuilder) -> None:
        """Write all of them."""
        stream.write(self._content)

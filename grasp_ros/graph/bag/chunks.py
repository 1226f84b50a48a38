"""The messages in the chunks of a bag, and their indexes, in a fraction of the library's time and memory.

A tick has seven messages, and a recording of a day a million chunks. The library writes all else, chunks included; a
bag has the same bytes as if it had added the messages, too.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from importlib.metadata import version

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex
from mcap.writer import Writer

from grasp_ros.graph.bag.errors import BagError

HEAD: struct.Struct = struct.Struct("<BQ")  # opcode and length of every record
RECORD = struct.Struct("<BQHIQQ")  # the same of a message, its channel, number and both times
INDEX = struct.Struct("<BQHI")  # the same of an index of messages, its channel, and the bytes of its entries
ENTRY = struct.Struct("<QQ")  # time of a message, and its place in the content of its chunk
_OWN_BYTES = RECORD.size - HEAD.size  # of a message, beside its data
_OWN_INDEX_BYTES = INDEX.size - HEAD.size
_MESSAGE, _INDEX = int(Opcode.MESSAGE), int(Opcode.MESSAGE_INDEX)
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
        setattr(writer, _INDEXES, _Records())
        self._writer, self._chunk, self._statistics = writer, getattr(writer, _CHUNK), getattr(writer, _STATISTICS)
        self.counts: Counter[int] = Counter()  # messages so far, by channel
        self._records, self._entries = bytearray(), dict[int, bytearray]()
        self._begin = 0  # of the records in the chunk: behind channels and schemas
        self._first = self._last = 0

    def add(self, channel: int, time_ns: int, data: bytes) -> None:
        """Add one to the current chunk, not earlier than the last; its number is that of those before there."""
        records = self._records
        if not records:
            self._begin, self._first = self._chunk.count, time_ns
        entries = self._entries.get(channel)
        if entries is None:
            entries = self._entries[channel] = bytearray()
        entries += ENTRY.pack(time_ns, self._begin + len(records))
        number = self.counts[channel]
        self.counts[channel] = number + 1
        records += RECORD.pack(_MESSAGE, _OWN_BYTES + len(data), channel, number, time_ns, time_ns)
        records += data
        self._last = time_ns

    def flush(self) -> None:
        """End the chunk, and hand it to the writer's stream."""
        if self._records:
            self._hand_over()
        self._writer.flush()  # type: ignore[no-untyped-call]

    def _hand_over(self) -> None:
        """What the library would have noted at each message."""
        chunk, statistics = self._chunk, self._statistics
        chunk.record_writer.write(self._records)
        chunk.message_indices.update({
            channel: _Records(INDEX.pack(_INDEX, _OWN_INDEX_BYTES + len(entries), channel, len(entries)) + entries)
            for channel, entries in self._entries.items()
        })
        chunk.num_messages = sum(len(entries) // ENTRY.size for entries in self._entries.values())
        chunk.message_start_time, chunk.message_end_time = self._first, self._last
        if not statistics.message_count:
            statistics.message_start_time = self._first
        statistics.message_end_time = self._last
        statistics.message_count += chunk.num_messages
        statistics.channel_message_counts.update(self.counts)
        self._records.clear()
        self._entries.clear()


class _Records:
    """Records that are serialized already, for the writer to write: an index, or all that stand in for its list."""

    def __init__(self, content: bytes = b"") -> None:
        self._content = bytearray(content)

    def append(self, index: ChunkIndex) -> None:
        """Add one."""
        builder = RecordBuilder()
        index.write(builder)
        self._content += builder.end()  # type: ignore[no-untyped-call]

    def __iter__(self) -> Iterator[_Records]:
        """All of them as one."""
        yield self

    def write(self, stream: RecordBuilder) -> None:
        """Write all of them."""
        stream.write(self._content)

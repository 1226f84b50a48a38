"""The index of a bag's chunks in a sixth of the memory: a recording of a day has a million of them."""

from __future__ import annotations

from collections.abc import Iterator

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import Writer

_LIST = "_Writer__chunk_indices"  # where the writer keeps them until the file ends; it has no other door


class ChunkIndexes:
    """What a writer of MCAP takes for its list of chunk indexes, kept as the bytes that it writes at the end."""

    def __init__(self) -> None:
        self._records = bytearray()

    def append(self, index: ChunkIndex) -> None:
        """Add one."""
        builder = RecordBuilder()
        index.write(builder)
        self._records += builder.end()  # type: ignore[no-untyped-call]

    def __iter__(self) -> Iterator[ChunkIndexes]:
        """All of them as one record, for the writer to write."""
        yield self

    def write(self, stream: RecordBuilder) -> None:
        """Write all of them."""
        stream.write(self._records)


def keep_packed(writer: Writer) -> None:
    """Let a writer that has no chunk yet keep its index packed.

    Raises
    ------
    AttributeError
        If the writer is of another make than the one that is known here.
    """
    if getattr(writer, _LIST):
        raise AttributeError(_LIST)
    setattr(writer, _LIST, ChunkIndexes())

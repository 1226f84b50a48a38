"""The records of an MCAP file, whole, cut off or damaged.

Every byte that a message depends on is under a checksum: of its chunk, and in a closed file of all data and of the
index as well. The library's own reader would stop at the first byte that is wrong, or not notice it.
"""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import NamedTuple, NoReturn

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Footer, Header, Metadata, Schema

from grasp_ros.graph.bag import BagError
from grasp_ros.graph.bag.recorder import DIGEST, HEAD, LIBRARY, LOST_RECORD, OWN_RECORD, signed
from grasp_ros.graph.bag.rosbag2 import PROFILE

MAGIC = b"\x89MCAP0\r\n"
MESSAGE = struct.Struct("<H4xQ8x")  # channel and time of a message; the library's reader takes ten times as long
SUM = struct.Struct("<I")
DATA_END_BYTES = HEAD.size + SUM.size
FOOTER_HEAD = HEAD.pack(Opcode.FOOTER, 20)
FOOTER_BYTES = HEAD.size + 20 + len(MAGIC)
CHUNK_MARK, CHUNK_MARK_AT = b"\x04\x00\x00\x00zstd", HEAD.size + 28  # how a chunk of the recorder is found again
RECORD_BYTES = 2**23  # no record of a bag is larger, packed or unpacked
RATIO = 200  # nor does any chunk of a bag pack better; only a bomb does
CONVERT = "as `rosbags-convert --src BAG --dst NEW --dst-storage mcap` writes it"
DAMAGE = (McapError, zstandard.ZstdError, struct.error, UnicodeDecodeError, EOFError, OverflowError)


class UnsupportedFormatError(McapError):
    """A valid record that no bag of this package has."""


class Stored(NamedTuple):
    """One message as it lies in the file."""

    topic: str
    type: str
    time_ns: int
    cdr: bytes


class Storage:
    """One MCAP file, read once from its beginning; a file that was cut off is read to there.

    What is damaged is refused, or with `salvage` left out.
    """

    def __init__(self, path: Path, salvage: bool = False) -> None:
        self.path, self._salvage = path, salvage
        # Both are complete when all messages have been taken.
        self.unread: list[tuple[int, int, str]] = []  # offset, size and reason of what was not read
        self.records: dict[str, dict[str, str]] = {}  # of metadata, by name
        self.ours = False  # whether this package has written it
        self._channels: dict[int, Channel] = {}
        self._schemas: dict[int, Schema] = {}
        with path.open("rb") as file:
            size = file.seek(0, 2)
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
        # Whether the file has its end.
        self.closed = len(self._data) > FOOTER_BYTES and self._data[-len(MAGIC) :] == MAGIC

    def messages(self) -> Iterator[Stored]:
        """All messages in the order of the file."""
        data = self._data
        if data[: len(MAGIC)] != MAGIC:
            raise BagError(f"{self.path}: not a bag of this package: no MCAP file")
        if self.closed:
            footer = Footer.read(ReadDataStream(BytesIO(data[HEAD.size - FOOTER_BYTES : -len(MAGIC)])))
            (self._read_summary if self._salvage else self._check_sums)(footer)
        offset = len(MAGIC)
        while offset < len(data):
            try:
                for opcode, body, end in records(data, offset):
                    if opcode == Opcode.DATA_END:
                        self._check_end(offset, end)
                        return
                    yield from self._read(opcode, body)
                    offset = end
            except DAMAGE as error:
                if isinstance(error, UnsupportedFormatError) and not self._salvage:
                    raise BagError(f"{self.path}: {error}, {CONVERT}") from None
                offset = self._behind_damage(offset, " ".join(str(error).split()) or type(error).__name__)
        if self.closed and not self._salvage:
            self._refuse("its data have no end")

    def _check_end(self, offset: int, end: int) -> None:
        """Refuse a record of the data's end that is not where the index begins, and a footer that is not the last."""
        footer = self._data.find(FOOTER_HEAD, end)
        if self._salvage:
            behind = footer + FOOTER_BYTES
            if footer >= 0 and behind < len(self._data):
                self.unread.append((behind, len(self._data) - behind, "behind the end of the bag"))
            return
        if not self.closed and 0 <= footer <= len(self._data) - FOOTER_BYTES:
            self._refuse("its last bytes are not the end of an MCAP file")
        if end != offset + DATA_END_BYTES:
            self._refuse("the end of its data is not as long as it should be")

    def _read(self, opcode: int, body: bytes) -> Iterator[Stored]:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.HEADER:
            header = Header.read(stream)
            self.ours = header.library.startswith(LIBRARY)
            if header.profile != PROFILE:
                raise BagError(f"{self.path}: not a bag of this package: no file of ROS 2")
        elif opcode == Opcode.METADATA:
            found = Metadata.read(stream)
            if found.name in (OWN_RECORD, LOST_RECORD) and found.metadata != signed(found.metadata):
                raise McapError("the checksum of the metadata is wrong")
            self.records[found.name] = {key: text for key, text in found.metadata.items() if key != DIGEST}
        elif opcode == Opcode.CHUNK:
            yield from self._messages(unpack(body))
        elif opcode == Opcode.MESSAGE_INDEX:
            stream.read2()
            if len(body) != 6 + stream.read4():
                raise McapError("an index that is not as long as it claims")
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            raise UnsupportedFormatError("its messages are not in chunks; allowed: chunks")
        elif opcode != Opcode.ATTACHMENT:
            raise McapError(f"record {opcode} is not one of a bag")

    def _messages(self, data: bytes) -> Iterator[Stored]:
        """Messages of the content of a chunk."""
        found = []
        for opcode, body, _ in records(data):
            if opcode == Opcode.MESSAGE:
                number, time_ns = MESSAGE.unpack_from(body)
                channel = self._channels.get(number)
                schema = None if channel is None else self._schemas.get(channel.schema_id)
                if channel is None or schema is None:
                    raise McapError(f"a message of an unknown channel, {number}")
                found.append(Stored(channel.topic, schema.name, time_ns, body[MESSAGE.size :]))
            elif not self._defines(opcode, body):
                raise McapError(f"record {opcode} is not one of a chunk")
        yield from found

    def _defines(self, opcode: int, body: bytes) -> bool:
        """Take a schema or a channel; whether it is one."""
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(body)))
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
            self._channels[channel.id] = channel
        return opcode in (Opcode.SCHEMA, Opcode.CHANNEL)

    def _read_summary(self, footer: Footer) -> None:
        """Take schemas and channels from an index, which repeats them: their chunk, the first, may be damaged."""
        with suppress(*DAMAGE):
            offset = footer.summary_start
            summary = memoryview(self._data)[offset : -len(MAGIC) - SUM.size]
            if not offset or (footer.summary_crc and zlib.crc32(summary) != footer.summary_crc):
                return
            for opcode, body, _ in records(self._data, offset):
                self._defines(opcode, body)

    def _behind_damage(self, offset: int, why: str) -> int:
        """Where to go on; the end of the file if nothing follows, which is what a recorder leaves that was killed."""
        following = self._next_chunk(offset + 1)
        if not self._salvage and (self.closed or following is not None):
            self._refuse(f"{why}, at byte {offset}")
        end = len(self._data) if following is None else following
        self.unread.append((offset, end - offset, why))
        return end

    def _next_chunk(self, offset: int) -> int | None:
        """Offset of the next chunk that is whole; for damage that hides where records begin."""
        while (mark := self._data.find(CHUNK_MARK, offset + CHUNK_MARK_AT)) >= 0:
            offset = mark - CHUNK_MARK_AT
            with suppress(*DAMAGE):
                opcode, body, _ = next(records(self._data, offset))
                if opcode == Opcode.CHUNK:
                    unpack(body)
                    return offset
            offset += 1
        return None

    def _check_sums(self, footer: Footer) -> None:
        """Refuse a closed file of which a byte is wrong."""
        data = memoryview(self._data)
        end = footer.summary_start or len(data) - FOOTER_BYTES  # without an index
        if not DATA_END_BYTES <= end <= len(data):
            self._refuse("its end does not say where its index is")
        parts = ((data[end : -len(MAGIC) - SUM.size], footer.summary_crc),
                 (data[: end - DATA_END_BYTES], SUM.unpack_from(data, end - SUM.size)[0]))
        if any(stored and zlib.crc32(part) != stored for part, stored in parts):  # 0: its writer has made none
            self._refuse("a checksum is wrong")

    def _refuse(self, why: str) -> NoReturn:
        raise BagError(f"{self.path}: damaged: {why}; `grasp recover` makes a new bag of what is whole")


def records(data: bytes | mmap.mmap, offset: int = 0) -> Iterator[tuple[int, bytes, int]]:
    """Opcode, content and end of each record from an offset on, as long as it is all there."""
    while offset < len(data):
        begin = end = offset + HEAD.size
        if begin <= len(data):
            end += HEAD.unpack_from(data, offset)[1]
        if end > len(data):
            raise EOFError("the rest of a record is missing")
        if (length := end - begin) > RECORD_BYTES:
            raise UnsupportedFormatError(f"a record of {length} bytes; allowed: at most {RECORD_BYTES}")
        yield data[offset], data[begin:end], end
        offset = end


def unpack(body: bytes) -> bytes:
    """Content of a chunk's record, of the size and with the checksum that it claims, and not too large."""
    chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    allowed = min(RECORD_BYTES, RATIO * (len(chunk.data) + 1000))
    if chunk.uncompressed_size > allowed:
        raise McapError(f"a chunk of {chunk.uncompressed_size} bytes; allowed: at most {allowed}")
    if chunk.compression == "zstd":
        data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(chunk.uncompressed_size + 1)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise UnsupportedFormatError(f"its chunks have the compression {chunk.compression!r}; allowed: zstd, or none")
    if len(data) != chunk.uncompressed_size:
        raise McapError("a chunk is not as long as it claims")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise McapError("the checksum of a chunk is wrong")
    return data

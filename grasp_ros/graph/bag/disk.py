"""The disk under a recorder: a reserve of space, and an output file that takes it when the disk is full."""

from __future__ import annotations

import errno
import os
import resource
from contextlib import suppress
from pathlib import Path

CHUNK_BYTES = 2**18  # a chunk ends at this size, too
RESERVE_BYTES = 4 * CHUNK_BYTES  # kept free for the last chunk, its index, and metadata.yaml
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class Sink:
    """Unbuffered output file, and space on the disk that is given back when it is needed: the disk is full, say."""

    def __init__(self, path: Path, reserve: Path) -> None:
        self.file, self._spare = (os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644) for new in (path, reserve))
        self._reserve, self._reserved, self._size = reserve, 0, 0
        self._full = 0  # the error, one of FULL

    def reserve(self, size: int) -> str:
        """Keep at least this many bytes for the end of the file, in steps; why that cannot be, empty if it can."""
        limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
        if limit != resource.RLIM_INFINITY and limit - self._size < size:
            self._full = self._full or errno.EFBIG
        if size > self._reserved and not self._full:
            try:
                os.posix_fallocate(self._spare, 0, size + RESERVE_BYTES)
                self._reserved = size + RESERVE_BYTES
            except OSError as error:
                self._note(error)
        if not self._full:
            return ""
        return "files may not be larger" if self._full == errno.EFBIG else "no space is left on the disk"

    def _note(self, error: OSError) -> None:
        """Note that the disk is full, or the file as large as it may be; other errors are raised."""
        if self._full or error.errno not in FULL:
            raise error
        self._full = error.errno

    def release(self) -> None:
        """Give the reserve back; does nothing the second time."""
        if self._spare >= 0:
            os.close(self._spare)
            with suppress(OSError):  # somebody has taken its directory away
                self._reserve.unlink()
            self._spare = -1

    def write(self, data: bytes) -> int:
        """Write all of it."""
        self.check()  # the system would fill with zeros what is cut off
        rest = memoryview(data)
        while rest:
            try:
                done = os.write(self.file, rest)
            except OSError as error:
                self._note(error)
                self.release()
                continue
            self._size += done
            rest = rest[done:]
        return len(data)

    def check(self) -> None:
        """Raise an OSError if the file is shorter than what was written."""
        written = self._size  # first: another thread may write meanwhile
        if os.fstat(self.file).st_size < written:
            raise OSError(errno.EIO, "was cut off by another program during the recording")

    def tell(self) -> int:
        """Bytes written so far."""
        return self._size

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Close the file, and give the reserve back; does nothing the second time."""
        self.release()
        if self.file >= 0:
            os.close(self.file)
            self.file = -1

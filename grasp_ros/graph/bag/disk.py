"""The disk under a recorder: a reserve of space, and an output file that takes it when the disk is full."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

CHUNK_BYTES = 2**18  # a chunk ends at this size, too
RESERVE_BYTES = 4 * CHUNK_BYTES  # kept free for the last chunk, its index, and metadata.yaml
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class Sink:
    """Unbuffered output file, and space on the disk that is given back when it is needed: the disk is full, say."""

    def __init__(self, path: Path, reserve: Path) -> None:
        self.file, self._spare = (os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644) for new in (path, reserve))
        self._reserve, self._held, self._size = reserve, 0, 0
        self.full = 0  # the error, one of FULL

    def hold(self, size: int) -> None:
        """Have at least this many bytes in reserve; grows in steps."""
        if size > self._held:
            os.posix_fallocate(self._spare, 0, size + RESERVE_BYTES)
            self._held = size + RESERVE_BYTES

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
                if self.full or error.errno not in FULL:
                    raise
                self.full = error.errno
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

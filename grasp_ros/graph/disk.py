"""The disk under a recorder: a reserve of space, and an output file that takes it when the disk is full."""

from __future__ import annotations

import errno
import os
from pathlib import Path

CHUNK_BYTES = 2**18  # a chunk ends at this size, too
RESERVE_BYTES = 4 * CHUNK_BYTES  # kept free for the last chunk, its index, and metadata.yaml
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class Reserve:
    """Space on the disk that is given back when it is needed."""

    def __init__(self, path: Path) -> None:
        self._path, self._size = path, 0
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)

    def hold(self, size: int) -> None:
        """Have at least this many bytes; grows in steps."""
        if size > self._size:
            os.posix_fallocate(self._file, 0, size + RESERVE_BYTES)
            self._size = size + RESERVE_BYTES

    def release(self) -> None:
        """Give the space back; does nothing the second time."""
        if self._file >= 0:
            os.close(self._file)
            self._path.unlink(missing_ok=True)
            self._file = -1


class Sink:
    """Unbuffered output file that takes the reserve when the disk is full."""

    def __init__(self, path: Path, reserve: Reserve) -> None:
        self.file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._reserve, self._size = reserve, 0
        self.full = 0  # the error, one of FULL

    def write(self, data: bytes) -> int:
        """Write all of it."""
        rest = memoryview(data)
        while rest:
            try:
                done = os.write(self.file, rest)
            except OSError as error:
                if self.full or error.errno not in FULL:
                    raise
                self.full = error.errno
                self._reserve.release()
                continue
            self._size += done
            rest = rest[done:]
        return len(data)

    def tell(self) -> int:
        """Bytes written so far."""
        return self._size

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        """Close the file; does nothing the second time."""
        if self.file >= 0:
            os.close(self.file)
            self.file = -1

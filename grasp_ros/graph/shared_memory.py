"""What Fast DDS leaves in the shared memory of a host when a process is killed.

A segment has a lock file beside it, which its process holds: if it can be had, nobody uses the segment any more. The
small segments of ports are left alone: the next process on that port takes them over, perhaps at this moment.
"""

from __future__ import annotations

import fcntl
import time
from contextlib import suppress
from pathlib import Path

DIRECTORY = Path("/dev/shm")  # of Linux; elsewhere there is nothing to find
YOUNG_SECONDS = 2.0  # a process may be about to lock what it has just made
LOCK, PREFIX, PORT = "_el", "fastrtps_", "fastrtps_port"


def segments() -> set[str]:
    """Names of the segments that are there, used or not."""
    found = {path.name.removesuffix(LOCK) for path in DIRECTORY.glob(f"{PREFIX}*{LOCK}")}
    return {name for name in found if not name.startswith(PORT)}


def remove_unused(names: set[str]) -> list[str]:
    """Remove those of some segments that no process uses; returns their names."""
    removed = []
    for name in sorted(names):
        with suppress(OSError), (DIRECTORY / (name + LOCK)).open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for left in (name, name + LOCK):
                (DIRECTORY / left).unlink(missing_ok=True)
            removed.append(name)
    return removed


def remove_left() -> list[str]:
    """Remove what processes that were killed have left in the past; returns the names of the segments."""
    return remove_unused({name for name in segments() if _age(name) > YOUNG_SECONDS})


def _age(name: str) -> float:
    with suppress(OSError):
        return time.time() - (DIRECTORY / (name + LOCK)).stat().st_mtime
    return 0.0

"""Where the machine code of the kernels is kept, and whether it is there: without a compiler."""

import hashlib
import os
import tempfile
from functools import cache
from pathlib import Path

COMPILING = "compiling the kernels; this happens once after an installation and takes some 20 s"


def sources_digest(room: Path) -> str:
    """A short name of the sources of this room, of the physics whose constants it uses, and of a room that calls it."""
    digest = hashlib.sha256()
    own = Path(__file__).parent
    for source in sorted({*own.glob("*.py"), *(own.parent / "physics").glob("*.py"), *room.glob("*.py")}):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_directory(room: Path) -> Path:
    """A writable directory for the kernels of a room.

    numba looks for changes only in the file of the function that is called, not in those that it calls from other
    files: without the digest an edited kernel would go on running as it was.
    """
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    directory = Path(base) / "grasp_ros" / sources_digest(room)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError:
        directory = Path(tempfile.mkdtemp(prefix="grasp_ros"))
    return directory


def kernels_on_disk() -> bool:
    """Whether the integrator has machine code on disk, so that its first call need not wait for the compiler."""
    uncompiled = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return uncompiled or any(cache_directory(Path(__file__).parent).rglob("*.advance-*.nbi"))

"""Where the machine code of the kernels is kept, and whether it is there: without a compiler."""

import hashlib
import os
import sys
import tempfile
import uuid
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


def _base() -> Path:
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "grasp_ros"


@cache
def cache_directory(room: Path) -> Path:
    """A writable directory for the kernels of a room.

    numba looks for changes only in the file of the function that is called, not in those that it calls from other
    files: without the digest an edited kernel would go on running as it was.
    """
    directory = _base() / sources_digest(room)
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError:
        directory = Path(tempfile.mkdtemp(prefix="grasp_ros"))
    return directory


def kernels_on_disk() -> bool:
    """Whether the integrator has machine code on disk, so that its first call need not wait for the compiler."""
    uncompiled = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return uncompiled or any(cache_directory(Path(__file__).parent).rglob("*.advance-*.nbc"))


def code_file(directory: str, name: str, key: object) -> Path:
    """Where the machine code of a function for some key is kept: types, machine, versions."""
    return Path(directory) / f"{name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"


def write_checked(path: Path, content: bytes) -> None:
    """Write a file with its checksum, whole or not at all: others may read and write it at the same time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    own = path.with_name(f"{path.name}.{uuid.uuid4().hex}")
    try:
        own.write_bytes(hashlib.sha256(content).digest() + content)
        own.replace(path)
    finally:
        own.unlink(missing_ok=True)


def read_checked(path: Path) -> bytes:
    """Content of a file that `write_checked` has written.

    Raises
    ------
    ValueError
        If the checksum is wrong.
    """
    whole, size = path.read_bytes(), hashlib.sha256().digest_size
    if hashlib.sha256(whole[size:]).digest() != whole[:size]:
        raise ValueError(path)
    return whole[size:]


@cache
def say_damaged() -> None:
    """Say, once, that something on disk is of no use."""
    print(f"the kernel cache in {_base()} is damaged; what cannot be loaded is compiled anew", file=sys.stderr)

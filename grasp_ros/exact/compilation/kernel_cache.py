"""Where the machine code of the kernels is kept, and whether it is there: without a compiler."""

import hashlib
import logging
import os
import stat
import sys
import tempfile
import uuid
from contextlib import suppress
from functools import cache
from pathlib import Path

LOG = logging.getLogger("grasp_ros")

PACKAGE = Path(__file__).parents[2]
COMPILED_ROOMS = "physics", "exact", "observe", "methods", "sensitivity"


@cache
def sources_digest() -> str:
    """A short name of the sources of all kernels, and of what they use.

    The name of a file of machine code knows the function that is called, and none of those that it calls: without the
    digest an edited kernel would go on running as it was.
    """
    digest = hashlib.sha256()
    for room in COMPILED_ROOMS:
        for source in sorted((PACKAGE / room).rglob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _base() -> Path:
    home = Path("/", os.path.expanduser("~"))  # "/~" of a user without one, in a container say: it cannot be made
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or home / ".cache"
    return Path(base) / "grasp_ros"


@cache
def cache_directory() -> Path:
    """A directory for the kernels of these sources in this place, which is part of their keys, for this Python.

    Where the one that is asked for cannot be made, it is among temporary files, if no other user can write there.
    """
    name = hashlib.sha256(f"{sources_digest()} {PACKAGE} {sys.implementation.cache_tag}".encode()).hexdigest()[:16]
    try:
        (_base() / name).mkdir(parents=True, exist_ok=True)
    except OSError:
        with suppress(OSError):
            own = Path(tempfile.gettempdir()) / f"grasp_ros_{os.getuid()}"
            own.mkdir(0o700, exist_ok=True)
            found = own.lstat()
            if (found.st_mode, found.st_uid) == (stat.S_IFDIR | 0o700, os.getuid()):
                (own / name).mkdir(exist_ok=True)
                return own / name
    return _base() / name


def kernels_on_disk() -> bool:
    """Whether the integrator has machine code on disk, so that its first call need not wait for the compiler."""
    uncompiled = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return uncompiled or any(cache_directory().glob("*.advance.advance.*.nbc"))


def write_checked(path: Path, content: bytes) -> None:
    """Write a file with its checksum, whole or not at all: others may read and write it at the same time."""
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
def say_compiling() -> None:
    """Say, once, why something takes long."""
    why = "once after an installation for each kind of work, up to a minute"
    if not os.access(_base() / cache_directory().name, os.W_OK):
        why = f"{_base()} cannot be written; NUMBA_CACHE_DIR names a directory that keeps them"
    LOG.warning("compiling kernels: %s", why)


@cache
def say_damaged() -> None:
    """Say, once, that something on disk is of no use."""
    LOG.warning("the kernel cache in %s is damaged; kernels that cannot be loaded are compiled again", _base())

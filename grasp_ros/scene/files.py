"""Users' files, read and written: what the system or a decoder says against one is a refusal that names the path."""

from __future__ import annotations

import hashlib
import os
import shutil
import struct
import uuid
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO, cast
from zipfile import BadZipFile, ZipFile

import numpy as np

from grasp_ros.physics import given
from grasp_ros.physics.errors import Refused

YAML = (".yaml", ".yml")  # endings of scenes
TEXT_BYTES = 2**20  # of a scene or of the metadata of a bag
MOST_BYTES = 2**30  # of all arrays of a file together
TEXT = "U"  # kind of an array of texts
DIGEST = "digest"  # name of the checksum of all other arrays
DAMAGE: tuple[type[Exception], ...] = (  # what decoders raise for files that were damaged at random
    OSError, EOFError, MemoryError, ValueError, TypeError, LookupError, OverflowError, RuntimeError, struct.error,
    zlib.error, BadZipFile, SystemError,  # the last one for a text beyond Unicode
    SyntaxError, TokenError,  # headers of numpy are literals of Python
)


@contextmanager
def reading(path: object, refusal: type[Refused] = Refused) -> Iterator[None]:
    """Refuse a path that the system does not let us read, or a text that is not UTF-8."""
    try:
        yield
    except OSError as error:
        raise refusal(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise refusal(f"{path}: {error}; allowed: UTF-8 text") from None


def read_text(path: Path, refusal: type[Refused] = Refused, most: int = TEXT_BYTES) -> str:
    """All of a text file; it is refused if it is larger than such files are."""
    with reading(path, refusal):
        with path.open("rb") as file:
            content = file.read(most + 1)
        if len(content) > most:
            raise refusal(f"{path}: larger than {most} bytes; allowed: at most that")
        return content.decode("utf-8")


@contextmanager
def writing(path: object, refusal: type[Refused] = Refused) -> Iterator[None]:
    """Refuse a path that the system does not let us write; a reader that has had enough is no refusal."""
    try:
        yield
    except BrokenPipeError:
        raise
    except FileExistsError:  # of a directory that is to be made
        raise refusal(f"{path}: already exists; allowed: a new directory") from None
    except OSError as error:
        raise refusal(f"{path}: cannot be written: {error.strerror or error}") from None


@contextmanager
def new_directory(path: Path, refusal: type[Refused] = Refused) -> Iterator[None]:
    """Make a directory and its first files, which the system may refuse; then there is none."""
    with writing(path, refusal):
        path.mkdir(parents=True)
        try:
            yield
        except OSError:
            shutil.rmtree(path)
            raise


def format_of(path: str | os.PathLike[str], allowed: Collection[str]) -> str:
    """The ending of a file, in small letters: it decides the format."""
    ending = given.path("path", path).suffix.lower()
    if ending not in allowed:
        wrong = f"{ending} is not allowed; allowed: " if ending else "needs an ending, one of "
        raise Refused(f"{path}: {wrong}{', '.join(allowed)}")
    return ending


@contextmanager
def replacing(path: object) -> Iterator[BinaryIO]:
    """A file to write that takes the place of what was there only when it is whole."""
    path = given.path("path", path)
    with writing(path):
        if path.exists() and not path.is_file():  # a device, a pipe; a directory refuses by itself
            with path.open("wb") as file:
                yield file
            return
        with replaced(path) as part, part.open("xb") as file:
            yield file


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """The name of a file or a directory, with the same ending, that takes the place of another when it is whole."""
    there = Path(os.path.realpath(path))  # where a link leads, another disk say
    part = there.with_name(f".{path.stem[:50]}.{uuid.uuid4().hex}.part{path.suffix}")  # at most 255 bytes
    with writing(path):
        try:
            yield part
            part.replace(there)
        finally:
            if part.is_dir():
                shutil.rmtree(part)
            else:
                part.unlink(missing_ok=True)


def opened(target: str | os.PathLike[str] | BinaryIO) -> AbstractContextManager[BinaryIO]:
    """A file to write, see `replacing`, or one that is open already and stays so."""
    return nullcontext(cast(BinaryIO, target)) if hasattr(target, "write") else replacing(target)


@contextmanager
def decoding(path: object, kind: str, refusal: type[Refused] = Refused, also: tuple[type[Exception], ...] = ()
             ) -> Iterator[None]:
    """Refuse a file that is not what it should be, damaged or of another kind.

    `kind` says what it should be, with its article; `also` what its decoder raises besides DAMAGE.
    """
    try:
        yield
    except DAMAGE + also as error:
        if isinstance(error, Refused) and str(error).startswith(str(path)):  # from further in, with all there is to say
            if isinstance(error, refusal):
                raise
            raise refusal(str(error)) from None
        reason = " ".join(str(error).split()) or type(error).__name__
        raise refusal(f"{path}: not {kind}: {reason}") from None


def signed(arrays: Mapping[str, object]) -> dict[str, Any]:
    """The arrays of a file, and their checksum, without which `read_npz` refuses it."""
    content = {name: np.asarray(values) for name, values in arrays.items() if name != DIGEST}
    return {**content, DIGEST: np.array(_digest(content))}


def _digest(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of names, types, shapes and numbers; texts have no width of their own."""
    found = hashlib.sha256()
    for name, values in sorted(arrays.items()):
        text = values.dtype.kind == TEXT
        content = repr(values.tolist()).encode() if text else values.tobytes()
        found.update(repr((name, TEXT if text else values.dtype.str, values.shape, len(content))).encode() + content)
    return found.hexdigest()


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """All arrays of a .npz file, of numbers and texts, whose checksum is that of `signed`.

    What is wrong with it is refused, or raises what DAMAGE lists. Nothing is evaluated but the headers, as literals of
    Python.
    """
    found: dict[str, np.ndarray] = {}
    with ZipFile(path) as members:
        total = sum(member.file_size for member in members.infolist())
    if total > MOST_BYTES:
        raise Refused(f"{total} bytes of numbers; allowed: at most {MOST_BYTES}")
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                found[name] = archive[name]
            except DAMAGE as error:
                raise Refused(f"{name}: {error}") from None
            if not isinstance(found[name], np.ndarray):  # of a member that does not begin as numpy's do
                raise Refused(f"{name}: not a NumPy array")
    said = str(found.pop(DIGEST, ""))
    if said != _digest(found):
        raise Refused(f"{DIGEST}: {said[:64]!r}; allowed: the checksum of these arrays; the file has changed")
    return found

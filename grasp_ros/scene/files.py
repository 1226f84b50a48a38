"""The doors to a user's files: what the system or a decoder says against one is a refusal that names the path."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from zipfile import BadZipFile

from grasp_ros.physics.errors import Refused

DAMAGE: tuple[type[Exception], ...] = (  # what decoders raise for files that were damaged at random
    OSError, EOFError, MemoryError, ValueError, TypeError, LookupError, OverflowError, RuntimeError, struct.error,
    zlib.error, BadZipFile,
)


@contextmanager
def reading(path: object, refusal: type[Refused] = Refused) -> Iterator[None]:
    """Refuse a path that the system does not let us read, or a text that is not UTF-8.

    Raises
    ------
    Refused
        Of the given type; names the path and the reason.
    """
    try:
        yield
    except OSError as error:
        raise refusal(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise refusal(f"{path}: {error}; allowed: UTF-8 text") from None


@contextmanager
def writing(path: object, refusal: type[Refused] = Refused) -> Iterator[None]:
    """Refuse a path that the system does not let us write.

    Raises
    ------
    Refused
        Of the given type; names the path and the reason.
    BrokenPipeError
        As it comes: a reader that has had enough is no refusal.
    """
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise refusal(f"{path}: cannot be written: {error.strerror or error}") from None


@contextmanager
def decoding(path: object, kind: str, refusal: type[Refused] = Refused, also: tuple[type[Exception], ...] = ()
             ) -> Iterator[None]:
    """Refuse a file that is not what it should be, damaged or of another kind.

    Parameters
    ----------
    path : object
    kind : str
        What it should be, with its article.
    refusal : type of Refused
    also : tuple of exception types
        What its decoder raises beside DAMAGE.

    Raises
    ------
    Refused
        Of the given type; names the path and the reason.
    """
    try:
        yield
    except DAMAGE + also as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise refusal(f"{path}: not {kind}: {reason}") from None

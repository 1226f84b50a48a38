"""Strict reading of .npz files: arrays of numbers and texts, each of a type and shape that is known before.

Nothing in the file is evaluated but the headers, as literals of Python. A checksum of all arrays together says that
nobody has changed one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZipFile

import numpy as np

from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import DAMAGE

MOST_BYTES = 2**30  # of all arrays of a file together
TEXT = "U"
DIGEST = "digest"  # name of the checksum of all other arrays


class Field(NamedTuple):
    """What one array of a file must be."""

    dtype: str  # as numpy writes it, or TEXT for one text or a list of texts
    shape: tuple[int | str, ...] = ()  # a name stands for a number that all arrays share


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


def read_npz(path: Path, fields: Mapping[str, Field]) -> dict[str, np.ndarray]:
    """All arrays of a file that holds these fields, the checksum of `signed`, and no others.

    What is wrong with it is refused, or raises what `files.DAMAGE` lists.
    """
    fields = {**fields, DIGEST: Field(TEXT)}
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        if sorted(archive.files) != sorted(fields):
            raise Refused(f"arrays {', '.join(sorted(archive.files))}; allowed: {', '.join(sorted(fields))}")
        total = sum(member.file_size for member in ZipFile(file).infolist())
        if total > MOST_BYTES:
            raise Refused(f"{total} bytes of numbers; allowed: at most {MOST_BYTES}")
        found: dict[str, np.ndarray] = {}
        known: dict[str, int] = {}
        for name, field in fields.items():
            try:
                found[name] = archive[name]
            except DAMAGE as error:
                raise Refused(f"{name}: {error}") from None
            _check(name, found[name], field, known)
    said = str(found.pop(DIGEST))
    if said != _digest(found):
        raise Refused(f"{DIGEST}: {said[:64]!r}; allowed: the checksum of these arrays, which nobody has changed")
    return found


def _check(name: str, values: Any, field: Field, known: dict[str, int]) -> None:
    """Refuse an array of another type or shape; the first one that names a number decides it."""
    if not isinstance(values, np.ndarray):
        raise Refused(f"{name}: no array of numpy")
    wanted = tuple(known.setdefault(size, found) if isinstance(size, str) else size
                   for size, found in zip(field.shape, values.shape, strict=False))
    alike = len(wanted) == len(field.shape) and values.shape == wanted
    if not (alike and field.dtype in (values.dtype.str, values.dtype.kind)):
        raise Refused(f"{name}: {values.dtype} of shape {values.shape} is not allowed; allowed: {field.dtype} of shape"
                      f" {wanted or field.shape}")

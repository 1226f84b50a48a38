"""Strict reading of .npz files: arrays of numbers and texts, each of a type and shape that is known before.

Nothing in the file is evaluated, not even the headers, which numpy takes for Python literals. Sizes are compared with
shapes before anything is unpacked, and the checksum of every array is checked. A checksum of all arrays together says
that nobody has changed one.
"""

from __future__ import annotations

import hashlib
import math
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.errors import Refused

MOST_BYTES = 2**30  # of all arrays of a file together
HEADER_BYTES = 4096
ENCRYPTED = 1  # in the flags of a member
TEXT = "U"
DIGEST = "digest"  # name of the checksum of all other arrays
_HEADER = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '([<|]\w+)', 'fortran_order': (True|False), 'shape': \(([\d, ]*)\), \} *\n", re.S
)


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
    """All arrays of a file.

    Parameters
    ----------
    path : Path
    fields : mapping of str to Field
        Every array by its name; the file must hold these, the checksum of `signed`, and no others.

    Raises
    ------
    Refused, OSError, zipfile.BadZipFile, or what else `files.DAMAGE` lists
        If the file is damaged, or holds anything else.
    """
    fields = {**fields, DIGEST: Field(TEXT)}
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        if members.keys() != fields.keys() or len(archive.infolist()) != len(fields):
            raise Refused(f"arrays {', '.join(sorted(members))}; allowed: {', '.join(sorted(fields))}")
        total = sum(info.file_size for info in members.values())
        if total > MOST_BYTES:
            raise Refused(f"{total} bytes of numbers; allowed: at most {MOST_BYTES}")
        known: dict[str, int] = {}
        found = {name: _read_one(archive, members[name], name, field, known) for name, field in fields.items()}
    said = str(found.pop(DIGEST))
    if said != _digest(found):
        raise Refused(f"{DIGEST}: {said[:64]!r}; allowed: the checksum of these arrays, which nobody has changed")
    return found


def _read_one(archive: zipfile.ZipFile, info: zipfile.ZipInfo, name: str, field: Field, known: dict[str, int]
              ) -> np.ndarray:
    if info.flag_bits & ENCRYPTED or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise Refused(f"{name}: encrypted or packed in another way; allowed: what `grasp simulate` writes")
    with archive.open(info) as member:
        kind, order, shape, begin = _header(member.read(HEADER_BYTES), name)
    if field.dtype not in (kind.str, kind.kind) or not _fits(shape, field.shape, known):
        wanted = ", ".join(str(known.get(str(size), size)) for size in field.shape)
        raise Refused(f"{name}: {kind} of shape {shape} is not allowed; allowed: {field.dtype} of shape ({wanted})")
    if info.file_size != begin + kind.itemsize * math.prod(shape):
        raise Refused(f"{name}: {info.file_size} bytes; allowed: as many as its shape {shape} has")
    content = archive.read(info)[begin:]  # all of it: only then the checksum is compared
    if kind.kind == TEXT:
        size = kind.itemsize
        texts = [content[at : at + size].decode("utf-32-le").rstrip("\0") for at in range(0, len(content), size or 1)]
        return np.array(texts if shape else texts[0] if texts else "")
    return np.frombuffer(content, kind).reshape(shape, order="F" if order else "C")


def _header(content: bytes, name: str) -> tuple[np.dtype, bool, tuple[int, ...], int]:
    """Type, Fortran order, shape, and where the numbers begin."""
    found = _HEADER.match(content)
    if found is None or int.from_bytes(found[0][8:10], "little") != found.end() - 10:
        raise Refused(f"{name}: a header that numpy does not write")
    shape = tuple(int(word) for word in found[3].decode().replace(" ", "").split(",") if word)
    return np.dtype(found[1].decode()), found[2] == b"True", shape, found.end()


def _fits(shape: tuple[int, ...], wanted: tuple[int | str, ...], known: dict[str, int]) -> bool:
    """Whether a shape is the one wanted; the first array that names a number decides it."""
    return len(shape) == len(wanted) and all(
        size == (known.setdefault(want, size) if isinstance(want, str) else want)
        for size, want in zip(shape, wanted, strict=True)
    )

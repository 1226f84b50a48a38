"""Strict reading of .npz files: arrays of numbers and texts.

Nothing in the file is evaluated but the headers, as literals of Python. A checksum of all arrays shows a change.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import DAMAGE

MOST_BYTES = 2**30  # of all arrays of a file together
TEXT = "U"
DIGEST = "digest"  # name of the checksum of all other arrays


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
    """All arrays of a file, whose checksum is that of `signed`.

    What is wrong with it is refused, or raises what `files.DAMAGE` lists.
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

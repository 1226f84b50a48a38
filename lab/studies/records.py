"""Work-precision records, the machine they belong to, and a journal that a study can resume from."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import platform
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from grasp_ros.accuracy.measure import Record
from grasp_ros.exact.compilation.kernel_cache import sources_digest
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.files import decoding, read_text, writing
from grasp_ros.scene.versions import versions

KIND = "the journal of a study"
LARGE = 2**63  # no count of a study is
MOST_BYTES = 2**26  # of a journal
T = TypeVar("T")
PEERS = ("scipy", "scikit-sundae", "heyoka", "diffrax", "jax", "mujoco-mjx", "torch", "torchdiffeq")
ADAPTED = {"SUNDIALS": "scikit-sundae"}  # family of a contender: the package, where the names differ


def describe_machine() -> dict[str, str]:
    """Platform, processor and versions, of peers as far as they are installed."""
    cpu = Path("/proc/cpuinfo")
    model = platform.processor()
    if cpu.exists():
        model = next((line.split(": ")[1] for line in cpu.read_text().splitlines() if "model name" in line), model)
    peers = {}
    for name in PEERS:
        with suppress(metadata.PackageNotFoundError):
            peers[name] = metadata.version(name)
    system = f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors"
    return {"system": system, "cpu": model, **versions(), **peers}


def digest(*parts: object) -> str:
    """A short name for things that must be the same for a measurement to be the same."""
    return hashlib.sha256("\n".join(map(str, parts)).encode()).hexdigest()[:16]


def origin(family: str) -> str:
    """What a family's times depend on: machine, versions, and the sources of what this package adds to it."""
    machine = describe_machine()
    package = machine.get(ADAPTED.get(family, family), "")
    own = sources_digest() if family in ("grasp_ros", "scipy") else ""
    return digest(machine["system"], machine["cpu"], machine["python"], machine["numba"], family, package, own)


class Journal:
    """Records on disk, one JSON line each, written as they are measured.

    The directory is made if it does not exist. Refused: it cannot be made or written, or its journal is damaged.
    """

    def __init__(self, directory: Path) -> None:
        with writing(directory):
            directory.mkdir(parents=True, exist_ok=True)
        self._path = directory / "journal.jsonl"
        self._lines: dict[str, Any] = {}
        if self._path.exists():
            self._read()

    def _read(self) -> None:
        text = read_text(self._path, most=MOST_BYTES)
        whole = text[: text.rfind("\n") + 1]
        if whole != text:  # the last line of a run that was killed
            with writing(self._path):
                self._path.write_text(whole, encoding="utf-8")
        for number, line in enumerate(whole.splitlines(), 1):
            with decoding(self._path, KIND):
                entry = json.loads(line)
                if entry["sum"] != digest(entry["key"], json.dumps(entry["value"])):
                    raise Refused(f"line {number}: its checksum is wrong; delete it, and its part is measured again")
                self._lines[entry["key"]] = entry["value"]

    def get(self, key: str, kind: type[T]) -> T | None:
        """What was noted under a key; None if nothing was. Refused: it is no record of this kind."""
        if key not in self._lines:
            return None
        hints = get_type_hints(kind)
        with decoding(self._path, KIND):
            line = self._lines[key]
            value = {name: _restored(line[name], hint) for name, hint in hints.items()}
            wrong = [name for name, hint in hints.items() if not _fits(value[name], hint)]
            if wrong or len(line) != len(hints):
                raise Refused(f"{', '.join(wrong) or ', '.join(line)}: not what a study writes")
            return kind(**value)

    def kept(self, key: str, kind: type[T], measure: Callable[[], T]) -> T:
        """What was noted under a key, or what is measured now and noted at once."""
        value = self.get(key, kind)
        if value is None:
            self.put(key, value := measure())
        return value

    def put(self, key: str, value: Any) -> None:
        """Note a record at once."""
        content = value._asdict()
        self._lines[key] = content
        entry = {"key": key, "value": content, "sum": digest(key, json.dumps(content))}
        with writing(self._path), self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")


def _restored(value: Any, hint: Any) -> Any:
    """A value from a journal, whose pairs are lists."""
    pair = tuple in (get_origin(hint), *map(get_origin, get_args(hint)))
    return tuple(value) if pair and isinstance(value, list) else value


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value from a journal is of the type that its field says."""
    inner = get_args(hint)
    if get_origin(hint) is tuple:
        return isinstance(value, tuple) and len(value) == len(inner) and all(map(_fits, value, inner))
    if get_origin(hint) is list:
        return isinstance(value, list) and all(_fits(one, inner[0]) for one in value)
    if inner:
        return any(_fits(value, one) for one in inner)
    if isinstance(value, int) and abs(value) >= LARGE:
        return False
    return isinstance(value, (int, float) if hint is float else hint) and (hint is bool or not isinstance(value, bool))


def scene_key(scene: Scene) -> str:
    """A name for the physics of a scene, whatever it is called."""
    return digest(json.dumps(scene.values, sort_keys=True, default=dict))


def write_csv(heads: Sequence[str], rows: Iterable[Sequence[object]], path: Path) -> None:
    """A table with a header; None is an empty cell."""
    with writing(path), path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows(rows)


def write_records(records: Iterable[Record], path: Path) -> None:
    """All records as a table with a header."""
    rows = (["/".join(map(str, cell)) if isinstance(cell, tuple) else cell for cell in record] + [record.missed]
            for record in records)
    write_csv([*Record._fields, "missed"], rows, path)


def by_scene(records: Iterable[Record]) -> dict[str, list[Record]]:
    """Records of each scene."""
    groups: dict[str, list[Record]] = {}
    for record in records:
        groups.setdefault(record.scene, []).append(record)
    return groups


def milliseconds(record: Record) -> str:
    """The time of a record, to print."""
    return f"{1e3 * record.time:.3g} ms"

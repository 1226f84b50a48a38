"""Damaged files against every reader: refused in a sentence, or read as what they are; never a traceback or a hang."""

from __future__ import annotations

import json
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from ruamel.yaml import YAML
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros import simulation
from grasp_ros.accuracy.measure import Record
from grasp_ros.graph import bag
from grasp_ros.graph.bag.reading import recover
from grasp_ros.graph.bag.storage import unpack
from grasp_ros.physics.errors import LONGEST, Refused
from grasp_ros.simulation import Trajectory, simulate
from lab.drills import mutations, recorder
from lab.reference.deadline import Deadline, deadline
from lab.studies.records import Journal, digest

SECONDS = 10.0  # no reader takes longer
MEMORY = 4 * 2**30  # bytes that a reader may ask for beyond what is there
FEW_EVENTS, FEW_WORK = 100, 10_000  # budgets of what is done with an accepted scene
SQUEEZED = [f"{side}_contact.dissipation_s_per_m=1e5" for side in ("left", "right")]
Random = np.random.Generator


class Broken(Exception):  # noqa: N818 - what the study looks for
    """A file was accepted that says something else."""


class Reader(NamedTuple):
    """One kind of file."""

    name: str
    make: Callable[[Random], bytes]
    read: Callable[[Path, bytes], None]  # refuses, or accepts what is right; else raises


def run(directory: Path, *, seed: int, first: int, count: int | None, seconds: float | None) -> int:
    """Try damaged files until the count or the time in s is reached; returns how many broke a reader.

    These are written into the directory. File k is the same in every run with the same seed.
    """
    answers: Counter[tuple[str, str]] = Counter()
    slowest, end = dict.fromkeys(["scene", "result", "bag", "journal"], 0.0), time.monotonic() + (seconds or np.inf)
    with tempfile.TemporaryDirectory() as folder, _limited(MEMORY):
        readers = all_readers(Path(folder))
        for number in tqdm(range(first, first + (count or 10**9)), unit="file", total=count):
            if time.monotonic() > end:
                break
            name, answer, took = attempt(readers, Path(folder), seed, number, directory)
            answers[name, answer] += 1
            slowest[name] = max(slowest[name], took)
    for name, longest in slowest.items():
        kinds = {answer: answers[name, answer] for own, answer in sorted(answers) if own == name}
        words = ", ".join(f"{answer} {times}" for answer, times in kinds.items())
        print(f"{name:<8} {sum(kinds.values()):>7} files: {words}; slowest {longest:.2f} s")
    return sum(times for (_, answer), times in answers.items() if answer not in ("refused", "accepted"))


def attempt(readers: list[Reader], folder: Path, seed: int, number: int, directory: Path) -> tuple[str, str, float]:
    """One file: its reader, what came of it, and the seconds it took."""
    rng = np.random.default_rng([seed, number])
    reader = readers[number % len(readers)]
    content = reader.make(rng)
    begin = time.monotonic()
    try:
        with deadline(SECONDS):
            reader.read(folder, content)
        answer = "accepted"
    except Refused as error:
        good = "\n" not in str(error) and 0 < len(str(error)) < LONGEST + 100
        answer = "refused" if good else "refused in no sentence"
    except Deadline:
        answer = "hangs"
    except Broken as error:
        answer = f"accepted although {error}"
    except Exception as error:  # what the study looks for
        answer = type(error).__name__
    if answer not in ("accepted", "refused"):
        directory.mkdir(parents=True, exist_ok=True)
        (directory / f"{reader.name}_{seed}_{number}").write_bytes(content)
    return reader.name, answer, time.monotonic() - begin


def all_readers(folder: Path) -> list[Reader]:
    """The readers, with valid files to damage."""
    library = [scenes.load(name).to_yaml() for name in scenes.names()]
    simulate(scenes.load("preload", SQUEEZED), max_work=FEW_WORK)  # compiles what is compiled at first use
    case = scenes.load("case_01", ["time.duration_s=0.004"])
    result, recorded = simulate(case, grid=np.linspace(0.0, 0.004, 5)), simulate(case, sampled=True)
    result.save(folder / "valid.npz")
    recorder.write(folder / "valid", recorded)
    whole, packed = (folder / "valid" / "valid.mcap").read_bytes(), (folder / "valid.npz").read_bytes()
    with np.load(folder / "valid.npz") as data:
        content = dict(data)
    return [
        Reader("scene", partial(_make_scene, library), _read_scene),
        Reader("result", partial(_make_result, packed, content), partial(_read_result, result)),
        Reader("bag", partial(_make_bag, whole, (folder / "valid" / "metadata.yaml").read_bytes()),
             partial(_read_bag, recorded, whole)),
        Reader("journal", _make_line, _read_journal),
    ]


@contextmanager
def _limited(more: int) -> Iterator[None]:
    """Let this process have no more bytes of address space than it has and these."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + more, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def _make_scene(library: list[str], rng: Random) -> bytes:
    text = library[int(rng.integers(len(library)))]
    match rng.integers(4):
        case 0:
            return mutations.damage(text.encode(), rng)
        case 1:
            return mutations.number(text, rng).encode()
        case _:
            return mutations.text(text, rng).encode("utf-8", "surrogatepass")


def _read_scene(folder: Path, content: bytes) -> None:
    """What is accepted has the numbers that another reader finds, keeps them when written, and can be used."""
    path = folder / "scene.yaml"
    path.write_bytes(content)
    scene = scenes.load(str(path))
    other = YAML(typ="safe", pure=True).load(content.decode())
    for section, numbers in scene.values.items():
        for key, value in numbers.items():
            said = (other[section] or {})[key]
            if (tuple(said) if isinstance(said, list) else said) != value or isinstance(said, bool):
                raise Broken(f"{section}.{key} is {said!r}, not {value!r}")
    for key in ("title", "watch"):
        said = other.get(key, "")
        if isinstance(said, str) and said != getattr(scene, key):  # 0x1F is a text for us, and a number for others
            raise Broken(f"{key} is {said!r}")
    if other.keys() != scene.values.keys() | {"title", "readings"} | ({"watch"} if "watch" in other else set()):
        raise Broken("its sections are others")
    if scenes.parse(scene.to_yaml(), scene.name, "again") != scene:
        raise Broken("it changes when it is written")
    if scene.warnings and "\n" in "".join(scene.warnings):
        raise Broken("its warnings are no sentences")
    simulate(scene, grid=np.linspace(0.0, scene.duration, 3), max_events=FEW_EVENTS, max_work=FEW_WORK)


def _make_result(packed: bytes, content: dict[str, np.ndarray], rng: Random) -> bytes:
    return mutations.damage(packed, rng) if rng.integers(2) else mutations.arrays(content, rng)


def _read_result(right: Trajectory, folder: Path, content: bytes) -> None:
    """What is accepted is what was there before the damage."""
    path = folder / "result.npz"
    path.write_bytes(content)
    found = simulation.load(path)
    if found.scene != right.scene or any(
        getattr(found, name).tobytes() != getattr(right, name).tobytes() for name in ("t", "state", "event_table")
    ):
        raise Broken("its scene or numbers are others")
    found.energy, found.inputs, found.events  # noqa: B018 - can be computed


def _make_bag(whole: bytes, metadata: bytes, rng: Random) -> bytes:
    """Kind of damage, metadata and storage in one file."""
    match rng.integers(4):
        case 0:
            return b"d" + _joined(metadata, mutations.damage(whole, rng))
        case 1:
            return b"d" + _joined(mutations.damage(metadata, rng), whole)
        case 2:
            return b"c" + _joined(b"", whole[: int(rng.integers(len(whole)))])
        case _:
            return b"r" + _joined(b"", mutations.records(whole, rng, unpack))


def _joined(metadata: bytes, storage: bytes) -> bytes:
    return len(metadata).to_bytes(4, "little") + metadata + storage


def _read_bag(right: Trajectory, whole: bytes, folder: Path, content: bytes) -> None:
    """What is accepted has the states that were recorded, and all of them if it says that it was closed."""
    path, kind, size = folder / "bag", content[:1], int.from_bytes(content[1:5], "little")
    path.mkdir(exist_ok=True)
    metadata, storage = content[5 : 5 + size], content[5 + size :]
    (path / "bag.mcap").write_bytes(storage)
    (path / "metadata.yaml").unlink(missing_ok=True)
    if metadata:
        (path / "metadata.yaml").write_bytes(metadata)
    try:
        found = bag.read(path)
    except Refused:
        if len(content) % 8 == 0:
            _recover(right, kind, path, folder)
        raise
    if kind == b"r":  # with checksums of its own
        if (np.diff(found.tick) <= 0).any() or found.tick[-1] > found.scene.ticks:
            raise Broken("its ticks are none")
        return
    if kind == b"d" and storage != whole and found.lost["end"] == "closed":
        raise Broken("bytes are others")
    if found.state.tobytes() != right.state[: len(found.tick)].tobytes():
        raise Broken("its states are others")


def _recover(right: Trajectory, kind: bytes, path: Path, folder: Path) -> None:
    """What is recovered was recorded."""
    with tempfile.TemporaryDirectory(dir=folder) as new:
        recover(path, Path(new) / "new")
        found = bag.read(Path(new) / "new")
    if kind != b"r" and found.state.tobytes() != right.state[found.tick].tobytes():
        raise Broken("other states are recovered")


def _seal(entry: object) -> str:
    return digest(entry["key"], json.dumps(entry["value"]))  # type: ignore[index]


def _make_line(rng: Random) -> bytes:
    record = Record("s", "f", "m", "k", 1.0, None, 1.0, 1.0, 3, 1.0, None, 2, (1, 2), (3, 4), "done")
    entry = {"key": "a", "value": record._asdict()}
    if rng.integers(2):
        return mutations.line(entry, rng, _seal).encode()
    return mutations.damage((json.dumps({**entry, "sum": _seal(entry)}) + "\n").encode(), rng)


def _read_journal(folder: Path, content: bytes) -> None:
    """What is accepted is a record."""
    (folder / "journal.jsonl").write_bytes(content)
    found = Journal(folder).get("a", Record)
    if found is not None:
        found.missed, found.time, found.good  # noqa: B018 - can be computed
        if not isinstance(found.setting, (int, float)) or not isinstance(found.there_are, tuple):
            raise Broken("its types are others")

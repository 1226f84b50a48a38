"""Opening a bag: its file, its scene, and how that ran, also where another program has written it anew."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from itertools import chain, islice
from pathlib import Path

from grasp_ros import scene as scenes
from grasp_ros.graph import running as runnings
from grasp_ros.graph.recorder import OWN_RECORD
from grasp_ros.graph.rosbag2 import TOPIC, BagError, decode, topics_of
from grasp_ros.graph.running import Running
from grasp_ros.graph.storage import Storage, Stored
from grasp_ros.scene.files import decoding
from grasp_ros.scene.topics import DIAGNOSTICS, RUN, SCENE, Topic

KIND = "a bag of this package"
MOST_AHEAD = 16  # messages, of which two say what the bag holds
ZSTD = b"\x28\xb5\x2f\xfd"
CONVERT = "as `rosbags-convert --src BAG --dst NEW --dst-storage mcap` writes it"


def open_storage(path: Path, salvage: bool = False) -> Storage:
    """The storage file of a bag, or of a directory that holds one."""
    path = Path(path)
    with decoding(path, KIND, BagError):
        files = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
        if files and files[0].is_fifo():
            raise BagError(f"{path}: not {KIND}: a pipe; allowed: a file")
        if len(files) == 1 and files[0].suffix != ".db3":
            return Storage(files[0], salvage)
        if any((path / "bag").glob("*.mcap")):
            raise BagError(f"{path}: the directory of a run; its bag is {path / 'bag'}")
        if any(path.glob("*.db3")) or path.suffix == ".db3":
            raise BagError(f"{path}: its storage is sqlite3; allowed: MCAP, {CONVERT}")
        if any(path.glob("*.mcap.*")):
            raise BagError(f"{path}: its file is compressed as a whole; allowed: chunks, {CONVERT}")
        raise BagError(f"{path}: not {KIND}: holds {len(files)} .mcap files; allowed: one")


def begin(storage: Storage, path: Path) -> Iterator[Stored]:
    """All messages of a bag; from the first one on its records say which scene it holds, and how that ran.

    In a bag that another program has written anew, from ours, the topics `scene` and `run` say it.
    """
    messages = storage.messages()
    first = list(islice(messages, 1))
    if first and OWN_RECORD not in storage.records:
        first += islice(messages, MOST_AHEAD)
        if any(stored.cdr.startswith(ZSTD) for stored in first):
            raise BagError(f"{path}: its messages are compressed one by one; allowed: chunks, {CONVERT}")
        storage.records[OWN_RECORD] = _said(first, path)
    return chain(first, messages)


def _said(first: Collection[Stored], path: Path) -> dict[str, str]:
    """What the topics of a bag say of it, as its own record would."""
    there = {stored.topic.rpartition("/")[2]: stored for stored in first if stored.type == SCENE.type}
    if not {SCENE.name, RUN.name} <= there.keys():
        missing = " and ".join(topic.name for topic in (SCENE, RUN) if topic.name not in there)
        raise BagError(f"{path}: not {KIND}: nothing at its beginning on {missing}; allowed: all topics of a graph")
    found = {topic.name: decode(topic, there[topic.name].cdr).data for topic in (SCENE, RUN)}
    scene, root = scenes.parse(found["scene"], path.name, str(path)), there[SCENE.name].topic.removesuffix(SCENE.name)
    moved = [topic for topic in topics_of(scene) if topic != DIAGNOSTICS]
    return {**found, **{f"{TOPIC}{topic.name}": f"{root}{topic.name.lstrip('/')}" for topic in moved}}


def scene_of(storage: Storage, path: Path) -> scenes.Scene:
    """The scene of a bag, once its first record has been read."""
    if OWN_RECORD not in storage.records:
        raise BagError(f"{path}: not {KIND}: its scene is missing")
    return scenes.parse(storage.records[OWN_RECORD]["scene"], path.name, str(path))


def running_of(storage: Storage) -> Running:
    """How the plant of a bag ran, once its first record has been read."""
    return runnings.parse(storage.records[OWN_RECORD]["run"])


def held_of(storage: Storage, scene: scenes.Scene) -> Collection[Topic]:
    """Topics whose messages are as they came, not one for each tick: those of commands in a free run."""
    return () if running_of(storage).lockstep else scene.controllers.values()

"""Reading bags, rosbag2 directories with MCAP storage, stamped in simulated time: as arrays, or into a new bag."""

from __future__ import annotations

import os
import re
from array import array
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.graph.bag import BagError, EmptyBagError
from grasp_ros.graph.bag.opening import UNREADABLE, Opened, decoding_bag
from grasp_ros.graph.bag.recorder import LEFT_OUT, LOST_RECORD, METADATA_DIGEST, SOURCE, Recorder, checksum
from grasp_ros.graph.bag.recording import Recording, acted_from
from grasp_ros.graph.bag.storage import Storage, Stored
from grasp_ros.physics.errors import printable
from grasp_ros.physics.layout import OBJECT
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN
from grasp_ros.scene import topics
from grasp_ros.scene.files import read_text
from grasp_ros.scene.topics import CLOCK, RUN, SCENE, Topic

MOST_REASONS = 20  # that are listed
TICK = re.compile(r"\b(tick \d+: |\d+ ns; )")  # which is noted beside the reason


def read(path: str | os.PathLike[str]) -> Recording:
    """Read a bag that the monitor recorded, also one that was not closed.

    Raises
    ------
    BagError
        If the path is not such a bag, or if it is damaged.
    """
    opened = Opened(path)
    with decoding_bag(opened.path):
        scene = opened.scene
        counts = Counter(dict.fromkeys(opened.names, 0))
        stamps, rows = array("q"), array("d")
        for time_ns, tick, others in opened.ticks(opened.topics):
            counts.update([*tick, *(topic for topic, _ in others)])
            try:
                for topic, stored in others:
                    opened.take(topic, stored)
                row = opened.row(time_ns, tick) if tick else []
            except UNREADABLE as error:
                why = error or type(error).__name__
                raise BagError(f"{opened.path}: {why}; `grasp recover` leaves it out") from None
            if topics.JOINT_STATES in tick:
                stamps.extend((time_ns, opened.stamp_ns))
                rows.extend(row)
        if not stamps:
            raise EmptyBagError(f"{opened.path}: holds no tick")
        _check_metadata(opened.path, opened.storage)
        times = np.array(stamps).reshape(-1, 2)
        ticks = times[:, 0] // scene.period_ns
        ends = np.cumsum([template.count for template in opened.topics.values()])[:-1]
        parts = dict(zip(opened.topics, np.split(np.array(rows).reshape(len(times), -1), ends, axis=1), strict=True))
        state, effort, command = _motion(scene, ticks, parts)
        if 1.0 in parts[topics.LYAPUNOV][:, topics.LYAPUNOV_NAMES.index("closed")]:  # the monitor had heard of all laws
            laws = (topics.CHANGES[side] for side, topic in topics.COMMANDS.items() if topic in scene.topics)
            opened.unheard.update(topic.name for topic in laws if not counts[topic])
        timing = zip(opened.quality, np.array(opened.timing).T, strict=True) if opened.timing else ()
        return Recording(
            path=opened.path, scene=scene, versions=opened.versions, running=opened.running, tick=ticks, state=state,
            effort=effort, command=command, outputs={own.topic.name: parts[own.topic][:, 0] for own in scene.outputs},
            lyapunov=parts[topics.LYAPUNOV], changes=opened.changes, starts=ticks[times[:, 1] == 0],
            counts={topic.name: count for topic, count in counts.items()}, unheard=dict(+opened.unheard),
            timing=dict(timing), lost=_lost(opened.storage),
            held={side: np.array(opened.held[topic]) for side, topic in topics.COMMANDS.items()
                  if topic in opened.held},
        )


def _motion(scene: scenes.Scene, ticks: np.ndarray, parts: Mapping[Topic, Array]) -> tuple[Array, Array, Array]:
    """State, effort and command of a `Recording` from the numbers (n, ...) of each topic."""
    state, effort, command = np.full((len(ticks), 6), np.nan), *np.zeros((2, len(ticks), 2))
    of_bodies = parts[topics.JOINT_STATES].reshape(len(ticks), 3, -1)
    for body, numbers in zip(scene.system.present, of_bodies.T, strict=True):
        state[:, COLUMN[body]], state[:, COLUMN[body] + 1] = numbers[:2]
        if body != OBJECT:
            effort[:, body] = numbers[2]
    for side, topic in zip(scene.system.laws, scene.controllers.values(), strict=True):
        command[:, side] = parts[topic][:, 0] if topic in parts else acted_from(ticks, effort[:, side])
    return state, effort, command


def _check_metadata(path: Path, storage: Storage) -> None:
    """Refuse a metadata.yaml that is not the one that was written when the bag was closed."""
    file = path / "metadata.yaml"
    there = storage.closed and LOST_RECORD in storage.records and path.is_dir() and file.exists()
    if there and not file.is_file():
        raise BagError(f"{file}: not a file")
    if there and checksum(read_text(file, BagError)) != storage.records[LOST_RECORD][METADATA_DIGEST]:
        raise BagError(f"{file}: was changed; `grasp recover` makes a new bag with metadata of its own")


def _lost(storage: Storage) -> dict[str, str]:
    """How the recording ended and what is missing, as the bag says it; without its word, what the reader has found."""
    if not storage.closed:
        left_out = sum(size for _, size, _ in storage.unread)
        return {"end": f"not closed; {left_out} bytes behind the last whole chunk are left out"}
    anew = {"end": "written anew by another program, which does not say what was lost"}
    return {key: word for key, word in storage.records.get(LOST_RECORD, anew).items() if key != METADATA_DIGEST}


class Recovery(NamedTuple):
    """What has been saved, and what has not."""

    ticks: int
    left_out: list[str]  # what, and why
    missing: str  # of the ticks up to the last one, "3, 7-9", say; empty if all are there


def recover(path: str | os.PathLike[str], new: str | os.PathLike[str]) -> Recovery:
    """Write all complete ticks of a bag into a new directory; the old one, a directory or a file, is only read.

    Raises
    ------
    BagError
        If nothing can be saved, or if the new bag cannot be written.
    """
    opened, refused, written, recorder = Opened(path, salvage=True), dict[str, list[int]](), 0, None
    scene, wanted, beside = opened.scene, {*opened.topics} - {CLOCK}, list[tuple[Topic, Stored]]()

    def note(error: Exception, tick: int) -> None:
        """Note a tick by the reason for which something of it is refused."""
        why = TICK.sub("", " ".join(str(error).split()))
        refused.setdefault(why if len(refused) < MOST_REASONS else "other reasons", []).append(tick)

    try:
        for time_ns, tick, others in opened.ticks(wanted):
            number = time_ns // scene.period_ns
            beside += others  # numbers that were announced at a tick that is lost act at those that follow
            if not tick:
                continue
            try:
                if missing := sorted(topic.name for topic in wanted - tick.keys()):
                    raise BagError(f"no message on {', '.join(missing)}")
                opened.row(time_ns, tick)
            except UNREADABLE as error:
                note(error, number)
                continue
            recorder = recorder or Recorder(Path(new), scene, opened.versions, opened.names, opened.running)
            recorder.write_tick(time_ns, tick.items(), opened.stamp_ns)
            written += 1
            for topic, stored in beside:
                try:
                    opened.take(topic, stored)
                except UNREADABLE as error:
                    note(error, stored.time_ns // scene.period_ns)
                    continue
                if topic not in (SCENE, RUN, CLOCK):  # which the recorder writes itself
                    recorder.write(topic, stored.cdr)
            beside.clear()
    finally:
        left_out = [f"{size} bytes from byte {offset} on: {why}" for offset, size, why in opened.storage.unread]
        left_out += [f"{why}: {count}" for why, count in opened.left_out.items()]
        left_out += [f"parts of {len(at)} ticks, the first {at[0]}: {why}" for why, at in refused.items()]
        left_out = [*map(printable, left_out)]  # names of topics, say, which may be anything
        if recorder is not None:
            source, lost = printable(str(opened.path)), "; ".join(left_out) or "none"
            recorder.close({SOURCE: source, LEFT_OUT: lost})
    if recorder is None:
        reasons = (*(why for _, _, why in opened.storage.unread), *refused, "it holds no tick")
        raise BagError(f"{opened.path}: nothing can be recovered: {reasons[0]}")
    return Recovery(written, left_out, recorder.gaps)

"""`grasp recover`: a new bag, with index and metadata, from one that was cut off or damaged."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

from grasp_ros.graph.opening import Opened, decoding_bag
from grasp_ros.graph.recorder import Recorder
from grasp_ros.graph.rosbag2 import BagError, decode
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.scene.topics import CHANGES, CLOCK, LYAPUNOV, LYAPUNOV_NAMES, RUN, SCENE, Topic


class Recovery(NamedTuple):
    """What has been saved, and what has not."""

    ticks: int
    left_out: list[tuple[int, int, str]]  # offset, size in bytes, and reason


def recover(path: str | os.PathLike[str], new: str | os.PathLike[str]) -> Recovery:
    """Write all complete ticks of a bag into a new directory; the old one, a directory or a file, is only read.

    Raises
    ------
    BagError
        If nothing can be saved, or if the new bag cannot be written.
    """
    opened = Opened(path, salvage=True)
    path, scene, left_out = opened.path, opened.scene, opened.storage.left_out
    ticks = _ticks(opened)
    begin = next(ticks, None)
    if begin is None:
        raise BagError(f"{path}: nothing can be recovered: it holds no complete tick")
    recorder, written = Recorder(Path(new), scene, opened.versions, opened.names, opened.running), 0
    try:
        for time_ns, tick, beside in chain([begin], ticks):
            tick[LYAPUNOV] = own = tick.pop(LYAPUNOV)  # the last one
            if (stamp_ns := _stamp_ns(path, own)) > scene.ticks * scene.period_ns:
                continue
            recorder.write_tick(time_ns, tick.items(), stamp_ns)
            for topic, cdr in beside:
                recorder.write(topic, cdr)
            written += 1
    finally:
        places = "; ".join(f"{size} at {offset}: {why}" for offset, size, why in left_out)
        recorder.close({"recovered from": str(path), "bytes that were left out": places or "none"})
    return Recovery(written, left_out)


def _stamp_ns(path: Path, cdr: bytes) -> int:
    """Time in ns of what the monitor had computed, if it is that."""
    with decoding_bag(path):
        own = decode(LYAPUNOV, cdr)
    if len(own.position) != len(LYAPUNOV_NAMES):
        raise BagError(f"{path}: {LYAPUNOV.name}: {len(own.position)} numbers; allowed: {len(LYAPUNOV_NAMES)}")
    return int(own.header.stamp.sec) * NANOSECONDS + int(own.header.stamp.nanosec)


def _ticks(opened: Opened) -> Iterator[tuple[int, dict[Topic, bytes], list[tuple[Topic, bytes]]]]:
    """Time, messages by topic, and what lies beside them, of every tick of which all are there, in ascending order."""
    known = {(name, topic.type): topic for topic, name in opened.names.items()}
    wanted = {topic for topic in opened.scene.topics if topic not in opened.held}
    before = -1
    for time_ns, group in groupby(opened.messages, lambda stored: stored.time_ns):
        tick: dict[Topic, bytes] = {}
        beside = []
        for stored in group:
            topic = known.get(stored[:2], SCENE)
            if topic in wanted or topic in CHANGES.values():
                tick[topic] = stored.cdr
            elif topic not in (SCENE, RUN, CLOCK):  # these three the recorder writes itself
                beside.append((topic, stored.cdr))
        if time_ns % opened.scene.period_ns == 0 and before < time_ns and tick.keys() >= wanted:
            before = time_ns
            yield time_ns, tick, beside

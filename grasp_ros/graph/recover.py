"""`grasp recover`: a new bag, with index and metadata, from one that was cut off or damaged."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

from grasp_ros.graph.bag import MOST_NS, columns_of, stamp_of
from grasp_ros.graph.opening import Opened, decoding_bag
from grasp_ros.graph.recorder import Recorder
from grasp_ros.graph.rosbag2 import BagError
from grasp_ros.scene.topics import CHANGES, CLOCK, LYAPUNOV, RUN, SCENE, Topic


class Recovery(NamedTuple):
    """What has been saved, and what has not."""

    ticks: int
    left_out: list[str]  # what, and why


def recover(path: str | os.PathLike[str], new: str | os.PathLike[str]) -> Recovery:
    """Write all complete ticks of a bag into a new directory; the old one, a directory or a file, is only read.

    Raises
    ------
    BagError
        If nothing can be saved, or if the new bag cannot be written.
    """
    opened = Opened(path, salvage=True)
    path, refused = opened.path, list[str]()
    ticks = _ticks(opened, refused)
    begin = next(ticks, None)
    if begin is None:
        raise BagError(f"{path}: nothing can be recovered: it holds no complete tick")
    recorder, written = Recorder(Path(new), opened.scene, opened.versions, opened.names, opened.running), 0
    try:
        for time_ns, stamp_ns, tick, beside in chain([begin], ticks):
            tick[LYAPUNOV] = tick.pop(LYAPUNOV)  # the last one
            recorder.write_tick(time_ns, tick.items(), stamp_ns)
            for topic, cdr in beside:
                recorder.write(topic, cdr)
            written += 1
    finally:
        left_out = [f"{size} bytes from byte {offset} on: {why}" for offset, size, why in opened.storage.left_out]
        left_out += refused
        recorder.close({"recovered from": str(path), "what was left out": "; ".join(left_out) or "none"})
    return Recovery(written, left_out)


def _ticks(
    opened: Opened, refused: list[str]
) -> Iterator[tuple[int, int, dict[Topic, bytes], list[tuple[Topic, bytes]]]]:
    """Time and stamp in ns, messages by topic, and what lies beside them, of every complete tick, in ascending order.

    Those that no reader would take are left out, and named.
    """
    known = {(name, topic.type): topic for topic, name in opened.names.items()}
    columns, scene = columns_of(opened), opened.scene
    wanted = columns.keys() - {CLOCK}
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
        if time_ns % scene.period_ns or not before < time_ns <= MOST_NS or not tick.keys() >= wanted:
            continue
        try:
            with decoding_bag(opened.path):
                stamp_ns = stamp_of(columns, tick)
                if stamp_ns % scene.period_ns or stamp_ns > min(time_ns, scene.ticks * scene.period_ns):
                    raise BagError(f"a stamp of {stamp_ns} ns")
        except BagError as error:
            refused.append(f"tick {time_ns // scene.period_ns}: {error}")
            continue
        before = time_ns
        yield time_ns, stamp_ns, tick, beside

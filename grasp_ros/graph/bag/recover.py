"""`grasp recover`: a new bag, with index and metadata, from one that was cut off or damaged."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

from grasp_ros.graph.bag import BagError
from grasp_ros.graph.bag.opening import UNREADABLE, Opened
from grasp_ros.graph.bag.reading import BagReader
from grasp_ros.graph.bag.recorder import LEFT_OUT, SOURCE, Recorder
from grasp_ros.graph.bag.storage import Stored
from grasp_ros.physics.errors import printable
from grasp_ros.scene.topics import CLOCK, RUN, SCENE, Topic

MOST_REASONS = 20  # that are listed
TICK = re.compile(r"\b(tick \d+: |\d+ ns; )")  # which is noted beside the reason


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
    opened, refused, written = Opened(path, salvage=True), dict[str, list[int]](), 0
    scene, reader, recorder = opened.scene, BagReader(opened), None
    wanted, beside = {*reader.topics} - {CLOCK}, list[tuple[Topic, Stored]]()

    def note(error: Exception, tick: int) -> None:
        """Note a tick by the reason for which something of it is refused."""
        why = TICK.sub("", " ".join(str(error).split()))
        refused.setdefault(why if len(refused) < MOST_REASONS else "other reasons", []).append(tick)

    try:
        for time_ns, tick, others in reader.ticks(wanted):
            number = time_ns // scene.period_ns
            beside += others  # numbers that were announced at a tick that is lost act at those that follow
            if not tick:
                continue
            try:
                if missing := sorted(topic.name for topic in wanted - tick.keys()):
                    raise BagError(f"no message on {', '.join(missing)}")
                reader.row(time_ns, tick)
            except UNREADABLE as error:
                note(error, number)
                continue
            recorder = recorder or Recorder(Path(new), scene, opened.versions, opened.names, opened.running)
            recorder.write_tick(time_ns, tick.items(), reader.stamp_ns)
            written += 1
            for topic, stored in beside:
                try:
                    reader.take(topic, stored)
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

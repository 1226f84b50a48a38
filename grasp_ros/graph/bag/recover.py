"""`grasp recover`: a new bag, with index and metadata, from one that was cut off or damaged."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from grasp_ros.graph.bag import BagError
from grasp_ros.graph.bag.opening import UNREADABLE, Opened
from grasp_ros.graph.bag.reading import Changes, Ticks, ticks_of
from grasp_ros.graph.bag.recorder import Recorder
from grasp_ros.scene.topics import CHANGES, CLOCK, LYAPUNOV, RUN, SCENE, Topic

MOST_REASONS = 20  # that are told apart
TICK = re.compile(r"\btick \d+: ")  # which is noted beside the reason


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
    opened = Opened(path, salvage=True)
    path, refused = opened.path, dict[str, list[int]]()
    ticks = _ticks(opened, refused)
    begin = next(ticks, None)
    if begin is None:
        reasons = (*(why for _, _, why in opened.storage.left_out), *refused, "it holds no tick")
        raise BagError(f"{path}: nothing can be recovered: {reasons[0]}")
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
        left_out += [f"parts of {len(at)} ticks, the first {at[0]}: {why}" for why, at in refused.items()]
        recorder.close({"recovered from": str(path), "what was left out": "; ".join(left_out) or "none"})
    return Recovery(written, left_out, recorder.gaps)


@contextmanager
def _noting(refused: dict[str, list[int]], tick: int) -> Iterator[None]:
    """Note a tick by the reason for which something of it is refused."""
    try:
        yield
    except UNREADABLE as error:
        why = TICK.sub("", " ".join(str(error).split()))
        refused.setdefault(why if len(refused) < MOST_REASONS else "other reasons", []).append(tick)


def _ticks(
    opened: Opened, refused: dict[str, list[int]]
) -> Iterator[tuple[int, int, dict[Topic, bytes], list[tuple[Topic, bytes]]]]:
    """Time and stamp in ns, messages by topic, and what lies beside them, of every complete tick, in ascending order.

    Those that no reader would take are left out, and noted.
    """
    reader, scene, changes = Ticks(opened), opened.scene, Changes()
    wanted = {*reader.topics} - {CLOCK}
    for time_ns, tick, others in ticks_of(opened, wanted):
        number, beside = time_ns // scene.period_ns, []
        if not tick:
            continue
        with _noting(refused, number):
            if missing := sorted(topic.name for topic in wanted - tick.keys()):
                raise BagError(f"no message on {', '.join(missing)}")
            reader.row(time_ns, tick)
            for topic, stored in others:
                if topic in CHANGES.values():
                    with _noting(refused, number):
                        changes.add(topic, scene, stored)
                        tick[topic] = stored.cdr
                elif topic not in (SCENE, RUN, CLOCK):  # these three the recorder writes itself
                    beside.append((topic, stored.cdr))
            yield time_ns, reader.stamp_ns, tick, beside

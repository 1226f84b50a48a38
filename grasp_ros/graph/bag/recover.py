"""`grasp recover`: a new bag, with index and metadata, from one that was cut off or damaged."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

from grasp_ros.graph.bag import BagError
from grasp_ros.graph.bag.opening import UNREADABLE, Opened
from grasp_ros.graph.bag.reading import MOST_NS, NOT_NEXT, Changes, columns_of, follows, stamp_of
from grasp_ros.graph.bag.recorder import Recorder
from grasp_ros.scene.topics import CHANGES, CLOCK, LYAPUNOV, RUN, SCENE, Topic

MOST_REASONS = 20  # that are told apart


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
        why = " ".join(str(error).split())
        refused.setdefault(why if len(refused) < MOST_REASONS else "other reasons", []).append(tick)


def _ticks(
    opened: Opened, refused: dict[str, list[int]]
) -> Iterator[tuple[int, int, dict[Topic, bytes], list[tuple[Topic, bytes]]]]:
    """Time and stamp in ns, messages by topic, and what lies beside them, of every complete tick, in ascending order.

    Those that no reader would take are left out, and noted.
    """
    columns, scene, changes = columns_of(opened), opened.scene, Changes()
    period_ns, wanted = scene.period_ns, columns.keys() - {CLOCK}
    before, at = -1, (0, 0)  # time of the last tick; the same and its stamp, from which the first one counts
    for time_ns, group in groupby(opened.messages, lambda message: message[1].time_ns):
        tick: dict[Topic, bytes] = {}
        beside, number, stamp_ns = [], time_ns // period_ns, -1
        for topic, stored in group:
            if topic in wanted:
                tick[topic] = stored.cdr
            elif topic in CHANGES.values():
                with _noting(refused, number):
                    changes.add(topic, scene, stored)
                    tick[topic] = stored.cdr
            elif topic not in (SCENE, RUN, CLOCK):  # these three the recorder writes itself
                beside.append((topic, stored.cdr))
        if time_ns % period_ns or not before < time_ns <= MOST_NS:
            continue
        with _noting(refused, number):
            if missing := sorted(topic.name for topic in wanted - tick.keys()):
                raise BagError(f"no message on {', '.join(missing)}")
            found = stamp_of(columns, tick)
            none = found % period_ns or not 0 <= found <= scene.ticks * period_ns
            if none or not follows(found - at[1], time_ns - at[0], period_ns):
                raise BagError(NOT_NEXT)
            stamp_ns = found
        if stamp_ns >= 0:
            before, at = time_ns, (time_ns, stamp_ns)
            yield time_ns, stamp_ns, tick, beside

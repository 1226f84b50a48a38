"""One drill: a graph at work, an accident, the wait for what comes of it, and the verdict on that."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import numpy as np

from grasp_ros.graph import bag
from grasp_ros.graph.bag.verify import verify
from grasp_ros.scene.topics import JOINT_STATES, LYAPUNOV_NAMES, WINDOW, Topic
from lab.drills.faults.output import NO_NEWS, SENTENCE, plain
from lab.drills.faults.stage import NODES, Failed, Stage

TERMINALS = (*NODES, "run")  # last words of the names of what a user has in a terminal
DEADLINE_SECONDS = 30.0
STILL_SECONDS = 15.0  # without a tick and without a word: it hangs; `grasp run` itself waits 10 s for its nodes to end
GO_ON_TICKS, GO_ON_SECONDS = WINDOW + 100, 4.0  # after the accident, when who was told to end has, and been missed
LOOK_SECONDS = 0.1
SUSPENDED = "this node was suspended"
CLOSE_SECONDS = 15.0  # for the end after a Ctrl-C, or behind `grasp run`
NOTICE_SECONDS = 2.0  # the promise
SLACK_SECONDS = 1.0  # for a machine on which two drills run at a time
LOST_SECONDS = 0.2  # of recording


class Verdict(Enum):
    """How a drill ended; the first that holds."""

    SKIPPED = "skipped"
    TRACEBACK = "traceback"
    LEFT = "left processes"
    HUNG = "hung"
    LOST = "lost data"
    WRONG = "wrong result"
    SILENT = "no message"
    NAME = "names another process"
    LATE = "noticed late"
    SURVIVED = "survived"
    SENTENCE = "ended with a message"

    @property
    def passes(self) -> bool:
        """Whether this is as it should be."""
        return self in (Verdict.SURVIVED, Verdict.SENTENCE, Verdict.SKIPPED)


@dataclass
class Evidence:
    """What is known of a drill once it is over."""

    said: str = ""  # what a user sees: the last sentence of a run that ended, the first of one that goes on; or none
    culprit: str = ""  # pattern of what that has to name, see `Drill`
    noticed: float = math.nan  # s, from the accident to the first sentence or report; NaN: never
    exits: dict[str, int] = field(default_factory=dict)  # exit statuses by process
    lost: float = 0.0  # s of wall time before the accident from which nothing is in the bag
    went_on: bool = False
    hung: bool = False
    left: int = 0  # processes that are still there
    shared: int = 0  # files in /dev/shm that are still there
    traceback: str = ""  # its last line
    wrong: str = ""  # why what the bag holds is not the run
    mute: bool = False  # nobody could read a sentence: the terminal is gone
    asked: bool = False  # a user has ended the run: that takes as long as it takes to close it
    nothing_to_keep: bool = False  # the bag itself was taken away, or there was none
    skipped: str = ""  # why the drill cannot be played here

    @property
    def verdict(self) -> Verdict:
        """The first that holds."""
        nothing_to_say = self.mute or (self.went_on and re.match(self.culprit, "") is not None)
        silent = not self.said and not nothing_to_say
        found = {
            Verdict.SKIPPED: bool(self.skipped), Verdict.TRACEBACK: bool(self.traceback),
            Verdict.LEFT: self.left > 0, Verdict.HUNG: self.hung,
            Verdict.LOST: not self.nothing_to_keep and self.lost > LOST_SECONDS,
            Verdict.WRONG: bool(self.wrong), Verdict.SILENT: silent,
            Verdict.NAME: not self.mute and not re.search(self.culprit, self.said), Verdict.SURVIVED: self.went_on,
            Verdict.LATE: not (self.mute or self.asked) and not self.noticed <= NOTICE_SECONDS + SLACK_SECONDS,
        }
        return next((verdict for verdict, holds in found.items() if holds), Verdict.SENTENCE)


class Drill(NamedTuple):
    """A fault and how it is caused."""

    name: str  # as `--only` takes it
    group: str  # for the reader, as the next
    fault: str
    start: Callable[[Stage], object]  # starts the graph
    strike: Callable[[Stage], object]  # causes the accident once the graph is at work; may take its time
    mute: bool = False  # nobody can read what is said from then on
    nothing_to_keep: bool = False  # the accident takes the bag away
    by_itself: bool = False  # the accident happens by itself, and so counts from when it is noticed
    settle: bool = True  # the graph is at work before the accident
    seen: Topic = JOINT_STATES  # by which ticks are counted, see `Stage`
    asked: bool = False  # no accident, but how a user ends a run
    quick: bool = False  # `--quick` plays it
    culprit: str = ""  # pattern of who or what was hit, or did it, in the message; empty: nobody, it is said there why
    play: Callable[[Stage], Evidence] | None = None  # in place of the common course of a drill


def node(name: str) -> str:
    """Pattern of a message that blames a node: others name it in full, or it speaks of itself, and of no other one."""
    return rf"/{name}\b|\b{name}: (was|this node was) "


class Skipped(Exception):  # noqa: N818 - no error
    """A drill that cannot be played here, and why."""


def play(drill: Drill, stage: Stage) -> Evidence:
    """Play a drill to its end; returns what is known then."""
    if drill.play is not None:
        return replace(drill.play(stage), culprit=drill.culprit)
    drill.start(stage)
    if drill.settle:
        stage.settle()
    shared, before = stage.shared_memory(), stage.published
    called = time.monotonic()
    drill.strike(stage)
    stage.happens(called)
    begin = stage.accident
    struck, reached = time.monotonic(), max(stage.published, before)
    stage.wait(lambda: _over(stage) or _goes_on(stage, struck, reached) or _stands(stage, struck), DEADLINE_SECONDS)
    over = _over(stage)
    went_on = not over and _goes_on(stage, struck, reached)
    hung = not over and not went_on
    asked = time.monotonic()
    left = _close(stage, wait=not (went_on or hung))
    evidence = Evidence(culprit=drill.culprit, went_on=went_on, hung=hung, left=len(left), mute=drill.mute,
                        asked=drill.asked, nothing_to_keep=drill.nothing_to_keep)
    _read_words(evidence, stage, called, asked if went_on or hung else math.inf)
    evidence.noticed = max(evidence.noticed - (begin - called), 0.0)
    evidence.exits = {name: process.returncode for name, process in stage.started.items()
                      if name.split()[-1] in TERMINALS and process.returncode is not None}
    evidence.shared = sum(Path(name).exists() for name in shared - stage.shared_memory())
    if drill.by_itself:  # counts from when it was noticed, and what had been recorded by then
        begin = -math.inf
        if math.isfinite(evidence.noticed):
            evidence.noticed = 0.0
    _read_bag(evidence, stage, struck if went_on else begin)
    return evidence


def _over(stage: Stage) -> bool:
    """Whether `grasp run` has ended, or in four terminals plant and monitor have."""
    awaited = [name for name in ("grasp run", "plant", "monitor") if name in stage.started]
    return all(stage.started[name].poll() is not None for name in awaited)


def _goes_on(stage: Stage, struck: float, reached: int) -> bool:
    return time.monotonic() > struck + GO_ON_SECONDS and stage.published > reached + GO_ON_TICKS


def _stands(stage: Stage, struck: float) -> bool:
    """Whether nothing has happened for a while."""
    last = max(struck, float(stage.times[max(stage.published, 0)]),
               *(line.when for line in stage.output.lines[-1:] if not NO_NEWS.match(line.text)))
    return time.monotonic() > last + STILL_SECONDS


def _close(stage: Stage, wait: bool) -> list[int]:
    """End what is left as a user would; returns the processes that outlive it.

    What was started by `grasp run` has to end by itself when that has ended; whoever sits in a terminal ends what is
    in it with a Ctrl-C.
    """
    for name, process in stage.started.items():
        if process.poll() is None and not (wait and name == "grasp run"):
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGINT if name.split()[-1] in TERMINALS else signal.SIGTERM)
    end = time.monotonic() + CLOSE_SECONDS
    stage.wait(lambda: all(process.poll() is not None for process in stage.started.values()), CLOSE_SECONDS)
    while (left := stage.living()) and time.monotonic() < end:
        time.sleep(LOOK_SECONDS)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    for process in stage.started.values():
        try:
            process.wait(CLOSE_SECONDS)
        except subprocess.TimeoutExpired as error:
            raise Failed(f"{error.cmd}: cannot be killed") from None
    stage.output.finish(1.0)
    return left


def _read_words(evidence: Evidence, stage: Stage, begin: float, end: float) -> None:
    """What the user sees, and when the first sentence or report came.

    The cause is in the last sentence of a run that ends, and in the first of one that goes on; effects follow. That a
    node has lost time itself, as two faults run at a time, is the cause only where that is the fault.
    """
    news = stage.output.news(begin, end)
    concerns = stage.companion.ask("concerns")["concerns"]
    reports = [(when, f"/diagnostics of {name.lstrip('/')}: {words}") for name, (when, words) in concerns.items()
               if begin <= when <= end]
    times = [line.when for line in news] + [when for when, _ in reports]
    evidence.noticed = min(times, default=math.nan) - begin
    words = [line.text for line in news]
    spoken = [text for text in words if SENTENCE.match(text)] or words or [text for _, text in reports] or [""]
    causes = [text for text in spoken if SUSPENDED not in text or evidence.culprit == SUSPENDED] or spoken
    evidence.said = plain(causes[0] if evidence.went_on else spoken[-1], [stage.folder])
    evidence.traceback = plain(stage.output.traceback, [stage.folder])


def _read_bag(evidence: Evidence, stage: Stage, accident: float) -> None:
    """What was kept: of all ticks that the plant had published before the accident."""
    if evidence.nothing_to_keep:
        return
    try:
        recording = bag.read(stage.bag)
    except bag.BagError as error:
        if "holds no tick" in str(error):  # killed before the first was on the disk
            evidence.lost = _seconds_from(stage, 0, accident)
        else:
            evidence.wrong, evidence.lost = plain(str(error), [stage.folder]), math.inf
        return
    gone = {name: number for name, number in recording.missing.items() if number}
    found = verify(recording)
    if found.difference is not None or (found.problem and not gone):
        evidence.wrong = found.words
    evidence.lost = _seconds_from(stage, _first_gap(recording) if gone else int(recording.tick[-1]) + 1, accident)


def _seconds_from(stage: Stage, tick: int, accident: float) -> float:
    """Wall time from a tick to the accident, or to the last tick that was published before it."""
    seen = [when for when in stage.times[tick : stage.published + 1].tolist() if when]  # the onlooker may miss one
    if not seen:
        return 0.0
    begin, end = seen[0], min(accident, seen[-1])
    asleep = max(0.0, min(end, stage.asleep[1]) - max(begin, stage.asleep[0]))
    return float(max(0.0, end - begin - asleep))


def _first_gap(recording: bag.Recording) -> int:
    """The first tick that is not in the bag as a whole."""
    commands = recording.command if recording.running.lockstep else np.zeros_like(recording.command)
    judged = recording.lyapunov[:, [LYAPUNOV_NAMES.index("mode")]]
    outputs = [values[:, None] for values in recording.outputs.values()]
    whole = np.isfinite(np.hstack([recording.state, commands, judged, *outputs])).all(axis=1)
    there = np.zeros(int(recording.tick[-1]) + 2, dtype=bool)
    there[recording.tick[whole]] = True
    return int(np.argmin(there))

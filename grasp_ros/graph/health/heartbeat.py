"""Heartbeats and a watchdog: every node of a graph tells the others every 0.4 s that its process runs.

Heartbeats come from a thread of their own: a node that computes for long is not silent, one that was stopped or killed
is. Liveliness of DDS does not do: it says neither who is silent nor why somebody has ended, and a subscription that
asks for a lease hears nobody who publishes with ROS's default quality of service, as nodes of a user do.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from traceback import extract_stack
from types import FrameType
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String

from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.graph.stopping import tell_parent
from grasp_ros.physics.errors import line_of
from grasp_ros.scene.topics import ALIVE

HEARTBEAT_SECONDS = 0.4
GREET_SECONDS = 0.05  # from a heartbeat to one for a newcomer, which would otherwise wait for the next one
ACKNOWLEDGE_SECONDS = 0.2
MISSED = 2.5  # heartbeats, until somebody else may have taken the place
MOST_BEATS, MOST_BYTES = 64, 4096  # others may send more; the oldest are forgotten
ENDED = "ended"  # last words of a node that has nothing to say
FROZEN = {"T", "t"}  # states of processes in /proc that may go on
IDLE = {*FROZEN, "Z", "X", ""}  # that do nothing, or are not there
EVERY_SECONDS = 5.0  # from one sentence of the watchdog to the next
PAUSE_SECONDS = 2.0 * HEARTBEAT_SECONDS  # between two of its beats, if the process was stopped itself
LEASE_SECONDS = 30.0  # DDS has forgotten a process that was killed; 20 s by default


def digest(text: str) -> str:
    """A short name of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass
class Heartbeat:
    """What is known of one process of a node."""

    node: str  # full name
    identity: str  # of the process: who takes the place of a node has another one
    texts: list[str]  # digests of what it says on `scene` and `run`
    ended: str  # its last words; empty while it lives
    process: str  # its number and beginning, as the kernel has them, and whose numbers these are
    ready: bool  # whether it has begun to look for others: before it may compile
    # Topics of which it has had a message, as far as others wait for that.
    hears: list[str] = field(default_factory=list)
    scene: str = ""  # digest of the scene that it works with
    heard: float = 0.0  # wall time of the last one, s

    @property
    def state(self) -> str:
        """State of the process in /proc; empty if this machine does not have it."""
        number, _, _ = self.process.partition(" ")
        state, process = _process(number) if number.isdecimal() else ("", "")
        return state if process == self.process else ""

    @property
    def runs(self) -> bool:
        """Whether this machine has the process, and has not stopped it: it is only slow, then."""
        return self.state not in IDLE


def _process(number: str) -> tuple[str, str]:
    """State of a process, and what no other one has, of any host; empty if there is none, or no /proc."""
    try:
        words = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return words[0], f"{number} {words[19]} {_numbering()}"
    except (OSError, UnicodeDecodeError, IndexError):
        return "", ""


@cache
def _numbering() -> str:
    """Whose numbers of processes these are: of a kernel since its start, in this container, say, which counts anew."""
    started = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
    return f"{started} {os.readlink('/proc/self/ns/pid')}"


class Heartbeats:
    """The heartbeats of a node, and those that it hears."""

    def __init__(self, node: GraspNode, heard: Callable[[], None], watch: Callable[[], None]) -> None:
        self._node, self._heard = node, heard  # called after each one of another node
        process = _process(str(os.getpid()))[1]
        self.own = Heartbeat(node.get_fully_qualified_name(), uuid.uuid4().hex, [], "", process, False)
        self._beats: dict[str, Heartbeat] = {}
        self._met: dict[str, float] = {}  # since when nodes are known whose scene is asked for
        self._last = 0.0  # wall time of the last own one
        self.prepared = 0.0  # that of the last one of a node that is not ready
        self.publisher = node.publisher(ALIVE)
        node.subscribe(ALIVE, self._on_beat)
        self._stop = threading.Event()
        # The second one does nothing else, and never waits for others.
        self._threads = [threading.Thread(target=self._go_on, args=(action,), name="beats", daemon=True)
                         for action in (self._beat, watch)]
        for thread in self._threads:
            thread.start()

    def _go_on(self, action: Callable[[], None]) -> None:
        while not self._stop.wait(HEARTBEAT_SECONDS):
            with suppress(Exception):  # of a context that has just become invalid
                action()

    def _beat(self) -> None:
        self._last = time.monotonic()
        self.publisher.publish(String(data=json.dumps(asdict(self.own))))

    def tell(self) -> None:
        """Let all know what has changed, before what is published next."""
        self._beat()
        self._node.flush(self.publisher, seconds=ACKNOWLEDGE_SECONDS)

    def confirm(self, topic: str) -> None:
        """Let all know that this node has had a message of a topic."""
        if topic not in self.own.hears:
            self.own.hears.append(topic)
            self.tell()

    def works_with(self, scene: str) -> None:
        """Let all know whose scene this node has taken, by its text; empty: none."""
        self.own.scene = digest(scene) if scene else ""
        self.tell()

    def without(self, scene: str, names: Sequence[str]) -> list[str]:
        """Which of these nodes do not say that they work with a scene; nothing of those that may have no heartbeat."""
        limit = time.monotonic() - MISSED * HEARTBEAT_SECONDS
        self._met = {name: self._met.get(name, time.monotonic()) for name in names}
        return [name for name, met in self._met.items()
                if ((beats := self.of([name])) and beats[-1].scene != scene) or (not beats and met > limit)]

    def end(self, words: str) -> None:
        """The last heartbeat."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self.own.ended = words or ENDED
        with suppress(Exception):  # the context may be invalid
            self.tell()

    def _on_beat(self, message: Any) -> None:
        beat = _parsed(message.data)
        if beat is None or beat.identity == self.own.identity:
            return
        beat.heard = time.monotonic()
        if not beat.ready:
            self.prepared = beat.heard
        if self._beats.pop(beat.identity, None) is None and beat.heard > self._last + GREET_SECONDS:
            self._beat()
        self._beats[beat.identity] = beat
        oldest = next(iter(self._beats.values()))
        if len(self._beats) > MOST_BEATS or oldest.heard < beat.heard - LEASE_SECONDS:
            del self._beats[oldest.identity]
        self._heard()

    def of(self, names: Sequence[str]) -> list[Heartbeat]:
        """The heartbeats of some nodes, the last one last."""
        return [beat for beat in self._beats.values() if beat.node in names]

    @property
    def alive(self) -> list[Heartbeat]:
        """Those of processes that have not said their last words; asked from any thread."""
        return [beat for beat in list(self._beats.values()) if not beat.ended]

    def quiet(self, names: Sequence[str], limit: float) -> list[str]:
        """Which of these nodes were heard once, but not since a wall time, and had no last words."""
        heard = {beat.node: beat.heard for beat in self.alive}
        return [name for name in dict.fromkeys(names) if heard.get(name, limit) < limit]

    def sender_of(self, name: str) -> Heartbeat | None:
        """Of the process that publishes a text, by its digest; None if there is none."""
        return next((beat for beat in self.alive if name in beat.texts), None)

    def frozen(self) -> list[str]:
        """Nodes of this machine that were stopped and may go on."""
        return sorted({beat.node for beat in self.alive if beat.state in FROZEN})

    def successor(self, identity: str) -> str:
        """Name of the node in another process that has begun to say texts, while this one is silent; or nothing."""
        limit = time.monotonic() - MISSED * HEARTBEAT_SECONDS
        there = {beat.identity: beat.node for beat in self.alive if beat.texts and beat.heard >= limit}
        return "" if identity in there else next(iter(there.values()), "")


def _parsed(text: str) -> Heartbeat | None:
    """A heartbeat; None for anything else."""
    if len(text) > MOST_BYTES:
        return None
    try:
        beat = Heartbeat(**json.loads(text))
        words = [beat.node, beat.identity, beat.ended, beat.process, beat.scene, *beat.texts, *beat.hears]
    except (ValueError, TypeError, RecursionError):
        return None
    lists = isinstance(beat.texts, list) and isinstance(beat.hears, list)
    return beat if lists and all(isinstance(word, str) for word in words) else None


class Watchdog:
    """A thread that notices when the nodes' thread is blocked: in a law that does not return, or in DDS.

    A process that is stopped just while it holds a lock of shared memory stops those that wait for the lock as well, in
    the middle of a call of DDS. So the sentence goes to the terminal alone: a log of ROS goes through DDS.

    It may be blocked for `limit()` s, None: without end; for `patience` s while a node of this machine is suspended,
    which `frozen` names. After that the process ends, if `ends`.
    """

    def __init__(
        self, name: str, patience: float, limit: Callable[[], float | None], ends: bool,
        frozen: Callable[[], list[str]],
    ) -> None:
        self._name, self._patience, self._limit, self._ends = name, patience, limit, ends
        self._frozen, self._beaten = frozen, time.monotonic()
        self.resumed = self._beaten  # when it last went on after a stop of its own
        self.suspended_for = 0.0  # how long that took, s, until the node has said it
        self.feed()

    def feed(self) -> None:
        """The nodes' thread goes on."""
        self._since, self._said = time.monotonic(), -math.inf

    @property
    def stopped(self) -> bool:
        """Whether the process was stopped until just now, so that nobody here knows what others have done."""
        return time.monotonic() - self._beaten > PAUSE_SECONDS

    def beat(self) -> None:
        """Look; called every HEARTBEAT_SECONDS."""
        before, self._beaten = self._beaten, time.monotonic()
        if self._beaten - before > PAUSE_SECONDS:  # the nodes' thread was not blocked meanwhile
            self._since = self.resumed = self._beaten
            self.suspended_for = self._beaten - before
        seconds, most = self._beaten - self._since, self._limit()
        if most is None or seconds <= self._patience:
            return
        frozen = " and ".join(self._frozen())
        if not frozen and seconds <= most:
            return
        frame = sys._current_frames()[threading.main_thread().ident or 0]  # in which the nodes are
        why = f"{frozen} suspended" if frozen else f"in {line_of(extract_stack(frame))}"
        name = self._name if frozen else _node_of(frame) or self._name
        if self._beaten - self._said > EVERY_SECONDS:
            self._said = self._beaten
            with suppress(OSError):
                level = "FATAL" if self._ends else "ERROR"
                print(f"[{level}] [{name}]: blocked for {seconds:.1f} s: {why}", file=sys.stderr, flush=True)
        if self._ends:
            tell_parent(name, f"blocked for {seconds:.1f} s: {why}")
            os._exit(1)


def _node_of(frame: FrameType | None) -> str:
    """Name of the node in whose method a thread is: of several in one process, the one that keeps all waiting."""
    while frame is not None:
        if isinstance(owner := frame.f_locals.get("self"), Node):
            return str(owner.get_name())
        frame = frame.f_back
    return ""

"""Signs of life: every node of a graph tells the others every 0.4 s that its process runs, and when it ends.

They come from a thread of their own: a node that computes for long is not silent, one that was stopped or killed is.
"""

from __future__ import annotations

import hashlib
import json
import os
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.duration import Duration

from grasp_ros.graph.ros import messages
from grasp_ros.graph.ros.node import GraspNode
from grasp_ros.scene.topics import ALIVE

BEAT_SECONDS = 0.4
GREET_SECONDS = 0.05  # between signs to newcomers, which would otherwise wait for the next one
ACKNOWLEDGE_SECONDS = 0.2
MISSED = 2.5  # signs, until somebody else may have taken the place
MOST_SIGNS, MOST_BYTES = 64, 4096  # a stranger may send more; the oldest signs are forgotten
ENDED = "ended"  # last words of a node that has nothing to say
FROZEN = {"T", "t"}  # states of processes in /proc that may go on
IDLE = {*FROZEN, "Z", "X", ""}  # that do nothing, or are not there
LEASE_SECONDS = 30.0  # DDS has forgotten a process that was killed; 20 s by default


def digest(text: str) -> str:
    """A short name of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass
class Sign:
    """What is known of one process of a node."""

    node: str  # full name
    identity: str  # of the process: who takes the place of a node has another one
    turn: int  # how often it has put its time back
    texts: list[str]  # digests of what it says on `scene` and `run`
    ended: str  # its last words; empty while it lives
    process: str  # its number and beginning, as the kernel has them
    ready: bool  # whether it has begun to look for others: before it may compile
    heard: float = 0.0  # wall time of the last sign, s

    @property
    def state(self) -> str:
        """State of the process in /proc; empty if this machine does not have it."""
        number = self.process.split()[0] if self.process else ""
        state, process = _process(number) if number.isdecimal() else ("", "")
        return state if process == self.process else ""

    @property
    def runs(self) -> bool:
        """Whether this machine has the process, and has not stopped it: it is only slow, then."""
        return self.state not in IDLE


def _process(number: str) -> tuple[str, str]:
    """State of a process, and its number and beginning; empty if there is none, or no /proc."""
    try:
        words = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return words[0], f"{number} {words[19]}"
    except (OSError, UnicodeDecodeError, IndexError):
        return "", ""


class Beats:
    """The signs of a node, and those that it hears."""

    def __init__(self, node: GraspNode, heard: Callable[[], None], watch: Callable[[], None]) -> None:
        self._heard = heard  # called after each sign of another node
        process = _process(str(os.getpid()))[1]
        self.own = Sign(node.get_fully_qualified_name(), uuid.uuid4().hex, 0, [], "", process, False)
        self._signs: dict[str, Sign] = {}
        self._told = 0.0  # wall time of the last own sign
        self.prepared = 0.0  # that of the last sign of a node that is not ready
        self.publisher = node.publisher(ALIVE)
        node.subscribe(ALIVE, self._on_beat)
        self._stop = threading.Event()
        # The second one does nothing else, and never waits for others.
        self._threads = [threading.Thread(target=self._go_on, args=(action,), name="beats", daemon=True)
                         for action in (self._beat, watch)]
        for thread in self._threads:
            thread.start()

    def _go_on(self, action: Callable[[], None]) -> None:
        while not self._stop.wait(BEAT_SECONDS):
            with suppress(Exception):  # of a context that has just become invalid
                action()

    def _beat(self) -> None:
        own, self._told = self.own, time.monotonic()
        content = [own.node, own.identity, own.turn, own.texts, own.ended, own.process, own.ready]
        self.publisher.publish(messages.text(json.dumps(content)))

    def tell(self) -> None:
        """Let all know what has changed, before what is published next."""
        self._beat()
        self.publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGE_SECONDS))

    def end(self, words: str) -> None:
        """The last sign."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self.own.ended = words or ENDED
        with suppress(Exception):  # the context may be invalid
            self.tell()

    def _on_beat(self, message: Any) -> None:
        sign = _parsed(message.data)
        if sign is None or sign.identity == self.own.identity:
            return
        sign.heard = time.monotonic()
        if not sign.ready:
            self.prepared = sign.heard
        if self._signs.pop(sign.identity, None) is None and sign.heard > self._told + GREET_SECONDS:
            self._beat()
        self._signs[sign.identity] = sign
        oldest = next(iter(self._signs.values()))
        if len(self._signs) > MOST_SIGNS or oldest.heard < sign.heard - LEASE_SECONDS:
            del self._signs[oldest.identity]
        self._heard()

    def of(self, names: Sequence[str]) -> list[Sign]:
        """Signs of nodes, the last one last."""
        return [sign for sign in self._signs.values() if sign.node in names]

    def quiet(self, names: Sequence[str], limit: float) -> list[str]:
        """Those of some nodes that gave a sign once, but none since a wall time; not one after its last words."""
        heard = {sign.node: sign.heard for sign in self.of(names) if not sign.ended}
        return [name for name in dict.fromkeys(names) if heard.get(name, limit) < limit]

    def living(self, names: Sequence[str], limit: float) -> list[str]:
        """Names of the sources of a topic without processes that gave a sign once, but none since a wall time.

        DDS lists them for up to LEASE_SECONDS.
        """
        found = []
        for name, number in Counter(names).items():
            dead = [sign for sign in self.of([name]) if sign.ended or sign.heard < limit]
            found += [name] * max(1, number - len(dead))
        return found

    def vouched(self, name: str) -> Sign | None:
        """Who says a text, by its digest; None if nobody does."""
        return next((sign for sign in self._signs.values() if name in sign.texts and not sign.ended), None)

    def frozen(self) -> list[str]:
        """Nodes of this machine that were stopped and may go on; asked from any thread."""
        signs = list(self._signs.values())
        return sorted({sign.node for sign in signs if not sign.ended and sign.state in FROZEN})

    def successor(self, identity: str) -> str:
        """Name of the node in another process that has begun to say texts, while this one gives no sign; or nothing."""
        limit = time.monotonic() - MISSED * BEAT_SECONDS
        own = self._signs.get(identity)
        if own is not None and not own.ended and own.heard >= limit:
            return ""
        others = (sign for sign in self._signs.values() if sign.identity != identity)
        return next((sign.node for sign in others if sign.texts and not sign.ended and sign.heard >= limit), "")

    def speakers(self) -> bool:
        """Whether anybody is there who says texts."""
        return any(sign.texts and not sign.ended for sign in self._signs.values())


def _parsed(text: str) -> Sign | None:
    """A sign; None for anything else."""
    if len(text) > MOST_BYTES:
        return None
    try:
        node, identity, turn, texts, ended, process, ready = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        return None
    kinds = isinstance(texts, list) and isinstance(turn, int)
    if not kinds or not all(isinstance(word, str) for word in (node, identity, ended, process, *texts)):
        return None
    return Sign(node, identity, turn, texts, ended, process, ready is True)

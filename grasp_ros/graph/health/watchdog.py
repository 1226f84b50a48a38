"""Sees to it that a process comes back from what it does: nobody else in it could."""

from __future__ import annotations

import math
import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from traceback import extract_stack
from types import FrameType

from rclpy.node import Node

from grasp_ros.graph.health.heartbeat import HEARTBEAT_SECONDS
from grasp_ros.graph.stopping import tell_parent
from grasp_ros.physics.errors import line_of

EVERY_SECONDS = 5.0  # from one sentence to the next
PAUSE_SECONDS = 2.0 * HEARTBEAT_SECONDS  # between two beats, if the process was stopped itself


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

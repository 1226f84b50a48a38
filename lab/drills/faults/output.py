"""What processes print, line by line, with the time at which it came."""

from __future__ import annotations

import os
import re
import select
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

PROGRESS = re.compile(r"\S+: +\d+%\|[^|]*\|.*?tick(/s)?\]")
LOGGED = re.compile(r"\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[[\d.]+\] \[([^\]]*)\]: ")
SENTENCE = re.compile(r"^(\[|grasp: |interrupted |recorded +[\d.]+ s)")  # rather than a row of a table
NO_NEWS = re.compile(r"^\[(DEBUG|INFO)\]")
RAISED = re.compile(r"^[\w.]+(Error|Exception|Interrupt|Exit)\b")
SELECT_SECONDS = 0.02
TRACEBACK = "Traceback (most recent call last)"
TRACEBACKS = (TRACEBACK, "Error occurred at:")  # the second: of an executor of rclpy


class Line(NamedTuple):
    """A line that a process has printed."""

    when: float  # s, monotonic
    text: str


class Output:
    """Reads the ends of pipes and terminals, each in a thread."""

    def __init__(self) -> None:
        self.lines: list[Line] = []
        self._threads: list[threading.Thread] = []
        self._left: set[int] = set()

    def follow(self, file: int) -> None:
        """Read a file descriptor until its other end is closed."""
        thread = threading.Thread(target=self._read, args=(file,), daemon=True)
        self._threads.append(thread)
        thread.start()

    def leave(self, file: int) -> None:
        """Read a file descriptor no more, and close it."""
        self._left.add(file)
        while file in self._left:
            time.sleep(SELECT_SECONDS)

    def finish(self, seconds: float) -> None:
        """Wait until all is read."""
        end = time.monotonic() + seconds
        for thread in self._threads:
            thread.join(max(0.0, end - time.monotonic()))

    def _read(self, file: int) -> None:
        rest = b""
        while True:
            while not select.select([file], [], [], SELECT_SECONDS)[0]:
                if file in self._left:
                    break
            if file in self._left:
                os.close(file)
                self._left.discard(file)
                return
            try:
                data = os.read(file, 2**16)
            except OSError:  # a terminal whose processes have gone, or that we have closed
                data = b""
            now = time.monotonic()
            *whole, rest = re.split(rb"[\r\n]+", rest + data)
            for line in [*whole, *([] if data else [rest])]:
                self._take(now, line.decode(errors="replace"))
            if not data:
                return

    def _take(self, now: float, text: str) -> None:
        """Keep a line, without the bars of progress that another process has written into it."""
        if text := PROGRESS.sub("", text).strip():
            self.lines.append(Line(now, text))

    @property
    def traceback(self) -> str:
        """The last line of a traceback; empty without one."""
        texts = [line.text for line in self.lines]
        begin = next((number for number, text in enumerate(texts) if any(mark in text for mark in TRACEBACKS)), None)
        if begin is None:
            return ""
        return next((text for text in texts[begin + 1:] if RAISED.match(text)), TRACEBACK)

    def news(self, begin: float, end: float) -> list[Line]:
        """Sentences that mean something to a user: all that came in an interval but what is logged as information."""
        return [line for line in self.lines if begin <= line.when <= end and not NO_NEWS.match(line.text)]


def plain(text: str, folders: Iterable[Path]) -> str:
    """A line without what differs between two runs: paths, process ids, times, and numbers of ticks."""
    text = LOGGED.sub(r"\2: ", text)
    for folder in folders:
        text = text.replace(str(folder), "DIR")
    text = re.sub(r"(?<![\w.])pid \d+", "pid N", text)
    text = re.sub(r"\btick \d+", "tick N", text)
    text = re.sub(r"\bt = [\d.e+-]+ s", "t = T s", text)
    text = re.sub(r"\b\d+ (ticks|messages|commands|bytes|states)\b", r"N \1", text)
    text = re.sub(r"^recorded +[\d.e-]+ s", "recorded T s", text)
    return re.sub(r" {2,}", " ", re.sub(r"\b\d+\.\d{2,}\b", "X", text)).replace("|", "\\|")

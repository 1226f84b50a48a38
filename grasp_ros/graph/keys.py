"""Keys of a terminal as they are pressed, without Enter; the terminal is then given back as it was."""

from __future__ import annotations

import os
import re
import select
import sys
import termios
import tty
from contextlib import suppress
from enum import Enum
from typing import Any

_WORD = re.compile(rb"\x1b[\[O][CD]| |q")
_BEGUN = re.compile(rb"\x1b[\[O]?$")  # of an arrow key whose end has not come yet
MOST = 1024  # bytes taken at once


class Key(Enum):
    """What a key asks for."""

    PAUSE = b" "
    FORWARD = b"C"
    BACK = b"D"
    QUIT = b"q"


class Keys:
    """Keys pressed on the standard input from `start` to `close`."""

    def __init__(self) -> None:
        # Whether there can be any: not without a terminal, nor in the background, where a terminal stops who sets it.
        self.there, self._file, self._rest = False, 0, b""
        self._before: list[Any] = []

    def start(self) -> None:
        """From now on keys come one by one and are not shown; Ctrl-C stays a signal."""
        self._file = sys.stdin.fileno() if sys.stdin and not sys.stdin.closed else -1
        with suppress(OSError):  # not a terminal, or not that of this session
            if self._file >= 0 and os.tcgetpgrp(self._file) == os.getpgrp():
                self._before = termios.tcgetattr(self._file)
                self.there = True
                tty.setcbreak(self._file)

    def close(self) -> None:
        """Give the terminal back; does nothing the second time."""
        if self.there:
            self.there = False
            termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)

    def pressed(self, seconds: float = 0.0) -> list[Key]:
        """Keys in their order; waits for the first one, at most so many seconds. A terminal that is gone is a QUIT."""
        ready, _, _ = select.select([self._file] if self.there else [], [], [], seconds)
        if not ready:
            return []
        came = os.read(self._file, MOST)
        if not came:
            return [Key.QUIT]
        came = self._rest + came
        begun = _BEGUN.search(came)
        self._rest = begun[0] if begun else b""
        return [Key(word[-1:]) for word in _WORD.findall(came)]

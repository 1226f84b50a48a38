"""A limit of wall time for what runs in Python."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class Deadline(Exception):  # noqa: N818 - an instant, not an error
    """A run took too long."""


@contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Stop what runs in Python after some seconds; compiled code is stopped when it returns."""
    def late(*_: Any) -> None:
        raise Deadline

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)

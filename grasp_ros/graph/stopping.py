"""The signals that end a process cleanly, and the end of the process that started it.

A process of the graph inherits one end of a pair of sockets as its standard input. Whatever ends the process that holds
the other end, a SIGKILL included, closes it. On the same way it tells that process why it ends itself.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
GRACE_SECONDS = 10.0  # to end cleanly after a signal, or after the process that started this one has ended
AGAIN_SECONDS = 0.001  # until an interrupt that was dropped comes again
MOST_WORDS = 4000  # characters
PR_SET_PDEATHSIG = 1  # of prctl(2)
_raised: list[int] = []  # signals that `raise_on_signals` has turned into an exception
_status: list[int] = []  # of a process that ends by force
_parent: list[int] = []  # file descriptor of the way to the process that started this one, if it is one of ours


def note_signals(received: list[int]) -> None:
    """From now on, only note the signals that end a process: an exception could leave something half done."""
    on_signals(lambda number, _: received.append(number))


def on_signals(react: Callable[[int, Any], object] | signal.Handlers) -> None:
    """React to the signals that end a process; a SIGHUP that is ignored, as `nohup` does it, stays ignored."""
    for number in STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, react)


def end_late_by_force(name: str, received: list[int]) -> None:
    """Note signals also where a law has other reactions; if still there GRACE_SECONDS after one, end by force.

    A law that does not return, or a call of DDS that waits for a lock, would keep a process for ever.
    """
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)  # written to at once, whatever the process does

    def watch() -> None:  # without end: what is closed would give its number to the next file, which Python writes to
        while (number := reader.recv(1)) and writer:
            if number[0] in STOP_SIGNALS:  # a law may react to others
                received.append(number[0])
                end_by_force(name)

    threading.Thread(target=watch, name="signals", daemon=True).start()


def end_by_force(name: str, status: int = 1) -> None:
    """Give this process GRACE_SECONDS to end, and the status of the last call."""
    _status[:] = [status]
    signal.alarm(int(GRACE_SECONDS) + 2)  # for an interpreter whose own end hangs: no thread runs there any more

    def end() -> None:
        time.sleep(GRACE_SECONDS)
        others = [own.name for own in threading.enumerate() if not (own.daemon or own is threading.main_thread())]
        why = f", kept by {', '.join(others)}" if others else ""  # threads of a law
        with suppress(OSError):  # nobody may read it
            print(f"{name}: has not ended within {GRACE_SECONDS:g} s{why}: ended by force", file=sys.stderr,
                  flush=True)
        os._exit(*_status)

    threading.Thread(target=end, name="end", daemon=True).start()


def raise_on_signals() -> None:
    """Let every signal that ends a process be a KeyboardInterrupt, so that files are closed and parts removed.

    Where it cannot pass, in the end of an object or in code of C, which prints it, it comes again a moment later.
    Processes that are forked from this one have the system's own reactions again.
    """
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    changed = [number for number in before if before[number] in (signal.SIG_DFL, signal.default_int_handler)]
    for number in changed:
        signal.signal(number, _interrupt)

    def give_back() -> None:
        for number in changed:
            signal.signal(number, before[number])

    _raised.clear()
    if changed:
        os.register_at_fork(after_in_child=give_back)
        sys.unraisablehook = partial(_raise_again, sys.unraisablehook)
        sys.excepthook = partial(_raise_again, sys.excepthook)


def _interrupt(number: int, _: object) -> None:
    _raised.append(number)
    raise KeyboardInterrupt


def _raise_again(others: Callable[..., object], *dropped: Any) -> None:
    if _raised and getattr(dropped[0], "exc_type", dropped[0]) is KeyboardInterrupt:
        signal.signal(signal.SIGALRM, _interrupt)
        signal.setitimer(signal.ITIMER_REAL, AGAIN_SECONDS)
    else:
        others(*dropped)


def is_signalled() -> bool:
    """Whether a signal came: what is raised afterwards may be what others, an import of numpy say, have made of it."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)  # it is answered
    return bool(_raised)


def tell_parent(node: str, why: str, status: int = 1) -> bool:
    """Let the process that started this one know why a node ends early, with what status, and since when.

    Returns whether there is one.
    """
    with suppress(OSError):  # it has ended
        for way in _parent:
            os.write(way, json.dumps([time.monotonic(), node, why[:MOST_WORDS], status]).encode())
    return bool(_parent)


def end_with_parent(received: list[int], name: str) -> None:
    """Note the end of the process that holds the other end of the standard input as a SIGHUP; end, if late by force."""
    _parent.append(0)
    if sys.platform == "linux":  # a process that was stopped could not end: its parent's death lets it go on
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGCONT)

    def watch() -> None:
        with suppress(OSError):
            while os.read(0, 1):
                pass
        with suppress(OSError):  # nobody may read it
            print(f"{name}: its parent process has ended; it ends, too", file=sys.stderr)
        received.append(signal.SIGHUP)
        end_by_force(name)

    threading.Thread(target=watch, name="parent", daemon=True).start()

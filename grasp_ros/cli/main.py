"""`grasp`: the command line for everything that needs no ROS, and for starting the four processes together.

Exit statuses: 0; 1 if a run failed, or if this package has a fault, which shows its traceback; 2 for input that is
refused, in one line; 130 after a Ctrl-C, or another signal that ends a process.
"""

from __future__ import annotations

import argparse
import errno
import io
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module

from grasp_ros.cli.arguments import Command
from grasp_ros.graph.disk import FULL
from grasp_ros.graph.stopping import raise_on_signals
from grasp_ros.physics.errors import Refused

SUBJECTS = {  # files of this room, and their commands: what is not asked for is not imported, which takes a while
    "simulate": ("scenes", "methods", "simulate"), "map": ("map",),
    "graph": ("run", "recover", "inspect", "replay", "watch", "ctl", "verify"), "plot": ("plot",),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of `grasp`; returns the exit status."""
    words = sys.argv[1:] if arguments is None else arguments
    return run(lambda: _parser(words[0] if words else ""), words)


def run(parser: Callable[[], argparse.ArgumentParser], words: Sequence[str]) -> int:
    """Run the command that the words name; returns the exit status."""
    try:
        status = _status(parser, words)
        sys.stdout.flush()  # here, where it can still be said that it failed
        return status
    except OSError as error:
        enough = isinstance(error, BrokenPipeError)  # the reader of our output, `head` say, has had it
        if not enough and error.errno not in (*FULL, errno.EIO):  # EIO: the terminal is gone
            raise
        if error.errno in FULL:
            with suppress(OSError):
                print(f"grasp: the output cannot be written: {error.strerror}", file=sys.stderr)
        nothing = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nothing, stream.fileno())
        return 0 if enough else 1


def _status(parser: Callable[[], argparse.ArgumentParser], words: Sequence[str]) -> int:
    """Run a command; in one line what it refuses."""
    try:
        raise_on_signals()
        options = parser().parse_args(words)
        command: Command = options.command
        if isinstance(sys.stdout, io.TextIOWrapper):  # a title or a path that the terminal cannot show is no error
            sys.stdout.reconfigure(errors="backslashreplace")
        return command(options)
    except Refused as error:
        print(f"grasp: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("grasp: interrupted", file=sys.stderr)
        return 130


def _parser(wanted: str) -> argparse.ArgumentParser:
    """A parser of one command, or of all of them where it is none."""
    parser = argparse.ArgumentParser(prog="grasp", description="Simulate, run, inspect and draw a colliding grasp.")
    commands = parser.add_subparsers(required=True, metavar="command")
    known = [subject for subject, names in SUBJECTS.items() if wanted in names]
    for subject in known or SUBJECTS:
        import_module(f"grasp_ros.cli.{subject}").add_to(commands)
    return parser

"""`grasp`: the command line for everything that needs no ROS, and for starting the four processes together.

Exit statuses: 0; 1 if a run fails, a bag lacks messages or fails verification, a limit is exceeded, a fit does not
identify a parameter or does not reproduce the motion, no setting reaches an accuracy, the standard output cannot be
written, or for a bug in this package, with its traceback; 2 for invalid input or a file that cannot be written, with
one line; 130 after a Ctrl-C, or another signal that ends a process, but 0 of a `grasp run` that was interrupted while
it recorded and whose bag has a tick.
"""

from __future__ import annotations

import argparse
import errno
import io
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module

import grasp_ros
from grasp_ros.cli.parser import COMMANDS, Command, Parser, add_levels, overview, shortened
from grasp_ros.graph.bag.disk import FULL
from grasp_ros.graph.stopping import is_signalled, on_signals, raise_on_signals
from grasp_ros.physics.errors import Refused, described, needing

HELP = f"""\
Simulate, run, inspect and draw a grasp that collides.

{overview()}

`grasp COMMAND --help` says more; `grasp --version` prints the version.
Begin with `grasp simulate case_01`. A traceback is a bug: please report it.
"""


def grasp() -> int:
    """Entry point of `grasp`; returns the exit status, which a signal does not change when the work is done."""
    status = main()
    on_signals(signal.SIG_IGN)
    return status


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line, or the arguments, say; returns the exit status."""
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    words = sys.argv[1:] if arguments is None else arguments
    return run(lambda: _parser(words), words)


def run(parser: Callable[[], argparse.ArgumentParser], words: Sequence[str]) -> int:
    """Run the command that the words name; returns the exit status."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # it was closed before we began
            stream = open(os.devnull, mode, encoding="utf-8")  # noqa: SIM115 - for as long as we live
            os.set_inheritable(stream.fileno(), True)  # the number that was free: for the nodes that we start as well
            setattr(sys, name, stream)
    if isinstance(getattr(sys.stdout, "buffer", None), io.FileIO):  # unbuffered: drops what cannot be written at once
        own = sys.stdout
        sys.stdout = open(own.fileno(), "w", 1, own.encoding, own.errors, closefd=False)  # noqa: SIM115 - likewise
    status = 0
    try:
        status = _status(parser, words)
        sys.stdout.flush()  # here, where it can still be said that it failed
        return status
    except OSError as error:
        enough = isinstance(error, BrokenPipeError)  # the reader of our output, `head` say, has had it
        lost = error.errno in FULL or hasattr(error, "characters_written")  # the second one: full, and nobody waits
        of_output = enough or lost or error.errno in (errno.EIO, errno.EBADF)  # EIO: the terminal is gone
        if not of_output:
            raise
        if lost:
            with suppress(OSError):
                print(f"grasp: the output cannot be written: {error.strerror}", file=sys.stderr)
        nothing = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nothing, stream.fileno())
        return status if enough else 1


def _status(parser: Callable[[], argparse.ArgumentParser], words: Sequence[str]) -> int:
    """Run a command; in one line what it refuses."""
    try:
        raise_on_signals()
        begin = time.monotonic()
        try:
            with needing("this"):
                options = parser().parse_args(words)
        except FileNotFoundError:  # of an import
            _check_directory()
            raise
        except SystemExit as stop:  # of argparse, which has said why
            return stop.code if isinstance(stop.code, int) else 0
        _check_directory()
        command: Command = options.command
        if isinstance(sys.stdout, io.TextIOWrapper):  # a title or a path that the terminal cannot show is no error
            sys.stdout.reconfigure(errors="backslashreplace")
        from grasp_ros.cli.output import set_level  # with numpy, which a help does not need

        set_level(options)
        with needing("this"):
            status = command(options)
        if getattr(options, "verbose", False):
            from grasp_ros.exact.compilation.kernel_cache import cache_directory
            from grasp_ros.scene.versions import versions

            print(", ".join(f"{name} {version}" for name, version in versions().items()), file=sys.stderr)
            print(f"kernels: {cache_directory()}\n{time.monotonic() - begin:.3f} s", file=sys.stderr)
        return status
    except Refused as error:
        print(shortened(f"grasp: {error}"), file=sys.stderr)
        return error.exit_status
    except KeyboardInterrupt as stop:
        print(f"grasp: interrupted{stop}", file=sys.stderr)
        return 130
    except Exception as error:
        if is_signalled():
            print("grasp: interrupted", file=sys.stderr)
            return 130
        if not hasattr(error, "__notes__"):  # which an error of a user's controller has
            raise
        print(shortened(f"grasp: {error.__notes__[0]}: {described(error)}"), file=sys.stderr)
        return 1


def _check_directory() -> None:
    """Refuse a working directory that has been removed."""
    try:
        os.getcwd()
    except FileNotFoundError:
        raise Refused("the working directory is gone; allowed: one that is there") from None


def _complete() -> None:
    """Answer a shell that completes a command line, and end."""
    import argcomplete

    line = os.environ.get("COMP_LINE", "")[: int(os.environ.get("COMP_POINT", "0"))].split(" ")
    words = line[1:-1]  # the last one is not complete yet
    argcomplete.autocomplete(_parser(words))


class _Version(argparse.Action):
    """Which one this is; asked for only then, because it takes a while to find out."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"grasp {grasp_ros.__version__}")
        parser.exit()


class _Overview(Parser):
    """The parser of `grasp` itself, whose help is one screen."""

    def format_help(self) -> str:
        return f"{self.format_usage()}\n{HELP}"


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """A parser of the command that the words name, or of all names where they name none."""
    parser = _Overview(prog="grasp", usage="grasp [--version] [-q | -v] COMMAND ...")
    parser.add_argument("--version", action=_Version, nargs=0)
    add_levels(parser, None)
    commands = parser.add_subparsers(prog="grasp", required=True, metavar="command", parser_class=Parser)
    wanted = next((word for word in words if not word.startswith("-")), "")
    if wanted in COMMANDS:
        import_module(f"grasp_ros.cli.{COMMANDS[wanted].module}").add_to(commands)
    else:
        for name in COMMANDS:
            commands.add_parser(name)
    return parser

"""Parsers whose errors are short, name the command that was wrong, and say what was meant."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NoReturn

from grasp_ros.physics.errors import allowed

Command = Callable[[argparse.Namespace], int]
LONGEST = 250  # characters of a line that refuses something


def shortened(line: str) -> str:
    """One line; where it is too long, without the words in its middle."""
    line, end = " ".join(line.split()), LONGEST // 3
    if len(line) <= LONGEST:
        return line
    first, last = line[: LONGEST - end - 5], line[-end:]
    part, rest = re.search(r" \S{,25}$", first), re.match(r"\S{,25} ", last)  # of words that are not too long
    return f"{first[: part.start()] if part else first} ... {last[rest.end():] if rest else last}"


class Parser(argparse.ArgumentParser):
    """A parser of one command, or of `grasp` itself."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.register("type", float, _number)
        self._negative_number_matcher = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")  # -1e-3 is no option, either

    def error(self, message: str) -> NoReturn:
        """Print one short line."""
        choice = re.fullmatch(r"argument (.*): invalid choice: '(.*?)' \(choose from (.*)\)", message, re.S)
        if choice is not None:
            known = re.findall(r"[\w-]+", choice[3])
            message = f"argument {choice[1]}: {choice[2]} is not allowed; {allowed(choice[2], known)}"
        self.exit(2, shortened(f"{self.prog}: error: {message}") + "\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        if file is sys.stdout:
            file.write(message)  # argparse keeps to itself that this failed
        else:
            with suppress(OSError):  # Python does so from 3.11.5 on
                super()._print_message(message, file)

    def parse_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Arguments; one that is unknown is an error of the command, and not of `grasp`."""
        options, rest = self.parse_known_args(args, namespace)
        if rest:
            parser: argparse.ArgumentParser = getattr(options, "parser", self)
            known = [word for action in parser._actions for word in action.option_strings]
            word = rest[0].split("=")[0]
            meant = f"; {allowed(word, known)}" if word.startswith("-") else ""
            parser.error(f"unrecognized arguments: {' '.join(rest)}{meant}")
        return options


def _number(word: str) -> float:
    from grasp_ros.physics.given import read_number

    return read_number(word)


def add_levels(parser: argparse.ArgumentParser, default: object = argparse.SUPPRESS) -> None:
    """How much is said beside the results."""
    level = parser.add_mutually_exclusive_group()
    level.add_argument("-q", "--quiet", action="store_true", default=default, help="print only results and errors")
    level.add_argument("-v", "--verbose", action="store_true", default=default, help="also print versions and times")

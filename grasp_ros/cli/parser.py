"""All commands of `grasp`, and parsers whose errors are short, name the wrong command, and say what was meant."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, NamedTuple, NoReturn

from grasp_ros.physics.errors import allowed

Command = Callable[[argparse.Namespace], int]
LONGEST = 250  # characters of a line that refuses something


class Entry(NamedTuple):
    """One command."""

    module: str  # file of this room
    group: str
    text: str


_SCENES, _RUNS, _GRAPH = "scenes", "without ROS", "ROS 2 graph"
COMMANDS: dict[str, Entry] = {
    "scenes": Entry("scenes", _SCENES, "list the scenes that come with the package, or print one"),
    "new": Entry("scenes", _SCENES, "write a commented scene file to start from"),
    "simulate": Entry("simulate", _RUNS, "simulate a scene"),
    "plot": Entry("plot", _RUNS, "draw or animate bags, files of `grasp simulate`, or scenes"),
    "map": Entry("map", _RUNS, "simulate many variants of a scene: a grid over two numbers, or a sample"),
    "design": Entry("design", _RUNS, "choose parameters of a scene that minimise an outcome"),
    "fit": Entry("fit", _RUNS, "estimate parameters of a scene from a bag or a table, with confidence intervals"),
    "accuracy": Entry("accuracy", _RUNS, "error against time of every method on a scene, and the setting to take"),
    "methods": Entry("simulate", _RUNS, "list the integration methods"),
    "run": Entry("graph", _GRAPH, "run a scene in four ROS 2 processes and record a bag"),
    "watch": Entry("graph", _GRAPH, "watch a running graph, or a bag, in the terminal"),
    "ctl": Entry("graph", _GRAPH, "pause, step or reset a graph, set its parameters; or a shell for it"),
    "inspect": Entry("bags", _GRAPH, "print what is in a bag, or write it as a table"),
    "verify": Entry("bags", _GRAPH, "simulate a bag again with its recorded inputs and compare every bit"),
    "replay": Entry("graph", _GRAPH, "publish a bag again, with its clock"),
    "recover": Entry("bags", _GRAPH, "write a new bag from one that was cut off or damaged"),
}


def overview() -> str:
    """All commands by groups, a line each."""
    lines: list[str] = []
    for group in dict.fromkeys(entry.group for entry in COMMANDS.values()):
        lines.append(f"{group}:")
        lines += [f"  {name:<10}{entry.text}" for name, entry in COMMANDS.items() if entry.group == group]
    return "\n".join(lines)


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

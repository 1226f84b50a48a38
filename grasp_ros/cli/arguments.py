"""Arguments that several subcommands share."""

from __future__ import annotations

import argparse
import glob
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli.parser import COMMANDS, Command, add_levels
from grasp_ros.physics.accuracy import ACCURACY, COARSEST, FINEST
from grasp_ros.physics.control import Law
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.effects.base import SIDES
from grasp_ros.scene.own_law import find_law

Options = argparse.ArgumentParser | argparse._ArgumentGroup


def add_command(commands: Any, name: str, command: Command, text: str = "") -> argparse.ArgumentParser:
    """Add a subcommand; `command` is what it runs, and returns the exit status. Default text: that of `COMMANDS`."""
    text = text or COMMANDS[name].text
    sub: argparse.ArgumentParser = commands.add_parser(name, help=text, description=text)
    sub.set_defaults(command=command, parser=sub)
    add_levels(sub)
    return sub


def add_json(sub: Options) -> None:
    """The result as data."""
    sub.add_argument("--json", action="store_true", help="print JSON instead of a table; null for what is not finite")


def add_scene(sub: argparse.ArgumentParser) -> None:
    """One scene, with settings."""
    scene = sub.add_argument("scene", help="a name that `grasp scenes` lists, or the path of a .yaml file")
    complete_scenes(scene)
    add_settings(sub)


def complete_scenes(argument: argparse.Action) -> None:
    """Let a shell complete the names of scenes, and files, in place of an argument."""
    def completer(prefix: str, **_: object) -> list[str]:
        paths = Path().glob(f"{glob.escape(prefix)}*")
        return [*scenes.names(), *(str(path) for path in paths if path.is_dir() or path.suffix == ".yaml")]

    argument.completer = completer  # type: ignore[attr-defined]


def add_settings(sub: argparse.ArgumentParser) -> None:
    """What replaces numbers of scenes."""
    sub.add_argument(
        "--set", dest="settings", action="append", default=[], metavar="section.key=value",
        help="replace a number; section={} adds a section that needs no numbers",
    )


def add_accuracy(sub: Options) -> None:
    """The accuracy of `exact`."""
    sub.add_argument(
        "--accuracy", type=float, default=ACCURACY, metavar="A",
        help=f"size of the first neglected Taylor term of a contact, relative to the impact, {FINEST:g} to {COARSEST:g}"
        f" (default {ACCURACY:g})",
    )


def named(word: str) -> Path:
    """A path that is no standard input or output, nor empty, which would be the working directory."""
    if word in ("", "-"):
        raise argparse.ArgumentTypeError(f"{word!r} is not allowed; allowed: a name")
    return Path(word)


def add_file(sub: Options, metavar: str, text: str) -> None:
    """A file to write, or - for the standard output, and whether one that is there may be replaced."""
    sub.add_argument("-o", "--output", type=Path, metavar=metavar, help=text)
    add_force(sub)


def add_force(sub: Options) -> None:
    """Whether a file that is there may be replaced."""
    sub.add_argument("--force", action="store_true", help="replace the output file if it is there")


def whole(least: int) -> Callable[[str], int]:
    """Reads a whole number from a command line."""
    def read(word: str) -> int:
        if not word.isdecimal() or int(word) < least:
            raise argparse.ArgumentTypeError(f"{word} is not allowed; allowed: a whole number >= {least}")
        return int(word)

    return read


def sides_of(words: Sequence[str]) -> dict[str, str]:
    """Where the controllers of `--controller` are found, "module:object" by side."""
    found: dict[str, str] = {}
    for word in words:
        side, _, law = word.partition("=")
        if side not in SIDES or not all(law.partition(":")):
            raise Refused(f"--controller: {word} is not allowed; allowed: side=module:object, with the side"
                          f" {' or '.join(SIDES)}")
        if side in found:
            raise Refused(f"--controller: {word} is not allowed; allowed: one for the {side} side")
        found[side] = law
    return found


def load_controllers(words: Sequence[str]) -> dict[str, Law | type]:
    """The callables by side."""
    return {side: find_law(law, f"--controller: {side}={law}") for side, law in sides_of(words).items()}

"""What several subcommands share: their arguments, checks of these, and the compilation that most of them need."""

from __future__ import annotations

import argparse
import errno
import glob
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.cli.commands import COMMANDS
from grasp_ros.cli.output import STDOUT, note
from grasp_ros.cli.parser import Command, add_levels
from grasp_ros.physics.accuracy import ACCURACY, COARSEST, FINEST
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.files import writing

Options = argparse.ArgumentParser | argparse._ArgumentGroup
ROW = 16  # numbers that a run keeps for each output time: time, state, commands, energies, and copies


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
    argument.completer = _scenes_and_files  # type: ignore[attr-defined]


def _scenes_and_files(prefix: str, **_: object) -> list[str]:
    files = [str(path) for path in Path().glob(f"{glob.escape(prefix)}*") if path.is_dir() or path.suffix == ".yaml"]
    return [*scenes.names(), *files]


def add_settings(sub: argparse.ArgumentParser) -> None:
    """What replaces numbers of scenes."""
    sub.add_argument(
        "--set", dest="settings", action="append", default=[], metavar="section.key=value",
        help="replace a number; section={} adds a section that needs no numbers",
    )


def load_scene(reference: str, settings: Sequence[str] = ()) -> Scene:
    """A scene that a command line names; its warnings go to the standard error output."""
    scene = scenes.load(reference, settings)
    warn(scene)
    return scene


def warn(scene: Scene) -> None:
    """Print the warnings of a scene, a line each."""
    for warning in scene.warnings:
        note(f"grasp: warning: {scene.name}: {warning}")


def add_accuracy(sub: Options) -> None:
    """The accuracy of `exact`."""
    sub.add_argument(
        "--accuracy", type=float, default=ACCURACY, metavar="A",
        help=f"first neglected term of a contact, relative, {FINEST:g} to {COARSEST:g} (default {ACCURACY:g})",
    )


def add_output(sub: Options, metavar: str, text: str, default: Path | None = None) -> None:
    """A file or a directory to write."""
    sub.add_argument("-o", "--output", type=Path, default=default, metavar=metavar, help=text)


def add_force(sub: Options) -> None:
    """Whether a file that is there may be replaced."""
    sub.add_argument("--force", action="store_true", help="replace the output file if it is there")


def check_output(output: Path, force: bool, inputs: Sequence[str] = ()) -> None:
    """Refuse to write over what is there, or where no directory is, before the work; over an input in any case.

    Raises
    ------
    Refused
        Names the file.
    """
    if output == STDOUT:
        return
    with writing(output):
        if not (output.is_file() or output.is_dir()):
            output.parent.stat()
            return  # new, a device or a pipe
        if output.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        for given in map(Path, inputs):
            if given.exists() and (given.samefile(output) or output.resolve().is_relative_to(given.resolve())):
                raise Refused(f"-o {output}: is the input; allowed: another file")
        if not force:
            raise Refused(f"{output}: is there; allowed: a new file, or --force to replace it")


def whole(least: int) -> Callable[[str], int]:
    """Reads a whole number from a command line."""
    def read(word: str) -> int:
        if not word.isdecimal() or int(word) < least:
            raise argparse.ArgumentTypeError(f"{word} is not allowed; allowed: a whole number >= {least}")
        return int(word)

    return read


def check_memory(scene: Scene, sampled: bool, grid: int | None = None) -> None:
    """Refuse more output times, or ticks of a sampled run, than memory holds, before the work.

    Raises
    ------
    Refused
        Names them.
    """
    ticks = scene.ticks if sampled or scene.sampled else 0
    for name, rows in (("--grid", grid or 0), (f"{scene.name}: control periods", ticks)):
        try:
            np.empty((rows, ROW))
        except (MemoryError, ValueError):  # the second: more than any array can have
            raise Refused(f"{name}: {rows} is not allowed; allowed: as many as fit into memory") from None


def prepare() -> None:
    """Compile the kernels where that has not been done, before anything shows how far it is."""
    from grasp_ros.exact.integrator import compile_kernels

    compile_kernels()

"""What several subcommands share: before the work a scene, refusals and compilation; then what they print and write.

Results are on the standard output, as tables or as JSON, and all else is on the standard error output.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.files import format_of, replacing, writing

STDOUT = Path("-")
ROW = 16  # numbers that a run keeps for each output time: time, state, commands, energies, and copies
LOG = logging.getLogger("grasp_ros")  # whose level decides whether there are notes and progress bars


def load_scene(reference: str, settings: Sequence[str] = ()) -> Scene:
    """A scene that a command line names; its warnings go to the standard error output."""
    scene = scenes.load(reference, settings)
    warn(scene)
    return scene


def warn(scene: Scene) -> None:
    """Print the warnings of a scene, a line each."""
    for warning in scene.warnings:
        note(f"grasp: warning: {scene.name}: {warning}")


def check_output(output: Path | None, endings: Collection[str], force: bool, inputs: Sequence[str] = ()) -> None:
    """Refuse another format, a file that is there, a directory that is not, and an input, before the work."""
    if output is None or output == STDOUT:
        return
    format_of(output, endings)
    with writing(output):
        if output.is_dir():
            raise Refused(f"{output}: cannot be written: Is a directory")
        if not output.is_file():
            output.parent.stat()
            return  # new, a device or a pipe
        for given in map(Path, inputs):
            if given.exists() and (given.samefile(output) or output.resolve().is_relative_to(given.resolve())):
                raise Refused(f"-o {output}: is the input; allowed: another file")
        if not force:
            raise Refused(f"{output}: already exists; allowed: a new file, or --force to replace it")


def check_memory(scene: Scene, sampled: bool, grid: int | None = None) -> None:
    """Refuse more output times, or ticks of a sampled run, than memory holds, before the work."""
    ticks = scene.ticks if sampled or scene.sampled else 0
    check_fits("--grid", grid or 0, ROW)
    check_fits(f"{scene.name}: time.duration_s / control_period_s", ticks, ROW)


def check_fits(name: str, rows: int, numbers: int) -> None:
    """Refuse more rows of so many numbers than memory holds."""
    try:
        np.empty((rows, numbers))
    except (MemoryError, ValueError):  # the second: more than any array can have
        raise Refused(f"{name}: {rows} is not allowed; allowed: as many as fit into memory") from None


def prepare() -> None:
    """Compile the kernels where that has not been done, before anything shows how far it is."""
    from grasp_ros.exact.integrator import compile_kernels

    compile_kernels()


def set_level(options: argparse.Namespace) -> None:
    """Set whether a command prints notes beside its results."""
    LOG.setLevel(logging.ERROR if getattr(options, "quiet", False) else logging.WARNING)


def has_notes() -> bool:
    """Whether there are notes and progress bars: not of a command that is quiet."""
    return LOG.isEnabledFor(logging.WARNING)


def note(text: str) -> None:
    """Print a note to the standard error output, unless the command is quiet."""
    if has_notes():
        print(text, file=sys.stderr)


def bar(total: float | None, unit: str, name: str) -> AbstractContextManager[Callable[[Any], object] | None]:
    """A bar on a terminal, see `simulation.progress`; None where there is none."""
    from grasp_ros.simulation.progress import showing  # with the compiler, which a graph does not need

    return showing(has_notes(), total, unit, name)


def show(options: argparse.Namespace, text: str, data: Any) -> None:
    """Print a result: its text, or with `--json` its data; on the standard error if a file goes to the output."""
    shown = json.dumps(plain(data), indent=1) if options.json else text
    stream = sys.stderr if getattr(options, "output", None) == STDOUT else sys.stdout
    try:
        print(shown, file=stream)
    except BrokenPipeError:  # the reader, `head` say, has had it; the file of `-o` is still to be written
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # for what is left of the text


def plain(data: Any) -> Any:
    """Data as JSON has it: numbers that are not finite are null."""
    if isinstance(data, Mapping):
        return {str(key): plain(value) for key, value in data.items()}
    if isinstance(data, (np.ndarray, np.generic)):
        return plain(data.tolist())
    if isinstance(data, Sequence) and not isinstance(data, str):
        return [plain(value) for value in data]
    if isinstance(data, float) and not math.isfinite(data):
        return None
    return data if isinstance(data, (str, int, float, bool, type(None))) else str(data)


@contextmanager
def destination(path: Path) -> Iterator[BinaryIO]:
    """The file of `-o`, see `scene.files.replacing`, or the standard output for `-`."""
    if path != STDOUT:
        with replacing(path) as file:
            yield file
        note(f"written to {path}")
        return
    if getattr(sys.stdout, "name", "") == os.devnull:  # it was closed, see `main.run`
        raise Refused("-o -: the standard output is closed")
    sys.stdout.flush()
    yield sys.stdout.buffer
    sys.stdout.buffer.flush()


def write_text(text: str, path: Path) -> None:
    """A text into the file of `-o`."""
    with destination(path) as file:
        file.write(text.encode())


def figure_endings(output: Path | None) -> list[str]:
    """Endings of figures; none, and no matplotlib, without an output."""
    if output is None:
        return []
    from grasp_ros.simulation.canvas import formats

    return formats()


def write_figure(figure: Any, path: Path) -> None:
    """A figure into the file of `-o`; PNG on the standard output."""
    from grasp_ros.simulation.plots import write

    with destination(path) as file:
        write(figure, file, ".png" if path == STDOUT else path.suffix.lower())

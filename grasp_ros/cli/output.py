"""What commands print: results on the standard output, as tables or as JSON, and all else on the standard error."""

from __future__ import annotations

import argparse
import json
import logging
import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import replacing

if TYPE_CHECKING:
    from grasp_ros.simulation.progress import Callback

STDOUT = Path("-")
LOG = logging.getLogger("grasp_ros")  # whose level decides whether there are notes and progress bars


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


def bar(total: float | None, unit: str, name: str) -> AbstractContextManager[Callback | None]:
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

"""What several subcommands do before the work: load a scene, refuse what cannot be written or held, and compile."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.cli.output import STDOUT, note
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.files import format_of, writing

ROW = 16  # numbers that a run keeps for each output time: time, state, commands, energies, and copies


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

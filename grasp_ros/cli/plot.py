"""`grasp plot`: a figure of a bag, of a file of `grasp simulate`, or of a scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import add_command, add_output, check_memory, prepare
from grasp_ros.scene.files import reading
from grasp_ros.simulation import Trajectory, load, simulate


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "plot", _plot, "draw a bag, a file of `grasp simulate`, or a scene")
    sub.add_argument("source", metavar="BAG|FILE.npz|SCENE")
    add_output(sub, "FILE", "image file (default: beside the source)")


def _plot(options: argparse.Namespace) -> int:
    from grasp_ros.graph import bag
    from grasp_ros.simulation import plots

    source = Path(options.source)
    motion: plots.Motion
    with reading(source):
        there, directory = source.exists(), source.is_dir()
    if directory:
        motion, sampled = bag.read(source), True
    else:
        motion = load(source) if source.suffix == ".npz" else _simulated(options.source)
        sampled = motion.sampled
    beside = Path(f"{source.resolve()}.png") if directory else source.with_suffix(".png")
    output = options.output or (beside if there else Path(f"{motion.scene.name}.png"))
    plots.draw(motion, output, motion.scene.feedback_in_words(sampled))
    print(f"written to {output}")
    return 0


def _simulated(reference: str) -> Trajectory:
    scene = scenes.load(reference)
    check_memory(scene, sampled=False)
    prepare()
    return simulate(scene)

"""`grasp plot`: a figure of a bag, of a file of `grasp simulate`, or of a scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from grasp_ros.cli.arguments import (
    add_command,
    add_force,
    add_output,
    check_memory,
    check_output,
    load_scene,
    prepare,
    warn,
)
from grasp_ros.scene.files import reading
from grasp_ros.simulation import Trajectory, load, simulate


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "plot", _plot, "draw a bag, a file of `grasp simulate`, or a scene")
    sub.add_argument("source", metavar="BAG|FILE.npz|SCENE")
    add_output(sub, "FILE", "image file (default: beside the source)")
    add_force(sub)


def _plot(options: argparse.Namespace) -> int:
    from grasp_ros.graph import bag
    from grasp_ros.simulation import plots

    source = Path(options.source)
    motion: plots.Motion
    with reading(source):
        there, directory = source.exists(), source.is_dir()
    beside = Path(f"{source.resolve()}.png") if directory else source.with_suffix(".png")
    output = options.output or (beside if there else Path(f"{source.stem}.png"))
    check_output(output, options.force, [options.source])
    if directory:
        motion, sampled = bag.read(source), True
        warn(motion.scene)
    elif source.suffix == ".npz":
        motion = load(source)
        sampled = motion.sampled
        warn(motion.scene)
    else:
        motion = _simulated(options.source)
        sampled = motion.sampled
    plots.draw(motion, output, motion.scene.feedback_in_words(sampled))
    print(f"written to {output}")
    return 0


def _simulated(reference: str) -> Trajectory:
    scene = load_scene(reference)
    check_memory(scene, sampled=False)
    prepare()
    return simulate(scene)

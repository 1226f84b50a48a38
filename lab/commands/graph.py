"""The studies of the graph and of its recorder: `graph`, `steering` and `recorder`."""

from __future__ import annotations

import argparse
from typing import Any

from grasp_ros.cli.arguments import add_command, add_scene, whole
from grasp_ros.cli.checks import load_scene, prepare

Parser = argparse.ArgumentParser


def add_graph(commands: Any) -> Parser:
    """`python -m lab graph`."""
    text = "ticks a second beside bare rclpy; time to start, to verify"
    sub = add_command(commands, "graph", _graph, text)
    add_scene(sub)
    sub.add_argument("--rounds", type=whole(1), default=5, metavar="N", help="of all graphs in turn (default 5)")
    return sub


def _graph(options: argparse.Namespace) -> int:
    from lab.studies import graph

    scene = load_scene(options.scene, options.settings)
    prepare()
    graph.run(scene, options.rounds)
    return 0


def add_steering(commands: Any) -> Parser:
    """`python -m lab steering`."""
    text = "random pause, step, resume and reset calls, each checked"
    sub = add_command(commands, "steering", _steering, text)
    add_scene(sub)
    sub.add_argument("--calls", type=whole(1), default=1000, metavar="N", help="how many (default 1000)")
    sub.add_argument("--seed", type=whole(0), default=0, help="another seed makes other calls (default 0)")
    return sub


def _steering(options: argparse.Namespace) -> int:
    from lab.drills import steering

    scene = load_scene(options.scene, options.settings)
    prepare()
    return 0 if steering.run(scene, options.calls, options.seed) else 1


def add_recorder(commands: Any) -> Parser:
    """`python -m lab recorder`."""
    sub = add_command(commands, "recorder", _recorder, "recordings are killed: what is left in their bags")
    add_scene(sub)
    sub.add_argument("--kills", type=whole(0), default=10, metavar="N", help="how many recordings (default 10)")
    sub.add_argument("--seed", type=whole(0), default=0, help="another seed kills at other moments (default 0)")
    return sub


def _recorder(options: argparse.Namespace) -> int:
    from lab.drills import recorder

    scene = load_scene(options.scene, options.settings)
    prepare()
    return 0 if recorder.run(scene, options.kills, options.seed) else 1

"""The studies of the graph: `graph`, `steering` and `free-running`."""

from __future__ import annotations

import argparse
import math
from typing import Any

from grasp_ros.cli.arguments import add_command, add_scene, whole
from grasp_ros.cli.checks import load_scene, prepare
from grasp_ros.graph.running import Running
from grasp_ros.physics.errors import Refused

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


def add_free_running(commands: Any) -> Parser:
    """`python -m lab free-running`."""
    text = "a run with the wall clock: states lost, age, jitter"
    sub = add_command(commands, "free-running", _free_running, text)
    add_scene(sub)
    sub.add_argument("--seconds", type=float, default=60.0, metavar="S", help="simulated (default 60)")
    sub.add_argument("--factor", type=float, default=1.0, metavar="F", help="simulated seconds in one (default 1)")
    return sub


def _free_running(options: argparse.Namespace) -> int:
    from lab.drills import free_running

    Running(real_time_factor=options.factor)  # refuses what is wrong
    least = 2.0 * options.factor  # the quality of a second is published when it is over
    if not options.factor or not (math.isfinite(options.seconds) and options.seconds >= least):
        raise Refused(f"--seconds {options.seconds:g} --factor {options.factor:g}: not allowed; allowed: a factor > 0,"
                      " and at least two seconds of wall time")
    scene = load_scene(options.scene, options.settings)
    prepare()
    return 0 if free_running.run(scene, options.seconds, options.factor) else 1

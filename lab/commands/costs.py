"""The studies of what a loop, an effect and a bag cost: `loop`, `effects` and `recorder`."""

from __future__ import annotations

import argparse
from typing import Any

from grasp_ros.cli.arguments import add_command, add_scene, whole
from grasp_ros.cli.checks import load_scene, prepare
from lab.commands.docs import add_docs, page_directory
from lab.commands.shared import add_study_directory

Parser = argparse.ArgumentParser


def add_loop(commands: Any) -> Parser:
    """`python -m lab loop`."""
    text = "control period against deviation, time and stability"
    sub = add_command(commands, "loop", _loop, text)
    add_scene(sub)
    sub.add_argument("--no-graph", action="store_true", help="one process only, without ROS")
    add_study_directory(sub)
    return sub


def _loop(options: argparse.Namespace) -> int:
    from lab.studies import figures, loop, stability

    scene = load_scene(options.scene, options.settings)
    left, right = scene.grasp.left, scene.grasp.right
    prepare()
    periods = () if options.no_graph else loop.GRAPH_PERIODS_MS
    points = loop.run(scene, options.output, periods)
    print(loop.report(points))
    figures.control_period(points, scene.name, options.output / "control_period.png")
    for name, arm in (("left", left), ("right", right)):
        found = stability.limits(arm)
        print("\n" + stability.report(f"{name} arm", found))
        figures.stability(*stability.curves(arm, found), options.output / f"stability_{name}.png")
    print(f"written to {options.output}")
    return 0


def add_effects(commands: Any) -> Parser:
    """`python -m lab effects`."""
    sub = add_command(commands, "effects", _effects, "what each effect costs: counts of work, times, bytes")
    add_docs(sub)
    return sub


def _effects(options: argparse.Namespace) -> int:
    from lab.studies import effects

    docs = page_directory(options, effects.PAGE)
    prepare()
    effects.run(docs)
    return 0


def add_recorder(commands: Any) -> Parser:
    """`python -m lab recorder`."""
    sub = add_command(commands, "recorder", _recorder, "bytes and time a tick of a bag; recordings are killed")
    add_scene(sub)
    sub.add_argument("--kills", type=whole(0), default=10, metavar="N", help="how many recordings (default 10)")
    sub.add_argument("--seed", type=whole(0), default=0, help="another seed kills at other moments (default 0)")
    return sub


def _recorder(options: argparse.Namespace) -> int:
    from lab.drills import recorder

    scene = load_scene(options.scene, options.settings)
    prepare()
    return 0 if recorder.run(scene, options.kills, options.seed) else 1

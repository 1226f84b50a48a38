"""The studies that measure: `speed`, and with a page `accuracy`, `maps`, `effects`, `certificate`, `derivatives`."""

from __future__ import annotations

import argparse
from functools import partial
from importlib import import_module
from typing import Any

from grasp_ros.cli.arguments import add_command, add_scene, whole
from grasp_ros.cli.checks import load_scene, prepare
from lab.commands.shared import add_docs, add_study_directory, page_directory

Parser = argparse.ArgumentParser


def add_accuracy(commands: Any) -> Parser:
    """`python -m lab accuracy`."""
    text = "what accuracy costs: error against time of every method, energy, prediction, control periods; resumes"
    return _add_resumed(commands, "accuracy", "accuracy_page", text)


def add_maps(commands: Any) -> Parser:
    """`python -m lab maps`."""
    return _add_resumed(commands, "maps", "map_page", "where a grasp settles, and how robust it is; resumes")


def _add_resumed(commands: Any, name: str, module: str, text: str) -> Parser:
    """A study that goes on from what it has measured, and whose result is its page."""
    sub = add_command(commands, name, partial(_resume, name, module), text)
    sub.add_argument("--quick", action="store_true", help="a part of it, without ROS and outside peers: to try it out")
    add_docs(sub)
    add_study_directory(sub)
    return sub


def _resume(name: str, module: str, options: argparse.Namespace) -> int:
    study = import_module(f"lab.studies.{module}")
    docs = page_directory(options, name) or options.output
    prepare()
    print(f"written to {study.write(docs, options.output, options.quick)}")
    return 0


def add_effects(commands: Any) -> Parser:
    """`python -m lab effects`."""
    return _add_printed(commands, "effects", "what each effect costs: counts of work, times, bytes")


def add_certificate(commands: Any) -> Parser:
    """`python -m lab certificate`."""
    return _add_printed(commands, "certificate", "where the paper's V jumps; limits of the control period")


def _add_printed(commands: Any, name: str, text: str) -> Parser:
    """A study that prints its numbers, and writes its page where one is wanted."""
    sub = add_command(commands, name, partial(_print, name), text)
    add_docs(sub)
    return sub


def _print(name: str, options: argparse.Namespace) -> int:
    study = import_module(f"lab.studies.{name}")
    docs = page_directory(options, study.PAGE)
    prepare()
    study.run(docs)
    return 0


def add_speed(commands: Any) -> Parser:
    """`python -m lab speed`."""
    sub = add_command(commands, "speed", _speed, "time to one given error, beside the outside peers")
    add_scene(sub)
    sub.add_argument("--error", type=float, default=1e-9, help="largest error in all states (default 1e-9)")
    add_study_directory(sub)
    return sub


def _speed(options: argparse.Namespace) -> int:
    from lab.studies import speed

    scene = load_scene(options.scene, options.settings)
    prepare()
    speed.run(scene, options.error, options.output)
    return 0


def add_derivatives(commands: Any) -> Parser:
    """`python -m lab derivatives`."""
    text = "derivatives through impacts beside the reference, which takes hours and resumes, random scenes, and peers"
    sub = add_command(commands, "derivatives", _derivatives, text)
    sub.add_argument("--table", dest="tables", action="append", choices=("reference", "random", "peers", "cost"),
                     help="one of the page's tables; repeatable (default all but peers)")
    sub.add_argument("--draws", type=whole(1), default=300, metavar="N", help="random scenes (default 300)")
    add_docs(sub)
    add_study_directory(sub)
    return sub


def _derivatives(options: argparse.Namespace) -> int:
    from lab.studies import derivatives

    docs = page_directory(options, "derivatives")
    prepare()
    wanted = options.tables or [name for name in derivatives.TABLES if name != derivatives.PEERS]
    found = derivatives.tables(wanted, options.output, options.draws)
    print("\n\n".join(found.values()))
    if docs is not None:
        print(f"written to {derivatives.write(docs, found)}")
    return 0

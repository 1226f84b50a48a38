"""`grasp`: the command line for everything that needs no ROS, and for starting the four processes together."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.cli import studies as studies
from grasp_ros.exact.integrator import (
    ACCURACY,
    COARSEST,
    FINEST,
    MAX_EVENTS,
    MAX_WORK,
    Integrator,
    Status,
    compile_kernels,
)
from grasp_ros.exact.jit import COMPILING, kernels_on_disk
from grasp_ros.methods.contract import ACCURACY_KNOB, STEP, TOLERANCE, UNITS
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.simulation import GRID_POINTS, Trajectory, load, simulate

Command = Callable[[argparse.Namespace], int]


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point of `grasp`; returns the exit status: 0, 1 if a run failed, 2 for input that is refused."""
    options = _parser().parse_args(arguments)
    command: Command = options.command
    try:
        return command(options)
    except BrokenPipeError:  # the reader of our output, `head` say, has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (ValueError, OSError, MemoryError) as error:
        print(f"grasp: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("grasp: interrupted", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="grasp", description="Simulate, run, inspect and draw a colliding grasp.")
    commands = parser.add_subparsers(required=True, metavar="command")

    def add(name: str, command: Command, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text)
        sub.set_defaults(command=command)
        return sub

    add("scenes", _scenes, "list the scenes that come with the package")
    add("methods", _methods, "list the methods of integration: order, source, what each does at a touch")
    sub = add("simulate", _simulate, "simulate a scene without ROS")
    _add_scene(sub)
    _add_accuracy(sub)
    sub.add_argument("--grid", type=_whole(2), metavar="N", help=f"equidistant output times (default {GRID_POINTS})")
    sub.add_argument("--sampled", action="store_true", help="hold each command over a control period, as a graph does")
    _add_method(sub)
    sub.add_argument("--max-events", type=_whole(1), default=MAX_EVENTS, metavar="N",
                     help=f"budget of contact events (default {MAX_EVENTS})")
    sub.add_argument("--max-work", type=_whole(1), default=MAX_WORK, metavar="N",
                     help=f"budget of flights, Taylor steps and event evaluations (default {MAX_WORK})")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.npz", help="write states, events, V and counters")
    sub = add("run", _run, "run a scene in four ROS 2 processes and record a bag")
    _add_scene(sub)
    _add_accuracy(sub)
    sub.add_argument("-o", "--output", type=Path, metavar="DIRECTORY", help="new directory for the scene and the bag")
    sub = add("inspect", _inspect, "print what is in a bag")
    sub.add_argument("bag", type=Path)
    sub.add_argument("--replay", action="store_true", help="simulate it again without ROS, and compare every bit")
    _add_accuracy(sub)
    sub = add("plot", _plot, "draw a bag, a file of `grasp simulate`, or a scene")
    sub.add_argument("source", metavar="BAG|FILE.npz|SCENE")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE", help="image file (default: beside the source)")
    study = commands.add_parser("study", help="measure, and print what was measured")
    studies.add_to(study.add_subparsers(required=True, metavar="study"), _add_scene, _prepare)
    return parser


def _add_scene(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("scene", help="a name that `grasp scenes` lists, or the path of a .yaml file")
    sub.add_argument(
        "--set", dest="settings", action="append", default=[], metavar="section.key=value", help="replace a number"
    )


def _add_accuracy(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "--accuracy", type=float, default=ACCURACY, metavar="A",
        help=f"first neglected term of a contact, relative, {FINEST:g} to {COARSEST:g} (default {ACCURACY:g})",
    )


def _add_method(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--method", choices=METHODS, default=EXACT, help="way to integrate; see `grasp methods`")
    setting = sub.add_mutually_exclusive_group()
    setting.add_argument("--step", type=float, metavar="S", help="step in s of a method with a fixed step")
    setting.add_argument("--tolerance", type=float, metavar="T", help="tolerance (rtol = atol) of an adaptive method")


def _setting(options: argparse.Namespace) -> float | None:
    """The number that belongs to the method's knob; one that belongs to another knob is refused."""
    given = {STEP: options.step, TOLERANCE: options.tolerance, ACCURACY_KNOB: options.accuracy}
    knob = METHODS[options.method].knob
    for other, number in given.items():
        if other != knob and number not in (None, ACCURACY):
            raise ValueError(f"--{other} is not allowed; allowed for {options.method}: --{knob}")
    return None if given[knob] is None else float(given[knob])


def _whole(least: int) -> Callable[[str], int]:
    """Reads a whole number from a command line."""
    def read(word: str) -> int:
        if not word.isdecimal() or int(word) < least:
            raise argparse.ArgumentTypeError(f"{word} is not allowed; allowed: a whole number >= {least}")
        return int(word)

    return read


def _prepare() -> None:
    if not kernels_on_disk():
        print(COMPILING, file=sys.stderr)
    compile_kernels()


def _scenes(_: argparse.Namespace) -> int:
    for name in scenes.names():
        print(f"{name}  {scenes.load(name).title}")
    return 0


def _methods(_: argparse.Namespace) -> int:
    for name, method in METHODS.items():
        print(f"{name}\n  order: {method.order}\n  source: {method.source}\n  at a touch: {method.at_touch}")
        print(f"  --{method.knob}, default {method.default:g}{UNITS[method.knob]}")
    return 0


def _simulate(options: argparse.Namespace) -> int:
    from grasp_ros.cli.report import describe_trajectory, table

    scene = scenes.load(options.scene, options.settings)
    _prepare()
    grid = None if options.grid is None else np.linspace(0.0, scene.duration, options.grid)
    quick = not (options.sampled or scene.sampled)
    with tqdm(total=scene.duration, unit="s", desc=scene.name, disable=quick, delay=1.0) as bar:
        trajectory = simulate(
            scene, grid=grid, sampled=options.sampled, method=options.method, setting=_setting(options),
            max_events=options.max_events, max_work=options.max_work,
            progress=lambda reached: bar.update(reached - bar.n),
        )
    print(table(describe_trajectory(trajectory)))
    if options.output is not None:
        trajectory.save(options.output)
        print(f"written to {options.output}")
    return 0 if trajectory.status is Status.DONE else 1


def _run(options: argparse.Namespace) -> int:
    from grasp_ros.cli import report
    from grasp_ros.graph import bag
    from grasp_ros.graph.processes import STOP_SIGNALS, Graph, GraphError
    from grasp_ros.simulation import plots

    scene = scenes.load(options.scene, options.settings)
    directory = options.output or Path("runs") / f"{scene.name}_{datetime.now():%Y_%m_%d-%H_%M_%S}"
    Integrator(scene.system, continuous=False, accuracy=options.accuracy)  # refuses what is wrong
    _prepare()
    graph = Graph(scene, directory, options.accuracy, progress=True)
    received: list[int] = []
    for number in STOP_SIGNALS:  # only noted: an exception could leave a process behind
        signal.signal(number, lambda which, _: received.append(which))
    begin = time.monotonic()
    try:
        graph.start()
        graph.wait(received)
    except GraphError as error:
        print(f"grasp: {error}", file=sys.stderr)
        return 1
    finally:
        graph.stop()
        for number in STOP_SIGNALS:
            signal.signal(number, signal.default_int_handler)
    seconds = time.monotonic() - begin
    if not (graph.bag / "metadata.yaml").exists():
        print("interrupted before the first tick: no bag")
        return 0
    recording = bag.read(graph.bag)
    rows = report.describe_recording(recording)
    whole = True
    if not received:
        comparison = report.compare_recording(recording, options.accuracy)
        whole = comparison.equal and not recording.alarms and not any(recording.missing.values())
        figure = directory / "figure.png"
        plots.draw(recording, figure, scene.feedback_in_words(sampled=True))
        rows += [*comparison.rows, ("figure", str(figure))]
    print(report.table([*rows, ("wall time", f"{seconds:.1f} s with start and stop")]))
    return 0 if whole else 1


def _inspect(options: argparse.Namespace) -> int:
    from grasp_ros.cli import report
    from grasp_ros.graph import bag

    recording = bag.read(options.bag)
    rows, equal = report.describe_recording(recording), True
    if options.replay:
        _prepare()
        comparison = report.compare_recording(recording, options.accuracy)
        rows, equal = rows + comparison.rows, comparison.equal
    print(report.table(rows))
    return 0 if equal else 1


def _plot(options: argparse.Namespace) -> int:
    from grasp_ros.graph import bag
    from grasp_ros.simulation import plots

    source = Path(options.source)
    motion: plots.Motion
    if source.is_dir():
        motion, sampled = bag.read(source), True
    else:
        motion = load(source) if source.suffix == ".npz" else _simulated(options.source)
        sampled = motion.sampled
    beside = Path(f"{source.resolve()}.png") if source.is_dir() else source.with_suffix(".png")
    output = options.output or (beside if source.exists() else Path(f"{motion.scene.name}.png"))
    plots.draw(motion, output, motion.scene.feedback_in_words(sampled))
    print(f"written to {output}")
    return 0


def _simulated(reference: str) -> Trajectory:
    scene = scenes.load(reference)
    _prepare()
    return simulate(scene)

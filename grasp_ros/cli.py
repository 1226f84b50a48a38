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
from grasp_ros.physics.integrator import ACCURACY, COARSEST, FINEST, Integrator, Status, compile_kernels
from grasp_ros.physics.jit import COMPILING, kernels_on_disk
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
    sub = add("simulate", _simulate, "simulate a scene without ROS")
    _add_scene(sub)
    sub.add_argument("--grid", type=_grid, metavar="N", help=f"equidistant output times (default {GRID_POINTS})")
    sub.add_argument("--sampled", action="store_true", help="hold each command over a control period, as a graph does")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.npz", help="write states, events, V and counters")
    sub = add("run", _run, "run a scene in four ROS 2 processes and record a bag")
    _add_scene(sub)
    sub.add_argument("-o", "--output", type=Path, metavar="DIRECTORY", help="new directory for the scene and the bag")
    sub = add("inspect", _inspect, "print what is in a bag")
    sub.add_argument("bag", type=Path)
    sub = add("plot", _plot, "draw a bag, a file of `grasp simulate`, or a scene")
    sub.add_argument("source", metavar="BAG|FILE.npz|SCENE")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE", help="image file (default: beside the source)")
    studies = commands.add_parser("study", help="measure, and print what was measured").add_subparsers(
        required=True, metavar="study"
    )
    sub = studies.add_parser("speed", help="time to a given error, beside other solvers")
    sub.set_defaults(command=_study_speed)
    _add_scene(sub)
    sub.add_argument("--error", type=float, default=1e-9, help="largest error in all states (default 1e-9)")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write the records")
    sub = studies.add_parser("effects", help="what each effect costs: time and size of the bag")
    sub.set_defaults(command=_study_effects)
    _add_scene(sub)
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="put table and figure into this text")
    sub = studies.add_parser("certificate", help="where the paper's V jumps, from which p on, and limits of the period")
    sub.set_defaults(command=_study_certificate)
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="put tables and figure into this text")
    sub = studies.add_parser("hard", help="hard cases: what decides, the figure reached, and other solvers beside it")
    sub.set_defaults(command=_study_hard)
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="put table and figure into this text")
    sub.add_argument("--alone", action="store_true", help="without other solvers, which takes a minute instead of ten")
    sub = studies.add_parser("fuzz", help="random scenes against all properties")
    sub.set_defaults(command=_study_fuzz)
    sub.add_argument("--seconds", type=float, default=60.0, help="how long (default 60)")
    sub.add_argument("--seed", type=int, default=0, help="another seed draws other scenes (default 0)")
    sub.add_argument("-o", "--output", type=Path, default=Path("fuzz"), metavar="DIRECTORY",
                     help="where scenes that fail are written (default fuzz)")
    sub = studies.add_parser("graph", help="lockstep ticks per second, beside a bare rclpy graph")
    sub.set_defaults(command=_study_graph)
    _add_scene(sub)
    return parser


def _add_scene(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("scene", help="a name that `grasp scenes` lists, or the path of a .yaml file")
    sub.add_argument(
        "--set", dest="settings", action="append", default=[], metavar="section.key=value", help="replace a number"
    )
    sub.add_argument(
        "--accuracy", type=float, default=ACCURACY, metavar="A",
        help=f"first neglected term of a contact, relative, {FINEST:g} to {COARSEST:g} (default {ACCURACY:g})",
    )


def _grid(word: str) -> int:
    number = int(word)
    if number < 2:
        raise argparse.ArgumentTypeError(f"{word} is not allowed; allowed: a whole number >= 2")
    return number


def _prepare() -> None:
    if not kernels_on_disk():
        print(COMPILING, file=sys.stderr)
    compile_kernels()


def _scenes(_: argparse.Namespace) -> int:
    for name in scenes.names():
        print(f"{name}  {scenes.load(name).title}")
    return 0


def _simulate(options: argparse.Namespace) -> int:
    from grasp_ros.report import describe_trajectory, table

    scene = scenes.load(options.scene, options.settings)
    _prepare()
    grid = None if options.grid is None else np.linspace(0.0, scene.duration, options.grid)
    quick = not (options.sampled or scene.sampled)
    with tqdm(total=scene.duration, unit="s", desc=scene.name, disable=quick, delay=1.0) as bar:
        trajectory = simulate(
            scene, grid=grid, sampled=options.sampled, accuracy=options.accuracy,
            progress=lambda reached: bar.update(reached - bar.n),
        )
    print(table(describe_trajectory(trajectory)))
    if options.output is not None:
        trajectory.save(options.output)
        print(f"written to {options.output}")
    return 0 if trajectory.status is Status.DONE and not trajectory.alarm else 1


def _run(options: argparse.Namespace) -> int:
    from grasp_ros import bag, plots, report
    from grasp_ros.graph import STOP_SIGNALS, Graph, GraphError

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
        whole = comparison.equal and not any(recording.missing.values())
        figure = directory / "figure.png"
        plots.draw(recording, figure, scene.feedback_in_words(sampled=True))
        rows += [*comparison.rows, ("figure", str(figure))]
    print(report.table([*rows, ("wall time", f"{seconds:.1f} s with start and stop")]))
    return 0 if whole else 1


def _inspect(options: argparse.Namespace) -> int:
    from grasp_ros import bag, report

    print(report.table(report.describe_recording(bag.read(options.bag))))
    return 0


def _plot(options: argparse.Namespace) -> int:
    from grasp_ros import bag, plots

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


def _study_speed(options: argparse.Namespace) -> int:
    from grasp_ros.studies import speed

    _prepare()
    speed.run(scenes.load(options.scene, options.settings), options.error, options.output)
    return 0


def _study_effects(options: argparse.Namespace) -> int:
    from grasp_ros.studies import effects

    _prepare()
    effects.run(scenes.load(options.scene, options.settings), options.output)
    return 0


def _study_certificate(options: argparse.Namespace) -> int:
    from grasp_ros.studies import certificate

    _prepare()
    certificate.run(options.output)
    return 0


def _study_hard(options: argparse.Namespace) -> int:
    from grasp_ros.hard import study

    _prepare()
    return study.run(options.output, alone=options.alone)


def _study_fuzz(options: argparse.Namespace) -> int:
    from grasp_ros.hard import fuzz

    _prepare()
    return 1 if fuzz.run(options.seconds, options.seed, options.output) else 0


def _study_graph(options: argparse.Namespace) -> int:
    from grasp_ros.studies import graph

    _prepare()
    graph.run(scenes.load(options.scene, options.settings), options.accuracy)
    return 0


def _simulated(reference: str) -> Trajectory:
    scene = scenes.load(reference)
    _prepare()
    return simulate(scene)


if __name__ == "__main__":
    sys.exit(main())

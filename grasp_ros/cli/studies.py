"""The subcommands of `grasp study`."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene

DIRECTORY = Path("runs") / "studies"
DRIFT_QUICK_S = 20.0


def add_to(
    studies: Any, add_scene: Callable[[argparse.ArgumentParser], None], prepare: Callable[[], None]
) -> None:
    """Add all studies to the parser of `grasp study`; `prepare` compiles what one needs when it runs."""
    def add(name: str, command: Callable[[argparse.Namespace], int], text: str) -> argparse.ArgumentParser:
        sub: argparse.ArgumentParser = studies.add_parser(name, help=text, description=text)
        sub.set_defaults(command=partial(_with_packages, command), prepare=prepare)
        return sub

    sub = add("accuracy", _accuracy, "error against time of every method: records, tables, figures; resumes")
    _add_scenes(sub)
    sub.add_argument("--quick", action="store_true", help="few settings, our own compiled methods only")
    sub = add("advise", _advise, "which method, with which setting, measured on this machine")
    add_scene(sub)
    sub.add_argument("--error", type=float, help="largest error that is acceptable, in all states (m, m/s)")
    sub.add_argument("--budget", type=float, metavar="SECONDS", help="longest time that a simulation may take")
    sub.add_argument("--quick", action="store_true", help="fewer settings: an answer in seconds")
    _add_directory(sub)
    sub = add("loop", _loop, "control period against deviation and wall time; largest stable period")
    add_scene(sub)
    sub.add_argument("--no-graph", action="store_true", help="one process only, without ROS")
    _add_directory(sub)
    sub = add("prediction", _prediction, "how far ahead each scene can be predicted in double precision")
    _add_scenes(sub)
    sub = add("page", _page, "run all studies and write docs/accuracy.md with its figures; resumes")
    sub.add_argument("--docs", type=Path, default=Path("docs"), metavar="DIRECTORY", help="default: docs")
    sub.add_argument("--quick", action="store_true", help="few settings, short runs, no graph: to see that it works")
    _add_directory(sub)
    sub = add("speed", _speed, "time to one given error, solvers in turn, beside the outside peers")
    add_scene(sub)
    sub.add_argument("--error", type=float, default=1e-9, help="largest error in all states (default 1e-9)")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="write the records")
    sub = add("effects", _effects, "what each effect costs: time and size of the bag")
    add_scene(sub)
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="put table and figure into this text")
    sub = add("certificate", _certificate, "where the paper's V jumps, from which p on, and limits of the period")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="put tables and figure into this text")
    sub = add("hard", _hard, "hard cases, family by family: the error reached, and other solvers beside it")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.md", help="put table and figure into this text")
    sub.add_argument("--alone", action="store_true", help="without other solvers, which takes a minute instead of ten")
    sub = add("fuzz", _fuzz, "random scenes against all properties")
    sub.add_argument("--seconds", type=float, default=60.0, help="how long (default 60)")
    sub.add_argument("--seed", type=int, default=0, help="another seed draws other scenes (default 0)")
    sub.add_argument("-o", "--output", type=Path, default=Path("fuzz"), metavar="DIRECTORY",
                     help="where scenes that fail are written (default fuzz)")
    sub = add("graph", _graph, "lockstep ticks per second, beside a bare rclpy graph")
    add_scene(sub)


def _with_packages(command: Callable[[argparse.Namespace], int], options: argparse.Namespace) -> int:
    try:
        return command(options)
    except ModuleNotFoundError as error:
        raise ValueError(f"this study needs {error.name}; pip install 'grasp_ros[study]'") from None


def _add_scenes(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("scenes", nargs="*", metavar="SCENE", help="default: cases 1 to 4, and case 1 with H = 1e8")
    sub.add_argument(
        "--set", dest="settings", action="append", default=[], metavar="section.key=value", help="replace a number"
    )
    _add_directory(sub)


def _add_directory(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        "-o", "--output", type=Path, default=DIRECTORY, metavar="DIRECTORY",
        help=f"records, tables and figures; what is there is not measured again (default {DIRECTORY})",
    )


def _subjects(options: argparse.Namespace) -> Sequence[Scene]:
    from grasp_ros.studies import accuracy

    if options.settings and not options.scenes:
        raise ValueError("--set: allowed: with a SCENE")
    return [scenes.load(name, options.settings) for name in options.scenes] or accuracy.default_scenes()


def _accuracy(options: argparse.Namespace) -> int:
    from grasp_ros.studies import accuracy, drift, figures, measure
    from grasp_ros.studies.contenders import all_contenders

    options.prepare()
    effort = measure.QUICK if options.quick else measure.FULL
    contenders = accuracy.quick_contenders() if options.quick else all_contenders()
    records = accuracy.run(_subjects(options), options.output, effort, contenders)
    print(accuracy.report(records))
    figures.work_precision(records, accuracy.METRIC, options.output / "error_against_time.png")
    figures.contacts_missed(records, options.output / "contacts_missed.png")
    if not options.scenes:
        drifts = drift.run(options.output, DRIFT_QUICK_S if options.quick else drift.SECONDS)
        print("\n" + drift.report(drifts))
        figures.energy_drift(drifts, options.output / "energy_drift.png")
    print(f"written to {options.output}")
    return 0


def _advise(options: argparse.Namespace) -> int:
    from grasp_ros.studies import adviser

    options.prepare()
    scene = scenes.load(options.scene, options.settings)
    advice, text = adviser.run(scene, options.output, options.error, options.budget, options.quick)
    print(text)
    return 0 if advice.choice is not None else 1


def _loop(options: argparse.Namespace) -> int:
    from grasp_ros.studies import figures, loop, stability

    options.prepare()
    scene = scenes.load(options.scene, options.settings)
    left, right = scene.grasp.left, scene.grasp.right
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


def _prediction(options: argparse.Namespace) -> int:
    from grasp_ros.studies import figures, predictability

    options.prepare()
    options.output.mkdir(parents=True, exist_ok=True)
    predictions = predictability.run(_subjects(options))
    print(predictability.report(predictions))
    figures.prediction(predictions, options.output / "prediction.png")
    print(f"written to {options.output}")
    return 0


def _page(options: argparse.Namespace) -> int:
    from grasp_ros.studies import page

    options.prepare()
    print(f"written to {page.write(options.docs, options.output, options.quick)}")
    return 0


def _speed(options: argparse.Namespace) -> int:
    from grasp_ros.studies import speed

    options.prepare()
    speed.run(scenes.load(options.scene, options.settings), options.error, options.output, DIRECTORY)
    return 0


def _effects(options: argparse.Namespace) -> int:
    from grasp_ros.studies import effects

    options.prepare()
    effects.run(scenes.load(options.scene, options.settings), options.output)
    return 0


def _certificate(options: argparse.Namespace) -> int:
    from grasp_ros.studies import certificate

    options.prepare()
    certificate.run(options.output)
    return 0


def _hard(options: argparse.Namespace) -> int:
    from grasp_ros.studies import hard as study

    options.prepare()
    return study.run(options.output, alone=options.alone)


def _fuzz(options: argparse.Namespace) -> int:
    from grasp_ros.verification import fuzz

    if not (math.isfinite(options.seconds) and options.seconds > 0.0):
        raise ValueError(f"--seconds {options.seconds!r} is not allowed; allowed: a number > 0")
    if options.seed < 0:
        raise ValueError(f"--seed {options.seed} is not allowed; allowed: a whole number >= 0")
    options.prepare()
    return 1 if fuzz.run(options.seconds, options.seed, options.output) else 0


def _graph(options: argparse.Namespace) -> int:
    from grasp_ros.studies import graph

    options.prepare()
    graph.run(scenes.load(options.scene, options.settings))
    return 0

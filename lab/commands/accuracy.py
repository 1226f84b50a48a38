"""The studies of error against time: `accuracy`, `prediction`, `derivatives` and `speed`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from grasp_ros.cli.arguments import add_command, add_output, add_scene, add_settings, whole
from grasp_ros.cli.checks import load_scene, prepare
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.scene.files import writing
from lab.commands.docs import add_docs, page_directory
from lab.commands.shared import STUDY_DIRECTORY, add_study_directory

DRIFT_QUICK_S = 20.0
Parser = argparse.ArgumentParser


def add_accuracy(commands: Any) -> Parser:
    """`python -m lab accuracy`."""
    text = "error against time of every method; resumes"
    sub = add_command(commands, "accuracy", _accuracy, text)
    _add_scenes(sub)
    sub.add_argument("--quick", action="store_true", help="few settings, our own compiled methods only")
    add_docs(sub)
    return sub


def _accuracy(options: argparse.Namespace) -> int:
    from lab.studies import accuracy, drift, figures, measure
    from lab.studies.contenders import all_contenders

    subjects = _subjects(options)
    if docs := page_directory(options, "accuracy"):
        return _accuracy_page(options, docs)
    prepare()
    effort = measure.QUICK if options.quick else measure.FULL
    contenders = accuracy.quick_contenders() if options.quick else all_contenders()
    records = accuracy.run(subjects, options.output, effort, contenders)
    print(accuracy.report(records))
    figures.work_precision(records, accuracy.METRIC, options.output / "error_against_time.png")
    figures.contacts_missed(records, options.output / "contacts_missed.png")
    if not options.scenes:
        drifts = drift.run(options.output, DRIFT_QUICK_S if options.quick else drift.SECONDS)
        print("\n" + drift.report(drifts))
        figures.energy_drift(drifts, options.output / "energy_drift.png")
    print(f"written to {options.output}")
    return 0


def _accuracy_page(options: argparse.Namespace, docs: Path) -> int:
    from lab.studies import accuracy_page

    if options.scenes:
        raise Refused("--docs: allowed: without a SCENE, because the page has its own")
    prepare()
    print(f"written to {accuracy_page.write(docs, options.output, options.quick)}")
    return 0


def add_prediction(commands: Any) -> Parser:
    """`python -m lab prediction`."""
    text = "how far ahead a scene can be predicted in doubles"
    sub = add_command(commands, "prediction", _prediction, text)
    _add_scenes(sub)
    return sub


def _prediction(options: argparse.Namespace) -> int:
    from lab.studies import figures, predictability

    subjects = _subjects(options)
    with writing(options.output):
        options.output.mkdir(parents=True, exist_ok=True)
    prepare()
    predictions = predictability.run(subjects)
    print(predictability.report(predictions))
    figures.prediction(predictions, options.output / "prediction.png")
    print(f"written to {options.output}")
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


def add_speed(commands: Any) -> Parser:
    """`python -m lab speed`."""
    text = "time to one given error, beside the outside peers"
    sub = add_command(commands, "speed", _speed, text)
    add_scene(sub)
    sub.add_argument("--error", type=float, default=1e-9, help="largest error in all states (default 1e-9)")
    add_output(sub, "FILE.json", "write the records")
    return sub


def _speed(options: argparse.Namespace) -> int:
    from lab.studies import speed

    scene = load_scene(options.scene, options.settings)
    prepare()
    speed.run(scene, options.error, options.output, STUDY_DIRECTORY)
    return 0


def _add_scenes(sub: Parser) -> None:
    sub.add_argument("scenes", nargs="*", metavar="SCENE", help="default: cases 1 to 4, and case 1 with H = 1e8")
    add_settings(sub)
    add_study_directory(sub)


def _subjects(options: argparse.Namespace) -> Sequence[Scene]:
    from lab.studies import accuracy

    if options.settings and not options.scenes:
        raise Refused("--set: allowed: with a SCENE")
    return [load_scene(name, options.settings) for name in options.scenes] or accuracy.default_scenes()

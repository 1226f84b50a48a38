"""`grasp accuracy`: what accuracy costs on a scene and on this machine, and the setting to take."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from grasp_ros.accuracy import measure
from grasp_ros.accuracy.measure import DONE, SECONDS, Advice, Record, Truth, by_method, fastest
from grasp_ros.cli.arguments import add_command, add_file, add_json, add_scene
from grasp_ros.cli.checks import check_output, load_scene, prepare
from grasp_ros.cli.output import bar, figure_endings, show, write_figure
from grasp_ros.methods.contract import UNITS
from grasp_ros.physics.errors import Refused

TARGETS = (1e-3, 1e-6, 1e-9)
MOST_SECONDS = 3600.0


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "accuracy", _accuracy)
    add_scene(sub)
    sub.add_argument("--error", type=float, metavar="E", help="largest error that you accept, in all states (m, m/s);"
                     f" default {TARGETS[-1]:g}, without a failure where nothing reaches it")
    sub.add_argument("--budget", type=float, metavar="S", help="longest time in s that a simulation may take")
    sub.add_argument("--seconds", type=float, default=SECONDS, metavar="S",
                     help=f"time in s after which no measurement begins (default {SECONDS:g})")
    add_file(sub, "FIGURE", "draw error against time, .png, .svg or .pdf; - is the standard output")
    add_json(sub)


def _accuracy(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene, options.settings)
    if not 0.0 < options.seconds <= MOST_SECONDS:
        raise Refused(f"--seconds {options.seconds!r} is not allowed; allowed: > 0 and <= {MOST_SECONDS:g}")
    wished = options.error is not None or options.budget is not None
    if not wished:
        options.error = TARGETS[-1]
    measure.check_wish(options.error, options.budget)
    check_output(options.output, figure_endings(options.output), options.force, [options.scene])
    contenders, others = measure.own_contenders(scene)
    prepare()
    truth = measure.finest(scene)
    with bar(options.seconds, "s", scene.name) as progress:
        records, late = measure.compare(scene, contenders, truth, seconds=options.seconds, progress=progress)
    advice = measure.advise(records, options.error, options.budget)
    again = " ".join([options.scene, *(f"--set {setting}" for setting in options.settings)])
    more = [f"after {options.seconds:g} s not all settings were measured, --seconds allows more: {', '.join(late)}"]
    text = [*_table(truth, records), *(more if late else []), *_not_here(others),
            *_advice(again, options, advice)]
    show(options, "\n".join(text), {
        "scene": scene.name, "uncertainty": truth.uncertainty, "touches": truth.touches, "not_here": others,
        "unfinished": late, "records": [record._asdict() for record in records],
        "take": advice.choice and advice.choice._asdict()})
    if options.output is not None:
        from grasp_ros.accuracy.figure import error_against_time

        write_figure(error_against_time(scene, truth, records, advice, options.error, options.budget), options.output)
    return 1 if wished and advice.choice is None else 0


def _not_here(others: Mapping[str, str]) -> list[str]:
    """A line for each reason, with the names of all methods that it is of."""
    alike: dict[str, list[str]] = {}
    for name, reason in others.items():
        alike.setdefault(reason.removeprefix(f"{name}: "), []).append(name)
    return [f"not here: {', '.join(names)}: {reason}" for reason, names in alike.items()]


def _table(truth: Truth, records: Sequence[Record]) -> list[str]:
    """A line for each method: milliseconds to some errors, its best error, and how often it fails."""
    heads = "".join(f"{f'<= {target:.0e}':>11}" for target in TARGETS)
    lines = [
        f"truth: exact at its finest, known to {truth.uncertainty:.1e} m and m/s in double precision",
        f"{'ms to an error of':<20}{heads}{'best error':>12}  at",
    ]
    for name, group in by_method(records).items():
        found = [fastest(group, target) for target in TARGETS]
        cells = "".join(f"{'-' if record is None else f'{1e3 * record.time:.3g}':>11}" for record in found)
        best = min((record for record in group if record.sound), key=lambda record: record.error or 0.0, default=None)
        failed = "no usable run" if group[-1].status == DONE else group[-1].status
        end = f"{'-':>12}  {failed}" if best is None else (
            f"{best.error:>12.1e}  {best.knob} {best.setting:g}{UNITS[best.knob]}")
        unsound = sum(not record.sound for record in group)
        wrong = f"; {unsound} of {len(group)} runs stop or count touches wrongly" if unsound else ""
        lines.append(f"{name:<20}{cells}{end}{wrong}")
    return lines


def _advice(scene: str, options: argparse.Namespace, advice: Advice) -> list[str]:
    """What to take."""
    choice = advice.choice
    if choice is None:
        wish = f"a time of {options.budget:g} s" if options.error is None else f"an error of {options.error:g}"
        return [f"no method reaches {wish}; closest: {_in_words(advice.closest)}"]
    return [
        f"take: {_in_words(choice)}", *(f"or:   {_in_words(record)}" for record in advice.others),
        f"grasp simulate {scene} --method {choice.method} --{choice.knob} {choice.setting:g}",
    ]


def _in_words(record: Record) -> str:
    setting = f"{record.knob} {record.setting:g}{UNITS[record.knob]}"
    return f"{record.method}, {setting}: error {record.error:.1e} in {1e3 * record.time:.3g} ms"

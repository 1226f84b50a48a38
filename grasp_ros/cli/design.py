"""`grasp design`: numbers of a scene, chosen for an outcome."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from grasp_ros.cli.arguments import add_accuracy, add_command, add_file, add_json, add_scene, named, whole
from grasp_ros.cli.checks import check_output, load_scene, prepare
from grasp_ros.cli.output import bar, figure_endings, show, write_figure, write_text
from grasp_ros.cli.report import table
from grasp_ros.maps.plan import read_axis
from grasp_ros.optimization.search import Design, DesignProblem, front, read_bound, search
from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import YAML
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.outcomes import GROUPS

END = "  an end of its range: a wider one may have a better choice"
NO_EFFECT = "  no effect: no value of its range changes the outcome"
SAME = 1e-12  # relative, of outcomes
POINTS = 9  # values over a range, which show whether a number has an effect
INSIDE = np.array([1e-6, 1.0 - 1e-6])  # the part of a range that is not its ends
RANGE = "section.key[+section.key]=low:high[::log]"


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "design", _design)
    add_scene(sub)
    sub.add_argument("--free", action="append", required=True, metavar=RANGE,
                     help="parameter to choose within a range; + between keys that share one value; repeatable")
    sub.add_argument("--minimise", action="append", required=True, metavar="OUTCOME",
                     help=f"outcome to minimise: the largest column of one of {', '.join(GROUPS)}, or one column;"
                     " given twice: the Pareto front of both")
    sub.add_argument("--subject-to", action="append", default=[], metavar="OUTCOME<=NUMBER", dest="bounds",
                     help="largest value of an outcome, or of every column of a group")
    sub.add_argument("--sampled", action="store_true", help="hold each command over a control period, as a graph does")
    sub.add_argument("--seed", type=whole(0), default=0, metavar="S", help="seed of the search (default 0)")
    sub.add_argument("--figure", type=named, metavar="FIGURE",
                     help="draw the outcome along each number, or two outcomes")
    add_accuracy(sub)
    add_file(sub, "FILE.yaml", "write the scene with the numbers chosen; - is the standard output")
    add_json(sub)


def _design(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene, options.settings)
    setup = Setup(accuracy=options.accuracy, sampled=options.sampled)
    problem = DesignProblem(scene, [read_axis("--free", text, grid=False) for text in options.free], options.minimise,
                            [read_bound(text) for text in options.bounds], setup)
    check_output(options.output, YAML, options.force, [options.scene])
    check_output(options.figure, figure_endings(options.figure), options.force, [options.scene])
    several = len(options.minimise) == 2
    if several and options.output is not None:
        raise Refused("-o: allowed: with one --minimise, which has one best choice; the table lists all choices of two")
    prepare()
    with bar(None, "run", scene.name) as progress:
        found: Sequence[Design] = (
            front(problem, options.seed, progress=progress) if several
            else [search(problem, options.seed, progress=progress)])
    show(options, "\n".join(_table(problem, found)), {
        "scene": scene.name, "units": problem.units, "choices": [
            {"numbers": own.numbers, "outcomes": own.outcomes, "runs": own.runs} for own in found]})
    if options.output is not None:
        write_text(found[0].scene.to_yaml(), options.output)
    if options.figure is not None:
        from grasp_ros.optimization import figure

        write_figure(figure.tradeoff(problem, found) if several else figure.around(problem, found[0]), options.figure)
    return 0


def _table(problem: DesignProblem, found: Sequence[Design]) -> list[str]:
    """A column for each free number and outcome, a row for each choice; of one choice a line for each of them."""
    units = {name: "" if unit == "1" else f" {unit}" for name, unit in problem.units.items()}
    if len(found) == 1:
        numbers = found[0].numbers
        ends = {key for axis in problem.axes for low, high in [axis.at(INSIDE)] for key in axis.keys
                if not low < numbers[key] < high}
        notes = {**dict.fromkeys(ends, END), **dict.fromkeys(_without_effect(problem, found[0]), NO_EFFECT)}
        rows = [*((key, f"{value:.10g}{notes.get(key, '')}") for key, value in numbers.items()),
                *((name, f"{value:.10g}{units[name]}") for name, value in found[0].outcomes.items()),
                ("simulations", str(found[0].runs))]
        return [table(rows)]
    heads = [*(f"{name},{unit}" if unit else name for name, unit in units.items()),
             *(axis.name for axis in problem.axes)]
    lines = [[*(f"{own.outcomes[name]:.6g}" for name in units),
              *(f"{own.numbers[axis.keys[0]]:.8g}" for axis in problem.axes)] for own in found]
    widths = [max(map(len, column)) for column in zip(heads, *lines, strict=True)]
    return ["  ".join(f"{cell:>{width}}" for cell, width in zip(line, widths, strict=True)) for line in [heads, *lines]]


def _without_effect(problem: DesignProblem, choice: Design) -> list[str]:
    """Free numbers that the outcome does not depend on, with the others as they were chosen."""
    keys: list[str] = []
    name = problem.minimise[0]
    for axis in problem.axes:
        found = problem.along(axis, choice.numbers, POINTS)[1]
        same = np.isclose(found.outcomes[name], choice.outcomes[name], rtol=SAME, atol=0.0)
        if same.all() and not found.excess.any():
            keys += axis.keys
    return keys

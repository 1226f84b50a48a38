"""`grasp simulate` and `methods`: a run without ROS, and the ways to integrate it."""

from __future__ import annotations

import argparse
import os
from contextlib import suppress
from typing import Any

import numpy as np

from grasp_ros.cli.arguments import add_accuracy, add_command, add_file, add_json, add_scene, load_controllers, whole
from grasp_ros.cli.checks import check_memory, check_output, load_scene, prepare
from grasp_ros.cli.output import bar, destination, show
from grasp_ros.cli.report import describe_sensitivity, describe_trajectory, last_rates, table
from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Status
from grasp_ros.methods.contract import ACCURACY_KNOB, STEP, TOLERANCE, UNITS
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import GRID_POINTS, simulate, summary
from grasp_ros.simulation.sampled_plant import tick_times


def add_to(commands: Any) -> None:
    """Add the subcommands."""
    add_json(add_command(commands, "methods", _methods))
    sub = add_command(commands, "simulate", _simulate)
    add_scene(sub)
    sub.add_argument("--grid", type=whole(2), metavar="N",
                     help=f"equidistant output times (default {GRID_POINTS}; with --sampled all control periods)")
    sub.add_argument("--sampled", action="store_true", help="hold each command over a control period, as a graph does")
    sub.add_argument("--controller", dest="controllers", action="append", default=[], metavar="SIDE=MODULE:OBJECT",
                     help="callable of tick, time, x, v and further named values, instead of the feedback")
    sub.add_argument("--sensitivity", action="append", default=[], metavar="KEY",
                     help="print derivatives with respect to section.key, through all impacts; repeatable;"
                          " `grasp plot --sensitivity` draws them")
    result = sub.add_argument_group("result")
    add_file(result, "FILE", "write states, forces, V and, as .npz, events and counters; .csv, or - for the standard"
                               " output, writes a table")
    add_json(result)
    method = sub.add_argument_group("method")
    add_accuracy(method)
    method.add_argument("--method", choices=METHODS, metavar="M", default=EXACT,
                        help=f"integration method, see `grasp methods` (default {EXACT})")
    setting = method.add_mutually_exclusive_group()
    setting.add_argument("--step", type=float, metavar="S", help="step in s of a method with a fixed step")
    setting.add_argument("--tolerance", type=float, metavar="T", help="tolerance (rtol = atol) of an adaptive method")
    method.add_argument("--max-events", type=whole(1), default=MAX_EVENTS, metavar="N",
                        help=f"budget of contact events (default {MAX_EVENTS})")
    method.add_argument("--max-work", type=whole(1), default=MAX_WORK, metavar="N",
                        help=f"budget of flights, Taylor steps and event evaluations (default {MAX_WORK})")


def _methods(options: argparse.Namespace) -> int:
    show(options, "\n".join(
        f"{name}\n  order: {method.order}\n  source: {method.source}\n  at a touch: {method.at_touch}\n"
        f"  --{method.knob}, default {method.default:g}{UNITS[method.knob]}" for name, method in METHODS.items()
    ), [
        {"name": name, "order": method.order, "source": method.source, "at_touch": method.at_touch, "knob": method.knob,
         "default": method.default, "package": method.package} for name, method in METHODS.items()
    ])
    return 0


def _simulate(options: argparse.Namespace) -> int:
    scene = load_scene(options.scene, options.settings)
    knob = METHODS[options.method].knob
    given = {STEP: options.step, TOLERANCE: options.tolerance, ACCURACY_KNOB: options.accuracy}
    for other, number in given.items():
        if other != knob and number not in (None, ACCURACY):
            raise Refused(f"--{other} is not allowed; allowed for {options.method}: --{knob}")
    check_output(options.output, (".npz", ".csv"), options.force, [options.scene])
    here = os.getcwd()
    controllers = load_controllers(options.controllers)
    sampled = options.sampled or bool(controllers)
    check_memory(scene, sampled, options.grid)
    grid = None
    if options.grid is not None:  # ticks to the bit: a rounding before one the last command still acts
        every, rest = divmod(scene.ticks, options.grid - 1)
        on_ticks = every and not rest and (sampled or scene.sampled)
        grid = tick_times(scene)[::every] if on_ticks else np.linspace(0.0, scene.duration, options.grid)
    prepare()
    with bar(scene.duration, "s", scene.name) as progress:
        trajectory = simulate(
            scene, grid=grid, sampled=sampled, controllers=controllers, method=options.method, setting=given[knob],
            max_events=options.max_events, max_work=options.max_work,
            sensitivity=options.sensitivity or None,
            progress=None if knob == STEP else progress,
        )
    with suppress(OSError):  # one that this user may not enter, `sudo -u` say, or that was moved: we are still there
        os.chdir(here)  # a controller, or its module, may have called os.chdir
    found = summary(trajectory)
    rows = describe_trajectory(trajectory, found)
    rates = trajectory.sensitivity
    if rates is not None:
        rows, found = [*rows, *describe_sensitivity(rates)], {**found, "sensitivity": last_rates(rates)}
    show(options, table(rows), found)
    if options.output is not None:
        with destination(options.output) as file:
            (trajectory.save if options.output.suffix.lower() == ".npz" else trajectory.to_csv)(file)
    return 0 if trajectory.status is Status.DONE else 1

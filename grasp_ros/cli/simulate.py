"""`grasp scenes`, `methods` and `simulate`: what there is, and a run without ROS."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import (
    add_accuracy,
    add_command,
    add_force,
    add_output,
    add_scene,
    check_memory,
    check_output,
    load_scene,
    prepare,
    whole,
)
from grasp_ros.cli.controllers import load_controllers
from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Status
from grasp_ros.methods.contract import ACCURACY_KNOB, STEP, TOLERANCE, UNITS
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import GRID_POINTS, simulate


def add_to(commands: Any) -> None:
    """Add the subcommands."""
    add_command(commands, "scenes", _scenes, "list the scenes that come with the package")
    text = "list the methods of integration: order, source, what each does at a touch"
    add_command(commands, "methods", _methods, text)
    sub = add_command(commands, "simulate", _simulate, "simulate a scene without ROS")
    add_scene(sub)
    add_accuracy(sub)
    sub.add_argument("--grid", type=whole(2), metavar="N", help=f"equidistant output times (default {GRID_POINTS})")
    sub.add_argument("--sampled", action="store_true", help="hold each command over a control period, as a graph does")
    sub.add_argument("--method", choices=METHODS, default=EXACT, help="way to integrate; see `grasp methods`")
    setting = sub.add_mutually_exclusive_group()
    setting.add_argument("--step", type=float, metavar="S", help="step in s of a method with a fixed step")
    setting.add_argument("--tolerance", type=float, metavar="T", help="tolerance (rtol = atol) of an adaptive method")
    sub.add_argument("--max-events", type=whole(1), default=MAX_EVENTS, metavar="N",
                     help=f"budget of contact events (default {MAX_EVENTS})")
    sub.add_argument("--max-work", type=whole(1), default=MAX_WORK, metavar="N",
                     help=f"budget of flights, Taylor steps and event evaluations (default {MAX_WORK})")
    sub.add_argument("--controller", dest="controllers", action="append", default=[], metavar="SIDE=MODULE:OBJECT",
                     help="a callable of tick, time, x and v in place of the scene's feedback; see docs/api.md")
    sub.add_argument("--sensitivity", action="append", default=[], metavar="KEY",
                     help="print derivatives by a number of the scene, section.key, through all impacts; repeatable")
    add_output(sub, "FILE.npz", "write states, events, V and counters")
    add_force(sub)


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

    scene = load_scene(options.scene, options.settings)
    setting, controllers = _setting(options), load_controllers(options.controllers)
    sampled = options.sampled or bool(controllers)
    check_memory(scene, sampled, options.grid)
    if options.sensitivity and (controllers or options.method != EXACT):
        raise Refused(f"--sensitivity: allowed: --method {EXACT}, without --controller")
    if options.output is not None:
        check_output(options.output, options.force, [options.scene])
    grid = None if options.grid is None else np.linspace(0.0, scene.duration, options.grid)
    prepare()
    silent = METHODS[options.method].knob == STEP
    with tqdm(total=scene.duration, unit="s", desc=scene.name, disable=silent or None, delay=1.0) as bar:
        trajectory = simulate(
            scene, grid=grid, sampled=sampled, controllers=controllers, method=options.method, setting=setting,
            max_events=options.max_events, max_work=options.max_work,
            progress=lambda reached: bar.update(reached - bar.n),
        )
    print(table(describe_trajectory(trajectory)))
    if options.output is not None:
        trajectory.save(options.output)
        print(f"written to {options.output}")
    if options.sensitivity:
        from grasp_ros.cli.sensitivity import describe_sensitivity
        from grasp_ros.sensitivity.sensitivities import sensitivities

        found = sensitivities(scene, options.sensitivity, sampled=sampled, accuracy=options.accuracy)
        print(table(describe_sensitivity(found)))
    return 0 if trajectory.status is Status.DONE else 1


def _setting(options: argparse.Namespace) -> float | None:
    """The number that belongs to the method's knob; one that belongs to another knob is refused."""
    given = {STEP: options.step, TOLERANCE: options.tolerance, ACCURACY_KNOB: options.accuracy}
    knob = METHODS[options.method].knob
    for other, number in given.items():
        if other != knob and number not in (None, ACCURACY):
            raise Refused(f"--{other} is not allowed; allowed for {options.method}: --{knob}")
    return None if given[knob] is None else float(given[knob])

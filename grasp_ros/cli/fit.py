"""`grasp fit`: numbers of a scene from a recorded motion."""

from __future__ import annotations

import argparse
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import add_command, add_file, add_json, add_settings, complete_scenes, named
from grasp_ros.cli.checks import check_output, load_scene, prepare, warn
from grasp_ros.cli.output import figure_endings, show, write_figure, write_text
from grasp_ros.identification.fit import fit
from grasp_ros.identification.measured import CHANNELS, measured
from grasp_ros.physics.errors import Refused, printable
from grasp_ros.physics.given import read_number
from grasp_ros.scene.files import YAML


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "fit", _fit)
    sub.add_argument("source", metavar="BAG|FILE.npz|FILE.csv", type=named, help="a bag, a file of `grasp simulate -o`,"
                     f" or a table with columns t_s and some of {', '.join(CHANNELS)}")
    sub.add_argument("--free", action="extend", nargs="+", required=True, metavar="KEY",
                     help="parameters to estimate, section.key, or the offset of a sensor, offset.CHANNEL")
    complete_scenes(sub.add_argument("--scene", help="model and start of the search (default: the scene of"
                                     " the data; a table has none)"))
    add_settings(sub)
    sub.add_argument("--against", action="append", default=[], metavar="KEY=VALUE",
                     help="test whether the data reject this value of a number that is free; repeatable")
    sub.add_argument("--by-sensors", action="store_true",
                     help="of a bag: use the measurements of the sensors instead of the exact states")
    add_file(sub, "FILE", "the scene with the estimates, .yaml, or measured against fitted, .png, .svg or .pdf; - is"
               " the standard output")
    add_json(sub)


def _fit(options: argparse.Namespace) -> int:
    check_output(options.output, (*YAML, *figure_endings(options.output)), options.force, [options.source])
    scene = None
    if options.scene is not None:
        scene = load_scene(options.scene, options.settings)
    elif options.settings:
        own = measured(options.source, None, options.by_sensors).scene
        scene = scenes.parse(own.to_yaml(), own.name, own.name, options.settings)
        warn(scene)
    against: dict[str, float] = {}
    for text in options.against:
        key, _, word = text.partition("=")
        if key in against:
            raise Refused(f"--against {key}: given twice; allowed: one value")
        try:
            against[key] = read_number(word)
        except ValueError:
            raise Refused(f"--against {text}: allowed: KEY=VALUE, with a number") from None
    prepare()
    found = fit(options.source, options.free, scene, against=against, by_sensors=options.by_sensors)
    show(options, printable(str(found)), {
        "source": found.source, "acting": found.acting, "samples": len(found.t), "scene": found.scene.to_yaml(),
        "numbers": {key: {"estimate": value, "low": low, "high": high} for key, value, low, high
                    in zip(found.keys, found.estimates, found.low, found.high, strict=True)},
        "not_identifiable": found.not_identifiable, "covariance": found.covariance, "correlation": found.correlation,
        "noise": dict(zip(CHANNELS, found.noise, strict=True)),
        "contacts": [contact._asdict() for contact in found.contacts],
        "missed": found.missed,
        "against": {key: {**test._asdict(), "rejected": test.rejected} for key, test in found.against.items()},
    })
    if options.output is not None and options.output.suffix.lower() in YAML:
        write_text(found.scene.to_yaml(), options.output)
    elif options.output is not None:
        from grasp_ros.identification.figure import measured_and_fitted

        write_figure(measured_and_fitted(found), options.output)
    return 1 if found.not_identifiable or found.missed else 0

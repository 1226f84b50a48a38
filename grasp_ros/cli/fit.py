"""`grasp fit`: numbers of a scene from a recorded motion."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from typing import Any

from grasp_ros import scene as scenes
from grasp_ros.cli.arguments import (
    add_command,
    add_force,
    add_json,
    add_output,
    add_settings,
    check_output,
    complete_scenes,
    load_scene,
    prepare,
    warn,
)
from grasp_ros.cli.output import image_format, show, write_figure
from grasp_ros.identification.fit import fit
from grasp_ros.identification.measured import CHANNELS, measured
from grasp_ros.identification.result import Fit
from grasp_ros.physics.errors import Refused, printable

UNLIKELY = 1e-4  # probability of residuals


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "fit", _fit)
    sub.add_argument("source", metavar="BAG|FILE.npz|FILE.csv", help="a bag, a file of `grasp simulate -o`, or a table"
                     f" with columns t_s and some of {', '.join(CHANNELS)}")
    sub.add_argument("--free", action="extend", nargs="+", required=True, metavar="KEY",
                     help="numbers to estimate, section.key, or the offset of a sensor, offset.CHANNEL")
    complete_scenes(sub.add_argument("--scene", help="what is known, and where the search starts (default: the scene of"
                                     " the data; a table has none)"))
    add_settings(sub)
    sub.add_argument("--against", action="append", default=[], metavar="KEY=VALUE",
                     help="test whether the data reject this value of a number that is free; repeatable")
    sub.add_argument("--by-sensors", action="store_true",
                     help="of a bag: what the sensors of its scene have measured, in place of the exact states")
    add_output(sub, "FIGURE", "draw measured against fitted, .png, .svg or .pdf; - is the standard output")
    add_force(sub)
    add_json(sub)


def _fit(options: argparse.Namespace) -> int:
    if options.output is not None:
        check_output(options.output, options.force, [options.source])
        image_format(options.output)
    scene = None
    if options.scene is not None:
        scene = load_scene(options.scene, options.settings)
    elif options.settings:
        own = measured(options.source, None, options.by_sensors).scene
        scene = scenes.parse(own.to_yaml(), own.name, own.name, options.settings)
        warn(scene)
    against = dict(map(_value, options.against))
    prepare()
    found = fit(options.source, options.free, scene, against=against, by_sensors=options.by_sensors)
    show(options, printable("\n".join(_lines(found))), _data(found))
    if options.output is not None:
        from grasp_ros.identification.figure import measured_and_fitted

        write_figure(measured_and_fitted(found), options.output)
    return 1 if found.not_identifiable else 0


def _value(text: str) -> tuple[str, float]:
    key, _, word = text.partition("=")
    try:
        return key, float(word)
    except ValueError:
        raise Refused(f"--against {text}: allowed: KEY=VALUE, with a number") from None


def _lines(found: Fit) -> Iterator[str]:
    """Estimates, what is not identifiable, correlations, noise, residuals, and tests."""
    width = max(map(len, found.keys))
    yield f"{found.source}: {len(found.t)} samples, {found.t[0]:g} to {found.t[-1]:g} s"
    yield f"{'':<{width}}  {'estimate':>13}  95 % interval"
    lost = {key for keys in found.not_identifiable for key in keys}
    for key, value, low, high in zip(found.keys, found.estimates, found.low, found.high, strict=True):
        yield f"{key:<{width}}  {value:>13.7g}  " + ("-" if key in lost else f"{low:.7g} to {high:.7g}")
    for keys in found.not_identifiable:
        together = " together: the data show only a combination of them" if len(keys) > 1 else ""
        yield f"not identifiable from these data: {', '.join(keys)}{together}"
    for row, key in enumerate(found.keys):
        cells = "".join(_cell(cell, 6, 2) for cell in found.correlation[row, : row + 1])
        yield f"{'correlation' if row == 0 else '':<12}{key:<{width}}{cells}"
    noises = zip(CHANNELS, found.noise, strict=True)
    yield "noise       " + ", ".join(f"{name} {noise:.3g}" for name, noise in noises if math.isfinite(noise))
    yield "residuals   from  samples  rms / noise  probability if white"
    for contact in found.contacts:
        begin = "begin" if contact.side == "none" else f"{contact.side} touch, {contact.begin:.4f} s"
        yield f"  {begin:<24}{contact.samples:>6}{contact.rms:>8.3f}{_cell(contact.white, 10, 3)}"
    if any(contact.white < UNLIKELY for contact in found.contacts):
        yield "the residuals are not noise: the scene lacks something that acted, and the intervals are too narrow"
    for key, test in found.against.items():
        verdict = "rejected" if test.rejected else "not rejected"
        yield f"{key} = {test.value:g}: {verdict}, F = {test.F:.4g}, probability {test.probability:.2g}"


def _cell(value: float, width: int, digits: int) -> str:
    return f"{'-':>{width}}" if math.isnan(value) else f"{value:{width}.{digits}f}"


def _data(found: Fit) -> dict[str, Any]:
    """The same as data; the scene with the estimates as YAML."""
    return {
        "source": found.source, "samples": len(found.t), "scene": found.scene.to_yaml(),
        "numbers": {key: {"estimate": value, "low": low, "high": high} for key, value, low, high
                    in zip(found.keys, found.estimates, found.low, found.high, strict=True)},
        "not_identifiable": found.not_identifiable, "covariance": found.covariance, "correlation": found.correlation,
        "noise": dict(zip(CHANNELS, found.noise, strict=True)),
        "contacts": [contact._asdict() for contact in found.contacts],
        "against": {key: {**test._asdict(), "rejected": test.rejected} for key, test in found.against.items()},
    }

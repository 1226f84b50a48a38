"""`grasp plot`: a figure of bags, of files of `grasp simulate`, or of scenes, side by side."""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from grasp_ros.cli.arguments import add_command, add_file, add_settings
from grasp_ros.cli.checks import check_memory, check_output, load_scene, prepare, warn
from grasp_ros.cli.output import STDOUT, figure_endings, note, write_figure
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Entry
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.scene.files import YAML, reading
from grasp_ros.simulation import GRID_POINTS, Trajectory, load, plots, simulate
from grasp_ros.simulation.animation import FORMATS, animate
from grasp_ros.simulation.canvas import Axes
from grasp_ros.simulation.tables import Motion

if TYPE_CHECKING:
    from grasp_ros.simulation.differentiate import Sensitivity

Span = tuple[float, float] | None
PER_CONTACT, MOST_EVENTS = 32, 2000  # output times between two events; with more of these a curve is a band
WIDE = 100.0  # a derivative that grows by more has a logarithmic axis


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "plot", _plot)
    sub.add_argument("sources", metavar="BAG|FILE.npz|SCENE", nargs="+", help="sources to draw together")
    add_settings(sub)
    sub.add_argument("--sampled", action="store_true", help="scenes: hold each command over a control period")
    sub.add_argument("--method", choices=METHODS, default=EXACT, help="scenes: integration method; see `grasp methods`")
    sub.add_argument("--step", type=float, metavar="S", help="scenes: step or tolerance of the method")
    sub.add_argument("--sensitivity", action="append", default=[], metavar="KEY",
                     help="one scene: also draw derivatives of positions with respect to section.key; repeatable")
    sub.add_argument("--panel", dest="panels", action="append", choices=plots.PANELS, metavar="P",
                     help=f"panels to draw, in this order; repeatable: {', '.join(plots.PANELS)} (default: all)")
    sub.add_argument("--from", dest="first", type=float, metavar="S", help="begin of the time range, in s")
    sub.add_argument("--to", dest="last", type=float, metavar="S", help="end of the time range, in s")
    sub.add_argument("--width", type=float, metavar="MM", help="width of the page (default 230 mm, 90 is a column)")
    add_file(sub, "FILE", "image, say .png, .svg or .pdf; - is the standard output (default: .png next to the source)")
    sub.add_argument("--animate", action="store_true",
                     help="a moving picture of one source instead, .gif or .html (default: .gif next to it)")
    sub.add_argument("--speed", type=float, default=1.0, metavar="R", help="playback speed (default 1)")


def _plot(options: argparse.Namespace) -> int:
    span: Span = None
    if options.first is not None or options.last is not None:
        span = options.first or 0.0, math.inf if options.last is None else options.last
        if not 0.0 <= span[0] < span[1]:
            raise Refused(f"--from {span[0]:g} --to {span[1]:g} is not allowed; allowed: ascending from 0 s on")
    output = options.output or _beside(options.sources[0], ".gif" if options.animate else ".png")
    if options.animate and (len(options.sources) > 1 or output == STDOUT):
        raise Refused("--animate: allowed: one source, and a file")
    if options.panels and options.animate:
        raise Refused("--panel: allowed: without --animate")
    if options.speed != 1.0 and not options.animate:
        raise Refused("--speed: allowed: with --animate")
    check_output(output, FORMATS if options.animate else figure_endings(output), options.force, options.sources)
    if options.step is not None and options.method == EXACT:
        raise Refused(f"--step: allowed: with another --method than {EXACT}")
    if options.sensitivity and (options.animate or len(options.sources) > 1):
        raise Refused("--sensitivity: allowed: one scene, without --animate")
    motions = [_motion(source, options, span) for source in options.sources]
    if span is not None:
        end = max(map(plots.end_of, motions))
        span = span[0], end if options.last is None else span[1]
        if not span[0] < span[1] <= end:
            raise Refused(f"--from {span[0]:g} --to {span[1]:g} is not allowed; allowed: within 0 to {end:g} s")
    if options.animate:
        animate(motions[0], output, speed=options.speed, span=span, width_mm=options.width)
        note(f"written to {output}")
        return 0
    panels = [plots.PANELS[name] for name in options.panels or plots.PANELS]
    if isinstance(motions[0], Trajectory) and (found := motions[0].sensitivity) is not None:
        panels += [plots.Panel(partial(_draw, found, j), "derivative, m per unit", 2)
                   for j in range(len(found.keys))]
    figure = plots.compose(motions, width_mm=options.width, span=span, panels=panels)
    write_figure(figure, output)
    return 0


def _motion(source: str, options: argparse.Namespace, span: Span) -> Motion:
    """A motion of a bag, a file or a scene; the warnings of its scene go to the standard error output."""
    from grasp_ros.graph.bag.reading import read

    path = Path(source)
    with reading(path):
        directory = bool(source) and path.is_dir()
    ending = path.suffix.lower()
    recorded = directory or ending in (".npz", ".mcap")
    if recorded and (options.settings or options.sampled or options.method != EXACT or options.step is not None
                     or options.sensitivity):
        raise Refused(f"{source}: --set, --sampled, --method, --step, --sensitivity are not allowed; allowed for"
                      " scenes")
    if recorded:
        motion: Motion = load(path) if ending == ".npz" else read(path)
        warn(motion.scene)
        return motion
    if path.is_file() and ending not in YAML:
        raise Refused(f"{source}: no such scene; allowed: a scene, a bag (a directory, or .mcap), or a .npz file of"
                      " `grasp simulate`")
    scene = load_scene(source, options.settings)
    check_memory(scene, options.sampled)
    prepare()
    grid = None
    if span is not None and not (options.sampled or scene.sampled):
        first, last = np.clip(sorted(span), 0.0, scene.duration).tolist()
        grid = np.linspace(first, last, GRID_POINTS)
    run = partial(simulate, scene, sampled=options.sampled, method=options.method, setting=options.step)
    found = run(grid=grid)
    fine = options.method == EXACT and not options.animate and found.status is Status.DONE
    grid = with_contacts(found) if fine else found.t
    if len(grid) == len(found.t) and not options.sensitivity:
        return found
    return run(grid=grid, sensitivity=options.sensitivity or None)


def with_contacts(run: Trajectory) -> Array:
    """Output times of a run, and some more between its events: curves of short impacts reach their peaks."""
    first, last = run.t[[0, -1]]
    times = run.event_table[:, Entry.TIME]
    ends = np.unique([first, *times[(first < times) & (times < last)], last])
    if not 2 < len(ends) <= MOST_EVENTS:
        return run.t
    return np.union1d(run.t, np.linspace(ends[:-1], ends[1:], PER_CONTACT, endpoint=False))


def _beside(source: str, ending: str) -> Path:
    """Where the figure goes if nothing else is said."""
    path = Path(source)
    with reading(path):
        if not path.exists():
            return Path(f"{path.stem}{ending}")
        return Path(f"{path.resolve()}{ending}") if path.is_dir() else path.with_suffix(ending)


def _draw(found: Sensitivity, j: int, axes: Axes, _: Motion) -> None:
    """Derivatives of the positions by one number, over time."""
    rates = found.state_rates[:, ::2, j]
    sizes = np.abs(rates[rates != 0.0])
    if len(sizes) and sizes.max() > WIDE * np.median(sizes):
        axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(np.median(sizes))))
        axes.locator_params(axis="y", numticks=7)
    for body in found.scene.system.present:
        axes.plot(found.t, rates[:, COLUMN[body] // 2], label=f"x_{NAMES[body]}", color=plots.COLORS[body],
                  linewidth=1.0)
    if found.corner is not None:
        axes.axvline(found.corner, color="black", linewidth=0.8, linestyle=":", label="one-sided from here")
    axes.set_title(f"by {found.keys[j]}", loc="left", fontsize="small", parse_math=False)

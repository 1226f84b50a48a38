"""`grasp map`: outcomes of a scene over two of its numbers, or of a sample of any number of them."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from grasp_ros.cli.arguments import add_accuracy, add_command, add_json, add_scene, whole
from grasp_ros.cli.checks import check_fits, load_scene, prepare
from grasp_ros.cli.output import bar, note, show
from grasp_ros.cli.parser import COMMANDS
from grasp_ros.exact.integrator import MAX_EVENTS, MAX_WORK, Status
from grasp_ros.maps import store
from grasp_ros.maps.plan import Plan, read_axis
from grasp_ros.maps.run import run
from grasp_ros.observe.record import Wanted
from grasp_ros.physics.errors import Refused, need
from grasp_ros.scene.files import format_of
from grasp_ros.simulation.chunk import HORIZONS, SETTLED, STATUSES, Setup, compute
from grasp_ros.simulation.outcomes import GROUPS, find

RANGE = "KEY[+KEY]=low:high[:n[:log]]"


def add_to(commands: Any) -> None:
    """Add the subcommand."""
    sub = add_command(commands, "map", _map, f"{COMMANDS['map'].text}; run it again to resume what was stopped")
    add_scene(sub)
    add_accuracy(sub)
    add_json(sub)
    sub.add_argument("--x", metavar=RANGE, help="parameter of the x axis, section.key: n values (default 101), linear"
                     " or logarithmic; + between keys with one value")
    sub.add_argument("--y", metavar=RANGE, help="the same for y")
    sub.add_argument("--vary", action="append", default=[], metavar="KEY[+KEY]=low:high[::log]",
                     help="one more parameter of a sample; + between keys with one value")
    sub.add_argument("--sample", type=whole(1), default=0, metavar="N", help="N rows at random, a Sobol sequence")
    sub.add_argument("--seed", type=whole(0), default=0, metavar="S", help="seed of the sample (default 0)")
    sub.add_argument("--outcome", action="append", default=[], metavar="NAME",
                     help=f"one of {', '.join(GROUPS)}, or a column of one (default settling_time and touches)")
    sub.add_argument("--settled", type=float, default=SETTLED, metavar="PART", help="a run is settled within this"
                     f" fraction of the largest initial displacement (default {SETTLED:g})")
    sub.add_argument("--horizons", type=whole(1), default=HORIZONS, metavar="N", help="most durations to simulate"
                     f" until V_c decides whether it has settled (default {HORIZONS})")
    sub.add_argument("--sampled", action="store_true", help="hold each command over a control period, as a graph does")
    sub.add_argument("--max-events", type=whole(1), default=MAX_EVENTS, metavar="N", help="events per run")
    sub.add_argument("--max-work", type=whole(1), default=MAX_WORK, metavar="N", help="work per run")
    where = sub.add_mutually_exclusive_group()
    where.add_argument("--workers", type=whole(1), default=0, metavar="N", help="processes of a Dask cluster")
    where.add_argument("--scheduler", default="", metavar="tcp://HOST:PORT", help="a Dask cluster that exists")
    sub.add_argument("-o", "--output", type=Path, metavar="FILE.zarr", required=True,
                     help="new directory, or an unfinished map to complete; figures are written next to it")


def _map(options: argparse.Namespace) -> int:
    need("`grasp map`", "xarray", "zarr", *["scipy"] * bool(options.sample))
    from grasp_ros.maps import figures  # with matplotlib

    scene = load_scene(options.scene, options.settings)
    format_of(options.output, [".zarr"])
    given = [("--y", options.y), ("--x", options.x), *(("--vary", text) for text in options.vary)]
    axes = tuple(read_axis(option, text, grid=not options.sample) for option, text in given if text is not None)
    if options.vary and not options.sample:
        raise Refused("--vary: allowed: with --sample N; a map has --x and --y")
    if options.seed and not options.sample:
        raise Refused("--seed: allowed: with --sample N, which draws at random")
    outcomes = tuple(options.outcome) or Setup().outcomes
    setup = Setup(outcomes, options.accuracy, options.sampled, options.settled, options.horizons, options.max_events,
                  options.max_work)
    plan = Plan(scene, setup, axes, options.sample, options.seed)
    columns = find(outcomes)
    pictures = {column.name: options.output.with_name(f"{options.output.stem}_{column.name}.png") for column in columns}
    for path in pictures.values():
        if os.path.exists(path) and not os.path.exists(options.output):
            raise Refused(f"{path}: already exists; allowed: an output whose figures next to it are new")
    check_fits(f"{scene.name}: runs", plan.rows, 2 * (len(axes) + len(columns)))  # in chunks, and joined
    prepare()
    with bar(plan.rows, "run", scene.name) as progress:
        run(plan, options.output, workers=options.workers, scheduler=options.scheduler, progress=progress)
    data = store.read(options.output)
    found = data_of(data)
    show(options, report(found), found)
    for why in reasons(data, plan):
        note(why)
    done = data["status"].values == DONE
    for outcome in columns:
        if outcome.wanted & Wanted.SETTLING and np.isnan(data[outcome.name].values[done]).any():
            note(f"{outcome.name} is nan where V_c proves nothing; {scene.why_unsettled(setup.sampled)};"
                 " --outcome last_outside says how long a mass was outside")
    for column, path in pictures.items():
        figures.draw(data, plan, column, path)
        note(f"written to {path}")
    note(f"written to {options.output}")
    return 0


HEADS = {"least": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "largest": 1.0}
COUNTS = {"inf": np.isinf, "nan": np.isnan}
CDF: Any = "inverted_cdf"  # gives one of the values, never one between
DONE = STATUSES.index(Status.DONE.name)


def data_of(data: Any) -> dict[str, Any]:
    """Of each outcome its quantiles but for nan, its unit, how many are infinite or nan; and how the runs ended."""
    found: dict[str, Any] = {}
    for name in store.columns_of(data):
        values = data[name].values.ravel()
        known = values[~np.isnan(values)]
        parts, cells = np.array([*HEADS.values()]), [np.nan] * len(HEADS)
        if len(known):  # the mean of two values where a part falls between them: of a finite and an infinite one, inf
            low, high = np.quantile(known, parts, method=CDF), -np.quantile(-known, parts[::-1], method=CDF)
            cells = (0.5 * (low + high)).tolist()
        found[name] = {"units": data[name].attrs["units"], **dict(zip(HEADS, cells, strict=True)),
                       **{head: int(count(values).sum()) for head, count in COUNTS.items()}}
    codes, counts = np.unique(data["status"].values, return_counts=True)
    found["status"] = {STATUSES[code] if code >= 0 else "not done": int(count)
                       for code, count in zip(codes, counts, strict=True)}
    return found


def reasons(data: Any, plan: Plan) -> Iterator[str]:
    """Why the first run of each status did not reach its end: it is made again, because a map keeps no sentences."""
    codes, firsts = np.unique(data["status"].values, return_index=True)
    for code, first in zip(codes.tolist(), firsts.tolist(), strict=True):
        if code > DONE:
            stops = compute(plan.variants(first, first + 1), plan.setup).stops.values()
            yield from (f"first run with {STATUSES[code]}: {why}" for why in stops)


def report(found: dict[str, Any]) -> str:
    """A line for each outcome, and how the runs ended."""
    width = max(map(len, found))
    lines = [f"{'outcome':<{width}}" + "".join(f"{head:>12}" for head in (*HEADS, *COUNTS))]
    for name, row in found.items():
        if name != "status":
            cells = [f"{row[head]:12.6g}" for head in HEADS] + [f"{row[head]:12d}" for head in COUNTS]
            lines.append(f"{name:<{width}}" + "".join(cells))
    ended = ", ".join(f"{name} {count}" for name, count in found["status"].items())
    return "\n".join([*lines, f"{'status':<{width}}  {ended}"])

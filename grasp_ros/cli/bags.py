"""`grasp inspect`, `verify` and `recover`: what a graph has recorded."""

from __future__ import annotations

import argparse
import math
import os
import sys
from textwrap import shorten
from typing import TYPE_CHECKING, Any

from grasp_ros.cli.arguments import add_command, add_file, add_json, named
from grasp_ros.cli.checks import check_output, prepare, warn
from grasp_ros.cli.output import destination, show
from grasp_ros.physics.errors import Refused

if TYPE_CHECKING:  # what is not asked for is not imported, which takes a while
    from grasp_ros.graph.bag.recording import Recording

MOST_LETTERS = 200  # of the ticks that a recovered bag lacks


def add_to(commands: Any) -> None:
    """Add the subcommands."""
    sub = add_command(commands, "recover", _recover)
    sub.add_argument("bag", type=named, help="directory or file of a bag")
    sub.add_argument("-o", "--output", type=named, metavar="DIRECTORY",
                     help="new directory for the bag (default: BAG_recovered)")
    sub = add_command(commands, "inspect", _inspect)
    sub.add_argument("bag", type=named, help="directory or file of a bag")
    add_json(sub)
    add_file(sub, "FILE.csv", "write states, forces and V as a table; - is the standard output")
    sub.add_argument("--replay", action="store_true", help="also verify it, as `grasp verify` does")
    add_limits(sub)
    sub = add_command(commands, "verify", _verify)
    sub.add_argument("bag", type=named, help="directory or file of a bag")
    add_json(sub)


def add_limits(sub: argparse.ArgumentParser) -> None:
    """What a free run has to keep."""
    sub.add_argument("--max-age", type=float, metavar="N", help="free run: exit status 1 if a command was older than"
                     " N control periods")
    sub.add_argument("--min-factor", type=float, metavar="F", help="free run: exit status 1 if slower than F"
                     " simulated seconds per second")


def check_limits(options: argparse.Namespace, lockstep: bool) -> None:
    """Refuse limits that no run can be judged by; one in lockstep, which waits for every command, by none."""
    for name, limit in (("--max-age", options.max_age), ("--min-factor", options.min_factor)):
        if limit is not None and (lockstep or not 0.0 <= limit < math.inf):
            raise Refused(f"{name} {limit:g} is not allowed; allowed: for a free run, a number >= 0")


def keeps(recording: Recording, options: argparse.Namespace) -> bool:
    """Whether a run kept the limits that were stated; says which it did not keep."""
    broken = []
    oldest = max((most for _, most in recording.ages.values()), default=math.nan)
    if options.max_age is not None and not oldest <= options.max_age:
        broken.append(f"--max-age {options.max_age:g}: the oldest command was {oldest:g} periods old")
    if options.min_factor is not None and not recording.reached >= options.min_factor:
        broken.append(f"--min-factor {options.min_factor:g}: {recording.reached:.3g} s per second was reached")
    for words in broken:
        print(f"grasp: {words}", file=sys.stderr)
    return not broken


def _recover(options: argparse.Namespace) -> int:
    from grasp_ros.graph.bag.reading import recover

    bag = options.bag if options.bag.name else options.bag.resolve()  # "." has no name
    new = options.output or bag.parent / f"{bag.name if os.path.isdir(bag) else bag.stem}_recovered"
    found = recover(options.bag, new)
    for words in found.left_out:
        print(f"left out: {words}")
    missing = f"; without the ticks {shorten(found.missing, MOST_LETTERS, placeholder='...')}" if found.missing else ""
    print(f"{found.ticks} ticks written to {new}{missing}")
    return 0


def _inspect(options: argparse.Namespace) -> int:
    from grasp_ros.cli import report
    from grasp_ros.graph.bag.reading import read
    from grasp_ros.graph.bag.summary import summary, verified
    from grasp_ros.graph.bag.verify import verify

    check_output(options.output, (".csv",), options.force, [options.bag])
    recording = read(options.bag)
    check_limits(options, recording.running.lockstep)
    warn(recording.scene)
    found, holds = summary(recording), True
    rows = report.describe_recording(recording, found)
    if options.replay:
        prepare()
        verification = verify(recording)
        rows, holds = rows + report.describe_verification(verification), verification.holds
        found["replay"] = verified(verification)
    show(options, report.table(rows), found)
    if options.output is not None:
        with destination(options.output) as file:
            recording.to_csv(file)
    return 0 if holds and keeps(recording, options) else 1


def _verify(options: argparse.Namespace) -> int:
    from grasp_ros.cli import report
    from grasp_ros.graph.bag.reading import read
    from grasp_ros.graph.bag.summary import verified
    from grasp_ros.graph.bag.verify import verify

    recording = read(options.bag)
    prepare()
    found = verify(recording)
    rows = [("bag", str(recording.path)), ("run", recording.running.words),
            ("recorded", f"{report.recorded_span(recording)}; end: {recording.lost['end']}"),
            *report.describe_verification(found)]
    show(options, report.table(rows), {"bag": str(recording.path), "lockstep": recording.running.lockstep,
                                       **verified(found)})
    return 0 if found.holds else 1

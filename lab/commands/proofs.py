"""The studies of what is promised: `domain`, `paper`, `hard`, `fuzz`, `readers` and `faults`."""

from __future__ import annotations

import argparse
import math
import signal
from pathlib import Path
from typing import Any

from grasp_ros.cli.arguments import add_command, add_output, whole
from grasp_ros.cli.checks import prepare
from grasp_ros.physics.errors import Refused
from lab.commands.shared import add_docs, page_directory

Parser = argparse.ArgumentParser
QUICK_STARTS = 4
LONG_SCENE = "case_01"
PAPER_PAGE = Path("runs") / "paper.html"


def add_domain(commands: Any) -> Parser:
    """`python -m lab domain`."""
    sub = add_command(commands, "domain", _domain, "which scenes are simulated: every bound and its reason")
    add_docs(sub)
    return sub


def _domain(options: argparse.Namespace) -> int:
    from lab.studies import domain

    domain.run(page_directory(options, "domain"))
    return 0


def add_paper(commands: Any) -> Parser:
    """`python -m lab paper`."""
    text = "the paper reproduced and judged, with what it lacks"
    sub = add_command(commands, "paper", _paper, text)
    sub.add_argument("--quick", action="store_true", help=f"{QUICK_STARTS} random starts: to try it out")
    add_docs(sub)
    add_output(sub, "FILE.html", f"the page, in one file (default {PAPER_PAGE})", PAPER_PAGE)
    return sub


def _paper(options: argparse.Namespace) -> int:
    from lab.paper import page, study
    from lab.paper.definitions import RANDOM_STARTS
    from lab.studies import pages

    docs = page_directory(options, "paper")
    pages.claim(options.output)
    prepare()
    found = study.report(QUICK_STARTS if options.quick else RANDOM_STARTS)
    page.write_html(found, options.output)
    print(found.summary)
    for claim in found.claims:
        print(f"  {claim.key:4} {claim.verdict.value:27} {claim.statement}")
    print(f"written to {options.output}")
    if docs is not None:
        page.write_markdown(found, docs / "paper.md")
        print(f"written to {docs / 'paper.md'}")
    return 0


def add_hard(commands: Any) -> Parser:
    """`python -m lab hard`."""
    text = "hard cases: the error reached, and what others reach"
    sub = add_command(commands, "hard", _hard, text)
    add_docs(sub)
    sub.add_argument("--alone", action="store_true", help="without other solvers, which takes a minute instead of ten")
    return sub


def _hard(options: argparse.Namespace) -> int:
    from lab.studies import hard

    docs = page_directory(options, "hard")
    prepare()
    return hard.run(docs, alone=options.alone)


def add_fuzz(commands: Any) -> Parser:
    """`python -m lab fuzz`."""
    sub = add_command(commands, "fuzz", _fuzz, "random scenes against all properties")
    sub.add_argument("--seconds", type=float, help="how long (default 60, or until --draws are done)")
    sub.add_argument("--draws", type=whole(1), help="how many scenes")
    sub.add_argument("--first", type=whole(0), default=0, help="number of the first draw (default 0)")
    sub.add_argument("--seed", type=whole(0), default=0, help="another seed draws other scenes (default 0)")
    sub.add_argument("--jobs", type=whole(1), default=1, help="processes (default 1)")
    add_docs(sub)
    text = "where scenes that fail are written (default runs/fuzz); with --docs what is known there is not drawn again"
    add_output(sub, "DIRECTORY", text, Path("runs") / "fuzz")
    return sub


def _fuzz(options: argparse.Namespace) -> int:
    from lab.drills import fuzz, random_scenes

    seconds = _seconds(options.seconds, options.draws)
    docs = page_directory(options, "fuzz")
    prepare()
    memory = None if docs is None else random_scenes.Kept(options.output, options.seed)
    book = fuzz.run(options.seed, options.output, seconds=seconds, draws=options.draws, first=options.first,
                    jobs=options.jobs, memory=memory)
    if docs is not None:
        random_scenes.write_page(docs, options.seed, options.first, book)
    return 1 if book.broken else 0


def _seconds(seconds: float | None, count: int | None) -> float | None:
    """For how long random input is tried; None: until it has been enough."""
    seconds = 60.0 if seconds is None and count is None else seconds
    if seconds is not None and not (math.isfinite(seconds) and seconds > 0.0):
        raise Refused(f"--seconds {seconds!r} is not allowed; allowed: a number > 0")
    return seconds


def add_readers(commands: Any) -> Parser:
    """`python -m lab readers`."""
    sub = add_command(commands, "readers", _readers, "damaged files of all kinds against their readers")
    sub.add_argument("--seconds", type=float, help="how long (default 60, or until --count files are tried)")
    sub.add_argument("--count", type=whole(1), help="how many files")
    sub.add_argument("--first", type=whole(0), default=0, help="number of the first file (default 0)")
    sub.add_argument("--seed", type=whole(0), default=0, help="another seed makes other files (default 0)")
    text = "where files that break a reader are written (default runs/readers)"
    add_output(sub, "DIRECTORY", text, Path("runs") / "readers")
    return sub


def _readers(options: argparse.Namespace) -> int:
    from lab.drills import parser_fuzzing

    seconds = _seconds(options.seconds, options.count)
    prepare()
    broken = parser_fuzzing.run(
        options.output, seed=options.seed, first=options.first, count=options.count, seconds=seconds)
    return 1 if broken else 0


def add_faults(commands: Any) -> Parser:
    """`python -m lab faults`."""
    text = "accidents done to graphs of real processes, some minutes"
    sub = add_command(commands, "faults", _faults, text)
    sub.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these drills alone")
    sub.add_argument("--quick", action="store_true", help="a handful of drills")
    sub.add_argument("--ticks", type=whole(1000), metavar="N",
                     help=f"in place of drills, {LONG_SCENE} in lockstep for N ticks: losses, and memory of processes")
    add_docs(sub)
    return sub


def _faults(options: argparse.Namespace) -> int:
    from lab.drills.faults import endurance, run

    if options.ticks:
        prepare()
        return 0 if endurance.run(LONG_SCENE, options.ticks) else 1
    drills = run.chosen(options.only, options.quick)
    docs = page_directory(options, "faults")
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup the graphs would inherit that it is ignored
    prepare()
    return 0 if run.run(drills, docs) else 1

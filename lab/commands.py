"""The commands of `python -m lab`: what each is asked, and what it runs."""

from __future__ import annotations

import argparse
import math
import signal
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from grasp_ros.cli.arguments import add_command, add_scene, named, whole
from grasp_ros.cli.checks import load_scene, prepare
from grasp_ros.physics.errors import Refused

Options = argparse.Namespace
Option = Callable[[argparse.ArgumentParser], object]  # adds itself to a parser
QUICK_STARTS = 4
LONG_SCENE = "case_01"
PAPER_PAGE, STUDIES = Path("runs") / "paper.html", Path("runs") / "studies"


class Command(NamedTuple):
    """One command: its name, a line on it, what runs it and returns the exit status, and what it can be asked.

    With a `page` it takes --docs, a directory for docs/PAGE.md, and refuses one that cannot be written before the work.
    """

    name: str
    text: str
    run: Callable[[Options], int]
    asked: tuple[Option, ...] = ()
    page: str = ""

    def add(self, commands: Any) -> None:
        """Add its parser to those of the program."""
        sub = add_command(commands, self.name, self._run, self.text)
        for add in self.asked:
            add(sub)
        if self.page:
            sub.add_argument("--docs", type=Path, metavar="DIRECTORY", help="write the page there as well")

    def _run(self, options: Options) -> int:
        if self.page and options.docs is not None:
            from lab.studies import pages

            pages.claim(options.docs / f"{self.page}.md")
        return self.run(options)


def _asked(*names: str, **words: Any) -> Option:
    return lambda sub: sub.add_argument(*names, **words)


def _output(metavar: str, text: str, default: Path) -> Option:
    return _asked("-o", "--output", type=named, default=default, metavar=metavar, help=f"{text} (default {default})")


def _paper(options: Options) -> int:
    from lab.paper import page, study
    from lab.studies import pages

    pages.claim(options.output)
    prepare()
    found = study.report(QUICK_STARTS if options.quick else study.RANDOM_STARTS)
    print(page.summary(found.claims))
    for claim in found.claims:
        print(f"  {claim.key:4} {claim.verdict.value:27} {claim.statement}")
    page.write_html(found, options.output)
    if options.docs is not None:
        page.write_markdown(found, options.docs / "paper.md")
    return 0


def _fuzz(options: Options) -> int:
    from lab.cases import degenerate
    from lab.drills import fuzz
    from lab.studies import pages

    seconds = _seconds(options.seconds, options.draws)
    ordinary = degenerate.ORDINARY if options.ordinary is None else options.ordinary
    pages.claim(options.output / "scene.yaml")
    prepare()
    memory = None if options.docs is None else fuzz.Kept(options.output, options.seed, ordinary)
    book = fuzz.run(options.seed, options.output, seconds=seconds, draws=options.draws, first=options.first,
                    jobs=options.jobs, memory=memory, ordinary=ordinary)
    if options.docs is not None:
        fuzz.write_page(options.docs, options.seed, options.first, book, ordinary)
    return 1 if book.broken else 0


def _seconds(seconds: float | None, count: int | None) -> float | None:
    """For how long random input is tried; None: until it has been enough."""
    seconds = 60.0 if seconds is None and count is None else seconds
    if seconds is not None and not (math.isfinite(seconds) and seconds > 0.0):
        raise Refused(f"--seconds {seconds!r} is not allowed; allowed: a number > 0")
    return seconds


def _readers(options: Options) -> int:
    from lab.drills import parser_fuzzing
    from lab.studies import pages

    seconds = _seconds(options.seconds, options.count)
    pages.claim(options.output / "file")
    prepare()
    broken = parser_fuzzing.run(
        options.output, seed=options.seed, first=options.first, count=options.count, seconds=seconds)
    return 1 if broken else 0


def _study(module: str, *asked: str) -> Callable[[Options], int]:
    """A study that is asked some of the options; it may return an exit status."""
    def run(options: Options) -> int:
        study = import_module(f"lab.studies.{module}")
        prepare()
        return study.run(*(getattr(options, name) for name in asked)) or 0

    return run


def _filled(module: str, page: str, options: Options) -> int:
    """A study that has the numbers of a page, which is printed or written."""
    from lab.studies import pages

    study = import_module(f"lab.studies.{module}")
    prepare()
    pages.write(options.docs, page, **study.numbers())
    return 0


def _repeated(module: str, options: Options) -> int:
    """A drill that does the same to runs of one scene so many times."""
    drill = import_module(f"lab.drills.{module}")
    scene = load_scene(options.scene, options.settings)
    prepare()
    return 0 if drill.run(scene, options.times, options.seed) else 1


def _faults(options: Options) -> int:
    from lab.drills.faults import endurance, run

    if options.ticks:
        prepare()
        return 0 if endurance.run(LONG_SCENE, options.ticks) else 1
    drills = run.chosen(options.only, options.quick)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup the graphs would inherit that it is ignored
    prepare()
    return 0 if run.run(drills, options.docs) else 1


SECONDS = "how long (default 60, or until {} are done)"
FIRST = _asked("--first", type=whole(0), default=0, help="number of the first one (default 0)")
SEED = _asked("--seed", type=whole(0), default=0, help="another seed draws others (default 0)")
JOURNAL = _output("DIRECTORY", "what was measured, which is not measured again, and without --docs the page", STUDIES)
RESUMED = JOURNAL, _asked("--quick", action="store_true", help="a part of it, without ROS and outside peers: to try it")
COMMANDS = (
    Command("paper", "the paper reproduced and judged, with what it lacks", _paper, (
        _asked("--quick", action="store_true", help=f"{QUICK_STARTS} random starts: to try it out"),
        _output("FILE.html", "the page, in one file", PAPER_PAGE),
    ), "paper"),
    Command("domain", "which scenes are simulated: every bound and its reason",
            partial(_filled, "domain", "domain"), page="domain"),
    Command("certificate", "where the paper's V jumps; limits of the control period",
            partial(_filled, "certificate", "jumps"), page="jumps"),
    Command("hard", "hard cases: the error reached, and what others reach", _study("hard", "docs", "alone"), (
        _asked("--alone", action="store_true", help="without other solvers, which takes a minute instead of ten"),
    ), "hard"),
    Command("digits", "all scenes of the package beside 25 digits, and what one rounding becomes",
            _study("digits", "docs"), page="digits"),
    Command("fuzz", "random scenes against all properties", _fuzz, (
        _asked("--seconds", type=float, help=SECONDS.format("--draws")),
        _asked("--draws", type=whole(1), help="how many scenes"), FIRST, SEED,
        _asked("--ordinary", type=float, metavar="PART",
               help="probability of a scene that is not degenerate (default: most are)"),
        _asked("--jobs", type=whole(1), default=1, help="processes (default 1)"),
        _output("DIRECTORY", "for scenes that fail; with --docs what is known there is not drawn again",
                Path("runs") / "fuzz"),
    ), "fuzz"),
    Command("accuracy", "what accuracy costs: error against time of every method, energy, prediction, control periods;"
            " resumes", _study("accuracy_page", "docs", "output", "quick"), RESUMED, "accuracy"),
    Command("derivatives", "derivatives through impacts beside the reference, which takes hours and resumes, random"
            " scenes, and peers", _study("derivatives", "docs", "output", "tables", "draws"), (
                _asked("--table", dest="tables", action="append", choices=("reference", "random", "peers", "cost"),
                       help="one of the page's tables; repeatable (default all but peers)"),
                _asked("--draws", type=whole(1), default=300, metavar="N",
                       help="draw random scenes until N agree or are wrong (default 300)"),
                JOURNAL,
            ), "derivatives"),
    Command("effects", "what each effect costs: counts of work, times, bytes",
            _study("effects", "docs"), page="costs"),
    Command("maps", "where a grasp settles, and how robust it is; resumes",
            _study("map_page", "docs", "output", "quick"), RESUMED, "maps"),
    Command("recorder", "recordings are killed: what is left in their bags", partial(_repeated, "recorder"), (
        add_scene, SEED,
        _asked("--kills", dest="times", type=whole(0), default=10, metavar="N", help="how many (default 10)"),
    )),
    Command("steering", "random pause, step, resume and reset calls, each checked", partial(_repeated, "steering"), (
        add_scene, SEED,
        _asked("--calls", dest="times", type=whole(1), default=1000, metavar="N", help="how many (default 1000)"),
    )),
    Command("faults", "fault injection: accidents done to graphs of real processes, some minutes", _faults, (
        _asked("--only", nargs="+", default=[], metavar="NAME", help="these faults alone"),
        _asked("--quick", action="store_true", help="a handful of faults"),
        _asked("--ticks", type=whole(1000), metavar="N",
               help=f"in place of faults, {LONG_SCENE} in lockstep for N ticks: losses, and memory of processes"),
    ), "faults"),
    Command("readers", "damaged files of all kinds against their readers", _readers, (
        _asked("--seconds", type=float, help=SECONDS.format("--count")),
        _asked("--count", type=whole(1), help="how many files"), FIRST, SEED,
        _output("DIRECTORY", "for files that break a reader", Path("runs") / "readers"),
    )),
)

"""The studies of what is promised: `certificate`, `hard` and `fuzz`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from grasp_ros.cli.arguments import add_command, add_output, prepare
from grasp_ros.physics.errors import Refused

Parser = argparse.ArgumentParser


def add_certificate(commands: Any) -> Parser:
    """`grasp study certificate`."""
    text = "where the paper's V jumps, from which p on, and limits of the period"
    sub = add_command(commands, "certificate", _certificate, text)
    add_output(sub, "FILE.md", "put tables and figure into this text")
    return sub


def _certificate(options: argparse.Namespace) -> int:
    from grasp_ros.studies import certificate

    prepare()
    certificate.run(options.output)
    return 0


def add_hard(commands: Any) -> Parser:
    """`grasp study hard`."""
    text = "hard cases, family by family: the error reached, and other solvers beside it"
    sub = add_command(commands, "hard", _hard, text)
    add_output(sub, "FILE.md", "put table and figure into this text")
    sub.add_argument("--alone", action="store_true", help="without other solvers, which takes a minute instead of ten")
    return sub


def _hard(options: argparse.Namespace) -> int:
    from grasp_ros.studies import hard

    prepare()
    return hard.run(options.output, alone=options.alone)


def add_fuzz(commands: Any) -> Parser:
    """`grasp study fuzz`."""
    sub = add_command(commands, "fuzz", _fuzz, "random scenes against all properties")
    sub.add_argument("--seconds", type=float, default=60.0, help="how long (default 60)")
    sub.add_argument("--seed", type=int, default=0, help="another seed draws other scenes (default 0)")
    add_output(sub, "DIRECTORY", "where scenes that fail are written (default fuzz)", Path("fuzz"))
    return sub


def _fuzz(options: argparse.Namespace) -> int:
    from grasp_ros.verification import fuzz

    if not (math.isfinite(options.seconds) and options.seconds > 0.0):
        raise Refused(f"--seconds {options.seconds!r} is not allowed; allowed: a number > 0")
    if options.seed < 0:
        raise Refused(f"--seed {options.seed} is not allowed; allowed: a whole number >= 0")
    prepare()
    return 1 if fuzz.run(options.seconds, options.seed, options.output) else 0

"""`python -m lab`: what examines grasp_ros. Without a name it lists what there is, with a line each."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from grasp_ros.cli.main import run
from grasp_ros.cli.parser import Parser
from lab.commands import COMMANDS

ABOUT = "Measure, and print what was measured. Those with --docs write a page; `make study` writes all pages."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is named; returns the exit status."""
    return run(_parser, (sys.argv[1:] if arguments is None else arguments) or ["--help"])


def _parser() -> argparse.ArgumentParser:
    program = "python -m lab"
    parser = Parser(prog=program, usage=f"{program} NAME [options]", description=ABOUT)
    names = parser.add_subparsers(prog=program, title="studies", required=True, metavar="name")
    for command in COMMANDS:
        command.add(names)
    return parser


if __name__ == "__main__":
    sys.exit(main())

"""`python -m lab`: what examines grasp_ros. Without a name it lists what there is, with a line each."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial

from grasp_ros.cli.main import run
from grasp_ros.cli.parser import Command, Parser
from grasp_ros.physics.errors import Refused
from lab.commands import COMMANDS

# names of modules of the extra `lab`
PACKAGES = ("gmpy2", "heyoka", "jinja2", "mpmath", "psutil", "ruamel", "scipy", "sksundae", "xarray", "zarr")
ABOUT = "Measure, and print what was measured. Those with --docs write a page; `make study` writes all pages."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is named; returns the exit status."""
    return run(_parser, (sys.argv[1:] if arguments is None else arguments) or ["--help"])


def _parser() -> argparse.ArgumentParser:
    program = "python -m lab"
    parser = Parser(prog=program, usage=f"{program} NAME [options]", description=ABOUT)
    names = parser.add_subparsers(prog=program, title="studies", required=True, metavar="name")
    for command in COMMANDS:
        sub = command.add(names)
        sub.set_defaults(command=partial(with_packages, sub.get_default("command")))
    return parser


def with_packages(command: Command, options: argparse.Namespace) -> int:
    """Run a command; a package of the laboratory that is missing is refused by its name."""
    try:
        return command(options)
    except ModuleNotFoundError as error:
        if str(error.name).split(".")[0] not in PACKAGES:
            raise
        raise Refused(f"this needs {error.name}; run `make laboratory`") from None


if __name__ == "__main__":
    sys.exit(main())

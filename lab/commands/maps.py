"""The studies of many runs: `maps` and `many`."""

from __future__ import annotations

import argparse
from typing import Any

from grasp_ros.cli.arguments import add_command, whole
from grasp_ros.cli.checks import prepare
from lab.commands.docs import add_docs, page_directory
from lab.commands.shared import add_study_directory


def add_maps(commands: Any) -> argparse.ArgumentParser:
    """`python -m lab maps`."""
    text = "where a grasp settles, and how robust it is; resumes"
    sub = add_command(commands, "maps", _maps, text)
    add_docs(sub)
    sub.add_argument("--quick", action="store_true", help="few pixels and rows: to see that it works")
    sub.add_argument("--pixels", type=whole(32), default=200, metavar="N", help="of a side of the map (default 200)")
    add_study_directory(sub)
    return sub


def _maps(options: argparse.Namespace) -> int:
    from lab.studies import map_page

    docs = page_directory(options, "maps") or options.output
    prepare()
    print(f"written to {map_page.write(docs, options.output, options.quick, options.pixels)}")
    return 0


def add_many(commands: Any) -> argparse.ArgumentParser:
    """`python -m lab many`."""
    text = "runs a second of an ensemble, beside heyoka and scipy"
    sub = add_command(commands, "many", _many, text)
    sub.add_argument("scene", nargs="?", default="case_01", help="a case of the paper (default case_01)")
    sub.add_argument("--quick", action="store_true", help="few rows: to see that it works")
    return sub


def _many(options: argparse.Namespace) -> int:
    from lab.studies import many_runs

    prepare()
    print(many_runs.report(many_runs.run(options.scene, 0.01 if options.quick else 1.0)))
    return 0

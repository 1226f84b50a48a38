"""The study of many runs: `maps`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from grasp_ros.cli.arguments import add_command, add_study_directory, prepare


def add_maps(commands: Any) -> argparse.ArgumentParser:
    """`grasp study maps`."""
    text = "where a grasp settles, what sampling does to it, how robust it is; resumes"
    sub = add_command(commands, "maps", _maps, text)
    sub.add_argument("--docs", type=Path, default=Path("docs"), metavar="DIRECTORY", help="default: docs")
    sub.add_argument("--quick", action="store_true", help="few pixels and rows: to see that it works")
    add_study_directory(sub)
    return sub


def _maps(options: argparse.Namespace) -> int:
    from grasp_ros.studies import map_page

    prepare()
    print(f"written to {map_page.write(options.docs, options.output, options.quick)}")
    return 0

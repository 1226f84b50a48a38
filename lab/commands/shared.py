"""The options that several studies share: where a page goes, and what was measured."""

from __future__ import annotations

import argparse
from pathlib import Path

from grasp_ros.cli.arguments import add_output

STUDY_DIRECTORY = Path("runs") / "studies"


def add_docs(sub: argparse.ArgumentParser) -> None:
    """Where its page goes."""
    sub.add_argument("--docs", type=Path, metavar="DIRECTORY", help="write the page there as well")


def page_directory(options: argparse.Namespace, name: str) -> Path | None:
    """The directory of pages, if one is wanted.

    Raises
    ------
    Refused
        If the page cannot be written to it: before the work.
    """
    from lab.studies import pages

    if options.docs is not None:
        pages.claim(options.docs / f"{name}.md")
    directory: Path | None = options.docs
    return directory


def add_study_directory(sub: argparse.ArgumentParser) -> None:
    """Where a study keeps what it has measured."""
    text = f"what was measured, which is not measured again, and without --docs the page (default {STUDY_DIRECTORY})"
    add_output(sub, "DIRECTORY", text, STUDY_DIRECTORY)

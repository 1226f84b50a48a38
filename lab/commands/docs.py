"""The option of every study that writes a page."""

from __future__ import annotations

import argparse
from pathlib import Path


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

"""Texts that the studies write: paragraphs, tables, and documents with marked parts."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

from grasp_ros.physics.errors import Refused
from grasp_ros.scene.files import reading, writing

WIDTH = 118


def read(path: Path) -> str:
    """The text of a document.

    Raises
    ------
    Refused
        If it cannot be read.
    """
    with reading(path):
        return path.read_text(encoding="utf-8")


def write(path: Path, text: str) -> None:
    """Write a document.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    with writing(path):
        path.write_text(text, encoding="utf-8")


def put(path: Path, text: str, part: str, block: str) -> str:
    """The text with a marked part replaced; `path` is the document that errors name.

    Raises
    ------
    Refused
        If the text has no such marks.
    """
    begin, end = f"<!-- begin of {part} -->", f"<!-- end of {part} -->"
    if not (begin in text and end in text.split(begin)[1]):
        raise Refused(f"{path}: no marks; allowed: a text with {begin} and {end}")
    before, rest = text.split(begin)
    return f"{before}{begin}\n\n{block}\n\n{end}{rest.split(end)[1]}"


def prose(text: str) -> str:
    """A paragraph, filled."""
    return textwrap.fill(" ".join(text.split()), WIDTH)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows))

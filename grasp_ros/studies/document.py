"""Texts that the studies write: paragraphs, tables, and documents with marked parts."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

WIDTH = 118


def put(text: str, part: str, block: str) -> str:
    """The text with a marked part replaced.

    Raises
    ------
    ValueError
        If the text has no such marks.
    """
    begin, end = f"<!-- begin of {part} -->", f"<!-- end of {part} -->"
    if not (begin in text and end in text.split(begin)[1]):
        raise ValueError(f"the document has no marks; allowed: a text with {begin} and {end}")
    before, rest = text.split(begin)
    return f"{before}{begin}\n\n{block}\n\n{end}{rest.split(end)[1]}"


def prose(text: str) -> str:
    """A paragraph, filled."""
    return textwrap.fill(" ".join(text.split()), WIDTH)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows))

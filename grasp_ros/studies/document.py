"""Texts with marked parts that the studies write."""

from __future__ import annotations


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

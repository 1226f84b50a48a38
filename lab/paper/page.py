"""The page: one HTML file with everything in it, and the same content as Markdown with figures beside it."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup

from grasp_ros.scene.files import writing
from lab.paper.answer import FIGURE
from lab.paper.claims import Claim, Verdict
from lab.paper.equation_table import ALGEBRA, Equation
from lab.paper.equations import CROSSING
from lab.paper.printed import PRINTED
from lab.paper.prints import Compared
from lab.paper.results import Result
from lab.studies import pages

Row = tuple[str, ...]
FIGURES = "paper"  # directory of the figures beside the Markdown page
SIGNS = {Verdict.HOLDS: "\u2713", Verdict.LIMITED: "~", Verdict.FAILS: "\u2717"}  # so that no verdict needs a colour


class Picture(NamedTuple):
    """What stands at a figure of the paper."""

    number: int
    title: str
    caption: str
    readings: Sequence[str]
    compared: Compared  # with the print


class Report(NamedTuple):
    """Everything that the page says."""

    title: str
    subtitle: str
    answer: Sequence[str]  # ten lines
    definitions: Sequence[tuple[str, str]]
    summary: str
    claims: Sequence[Claim]
    sweeps: str
    pictures: Sequence[Picture]
    quantity_heads: Row
    quantities: Sequence[Row]
    prints: str  # how the figures of the paper are read
    agreement: str
    equations: Sequence[Equation]
    results: Sequence[Result]
    doubts: Sequence[tuple[str, str]]
    replays: Sequence[dict[str, Any]]
    origin: str
    images: Mapping[str, bytes]  # PNG


def template(name: str) -> str:
    """The text of a file of the templates."""
    return resources.files(__package__).joinpath("templates", name).read_text(encoding="utf-8")


def write_html(report: Report, path: Path) -> None:
    """Write the page into one file that needs nothing else.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=False)
    environment.filters["told"] = (told := _told(report.claims)).__getitem__
    page = environment.from_string(template("page.html"))
    runs = json.dumps(list(report.replays), separators=(",", ":")).replace("<", "\\u003c")
    text = page.render(
        report=report,
        css=Markup(template("page.css")),
        js=Markup(template("replay.js")),
        runs=Markup(runs),
        model=_figure("svg+xml", template("model.svg").encode(), "The model, Fig. 1 of the paper, with the signs"),
        figure=lambda key, text: _figure("png", report.images[key], text),
        beside=FIGURE,
        printed=PRINTED,
        signs=SIGNS,
        told=told,
    )
    pages.put(path, text)


def write_markdown(report: Report, path: Path) -> None:
    """Write the page as Markdown, and its figures into a directory beside it.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    environment = jinja2.Environment(autoescape=False, undefined=jinja2.StrictUndefined)
    told = _told(report.claims)
    environment.filters |= {"cell": _cell, "told": told.__getitem__}
    directory = path.parent / FIGURES
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for key, image in report.images.items():
            (directory / f"{key}.png").write_bytes(image)
        (directory / "model.svg").write_text(template("model.svg"), encoding="utf-8")
    text = environment.from_string(template("paper.md")).render(
        report=report, beside=FIGURE, printed=PRINTED, signs=SIGNS, told=told)
    pages.put(path, re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n")


def summary(claims: Sequence[Claim]) -> str:
    """How many statements hold."""
    counted = [
        sum(claim.verdict is verdict for claim in claims) for verdict in (Verdict.HOLDS, Verdict.LIMITED, Verdict.FAILS)
    ]
    return (
        f"Of {len(claims)} statements {counted[0]} hold, {counted[1]} hold within stated limits, and {counted[2]} do"
        " not hold. A statement holds as far as its weakest part does; the parts and their checks stand below."
    )


def agreement(rows: Sequence[Equation]) -> str:
    """How many equations agree."""
    numbers = {row.number for row in rows}
    return (
        f"{len(numbers)} equations in {len(rows)} rows; {sum(row.agrees for row in rows)} of them agree."
        f" {sum(row.by == ALGEBRA for row in rows)} compare two ways to write the same function: algebra, which wrong"
        " code breaks and no motion does. The others are held against motions, differentiated to order 8 from the dense"
        f" output: those of the eleven cases, and of the scenes {' and '.join(CROSSING)}, which cross the second"
        " surface of (10), u' = -1/p with u > 0, as no case of the paper does."
    )


def _told(claims: Sequence[Claim]) -> dict[str, str]:
    """By the words of a part, the key of the first statement that has it: it is told there."""
    return {part.statement: claim.key for claim in reversed(claims) for part in claim.parts}


def _figure(kind: str, image: bytes, text: str) -> Markup:
    """An image within the page, and its caption."""
    form = Markup('<figure><img alt="{0}" src="data:image/{1};base64,{2}"><figcaption>{0}.</figcaption></figure>')
    return form.format(text.rstrip("."), kind, base64.b64encode(image).decode("ascii"))


def _cell(text: str) -> str:
    return text.replace("|", "\\|")

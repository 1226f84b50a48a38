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
from grasp_ros.scene.versions import versions
from lab.paper.answer import FIGURE, answer
from lab.paper.claims import Claim, Verdict, tally
from lab.paper.definitions import PRINTS, SUBTITLE, SWEEPS, TITLE, definitions
from lab.paper.equation_table import ALGEBRA, Equation
from lab.paper.equations import CROSSING
from lab.paper.printed import PRINTED
from lab.paper.prints import Compared
from lab.paper.results import Beyond, results
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
    """Everything that was computed for the page."""

    starts: int  # random ones
    claims: Sequence[Claim]
    pictures: Sequence[Picture]
    quantities: tuple[Row, Sequence[Row]]
    equations: Sequence[Equation]
    found: Beyond
    doubts: Mapping[str, str]
    replays: Sequence[dict[str, Any]]
    images: Mapping[str, bytes]  # PNG


def write_html(report: Report, path: Path) -> None:
    """Write the page into one file that needs nothing else.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    runs = json.dumps(list(report.replays), separators=(",", ":")).replace("<", "\\u003c")
    pages.put(path, _render(
        "page.html", report, autoescape=True, css=Markup(_template("page.css")), js=Markup(_template("replay.js")),
        runs=Markup(runs), figure=lambda key, text: _figure("png", report.images[key], text),
        model=_figure("svg+xml", _template("model.svg").encode(), "The model, Fig. 1 of the paper, with the signs"),
    ))


def write_markdown(report: Report, path: Path) -> None:
    """Write the page as Markdown, and its figures into a directory beside it.

    Raises
    ------
    Refused
        If it cannot be written.
    """
    directory = path.parent / FIGURES
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for key, image in report.images.items():
            (directory / f"{key}.png").write_bytes(image)
        (directory / "model.svg").write_text(_template("model.svg"), encoding="utf-8")
    text = _render("paper.md", report, autoescape=False)
    pages.put(path, re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n")


def _template(name: str) -> str:
    return resources.files(__package__).joinpath("templates", name).read_text(encoding="utf-8")


def _render(name: str, report: Report, *, autoescape: bool, **more: object) -> str:
    """A template with what both pages say."""
    environment = jinja2.Environment(autoescape=autoescape, undefined=jinja2.StrictUndefined)
    # by the words of a part, the key of the first statement that has it: it is told there
    told = {part.statement: claim.key for claim in reversed(report.claims) for part in claim.parts}
    environment.filters |= {"cell": lambda text: text.replace("|", "\\|"), "told": told.__getitem__}
    return environment.from_string(_template(name)).render(
        report._asdict(), title=TITLE, subtitle=SUBTITLE, sweeps=SWEEPS, prints=PRINTS, printed=PRINTED, signs=SIGNS,
        beside=FIGURE, told=told, answer=answer(report.claims, report.found), summary=summary(report.claims),
        agreement=agreement(report.equations), results=results(report.found), definitions=definitions(report.starts),
        origin="Computed with " + ", ".join(f"{name} {version}" for name, version in versions().items()) + ".", **more,
    )


def summary(claims: Sequence[Claim]) -> str:
    """How many statements hold."""
    holds, limited, fails = tally(claims)
    return (
        f"Of {len(claims)} statements {holds}, {limited}, and {fails}. A statement holds as far as its weakest part"
        " does; the parts and their checks stand below."
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


def _figure(kind: str, image: bytes, text: str) -> Markup:
    """An image within the page, and its caption."""
    form = Markup('<figure><img alt="{0}" src="data:image/{1};base64,{2}"><figcaption>{0}.</figcaption></figure>')
    return form.format(text.rstrip("."), kind, base64.b64encode(image).decode("ascii"))

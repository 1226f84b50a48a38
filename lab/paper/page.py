"""The page: one HTML file with everything in it, and the same content as Markdown with figures beside it."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup
from ruamel.yaml import YAML

from grasp_ros.scene.files import writing
from lab.paper import arms, beyond, cases, claims, equation_table, knife_edge, measures, scatter, universal
from lab.paper.claims import Claim, Kind, Verdict, tally
from lab.paper.equation_table import Equation
from lab.paper.equations import CROSSING
from lab.paper.printed import PRINTED
from lab.paper.prints import Compared
from lab.paper.results import Beyond, tables
from lab.paper.uncertainties import Uncertainties
from lab.studies import pages

Row = tuple[str, ...]
TEMPLATES = Path(__file__).with_name("templates")
FIGURES = "paper"  # directory of the figures beside the Markdown page
NUMBERED = "P", "C"  # letters of the claims that the paper numbers
WORDS = {  # what `words.yaml` names beside the fields of a report
    "math": math, "arms": arms, "beyond": beyond, "cases": cases, "edge": knife_edge, "measures": measures,
    "rule": claims, "scatter": scatter, "table": equation_table, "universal": universal, "kinds": Kind,
    "verdicts": Verdict, "steps": arms.STEPS, "never": math.inf, "crossing": CROSSING, "tally": tally,
}
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
    uncertainties: Uncertainties
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
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _render(name: str, report: Report, *, autoescape: bool, **more: object) -> str:
    # by the words of a part, the key of the first statement that has it: it is told there
    told = {part.statement: claim.key for claim in reversed(report.claims) for part in claim.parts}
    filters = {"cell": lambda text: text.replace("|", "\\|"), "told": told.__getitem__}
    return _filled(
        name, filters, autoescape, **report._asdict() | words(report), printed=PRINTED, signs=SIGNS, told=told,
        summary=summary(report.claims), tables=tables(report.found), stamp=pages.stamp(), **more,
    )


def words(report: Report) -> dict[str, Any]:
    """What both pages say, by the keys of `words.yaml`."""
    numbered = [claim for claim in report.claims if claim.key.startswith(NUMBERED)]
    text = _filled("words.yaml", {"f": format}, False, **WORDS, numbered=numbered, **report._asdict())
    return dict(YAML(typ="safe", pure=True).load(text))


def _filled(name: str, filters: Mapping[str, Callable[..., object]], autoescape: bool, **numbers: object) -> str:
    environment = jinja2.Environment(autoescape=autoescape, undefined=jinja2.StrictUndefined)
    environment.filters |= filters
    return environment.from_string(_template(name)).render(numbers)


def summary(claims: Sequence[Claim]) -> str:
    """How many statements hold."""
    holds, limited, fails = tally(claims)
    return (
        f"Of {len(claims)} statements {holds}, {limited}, and {fails}. A statement holds as far as its weakest part"
        " does; the parts and their checks stand below."
    )


def _figure(kind: str, image: bytes, text: str) -> Markup:
    """An image within the page, and its caption."""
    form = Markup('<figure><img alt="{0}" src="data:image/{1};base64,{2}"><figcaption>{0}.</figcaption></figure>')
    return form.format(text.rstrip("."), kind, base64.b64encode(image).decode("ascii"))

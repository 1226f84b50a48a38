"""The page: one HTML file with everything in it, and a short one as Markdown, with figures and a table beside it."""

from __future__ import annotations

import base64
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
from markupsafe import Markup
from ruamel.yaml import YAML

from grasp_ros.scene.files import writing
from lab.paper import arms, beyond, cases, claims, equation_table, measures, scatter, universal
from lab.paper.claims import Claim, Kind, Part, Verdict, tally
from lab.paper.equation_table import PRINTED, Equation
from lab.paper.equations import CROSSING
from lab.paper.prints import Compared
from lab.paper.results import Beyond, Uncertainties, tables
from lab.studies import pages
from lab.studies.records import write_csv

Row = tuple[str, ...]
TEMPLATES = Path(__file__).with_name("templates")
FIGURES = "paper"  # directory of the figures beside the Markdown page
NUMBERED = "P", "C"  # letters of the claims that the paper numbers
WORDS = {  # what `words.yaml` names beside the fields of a report
    "math": math, "arms": arms, "beyond": beyond, "cases": cases, "measures": measures,
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


class Line(NamedTuple):
    """A line of the table beside the Markdown page."""

    section: str
    number: str  # of a statement and its part, a figure, an equation
    statement: str
    found: str = ""
    allowed: str = ""
    verdict: str = ""
    note: str = ""


def write_html(report: Report, path: Path) -> None:
    """Write the page into one file that needs nothing else."""
    runs = json.dumps(list(report.replays), separators=(",", ":")).replace("<", "\\u003c")
    pages.put(path, _render(
        "page.html", report, autoescape=True, css=Markup(_template("page.css")), js=Markup(_template("replay.js")),
        runs=Markup(runs), figure=lambda key, text: _figure("png", report.images[key], text),
        model=_figure("svg+xml", _template("model.svg").encode(), "The model, Fig. 1 of the paper, with the signs"),
    ))


def write_markdown(report: Report, path: Path) -> None:
    """Write the short page as Markdown, and beside it a table of all rows and a directory of figures."""
    directory = path.parent / FIGURES
    with writing(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for key, image in report.images.items():
            (directory / f"{key}.png").write_bytes(image)
        (directory / "model.svg").write_text(_template("model.svg"), encoding="utf-8")
    write_csv(Line._fields, lines(report), path.with_suffix(".csv"))
    text = _render("paper.md", report, autoescape=False)
    pages.put(path, re.sub(r"\n{3,}", "\n\n", text).rstrip() + "\n")


def _template(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


def _render(name: str, report: Report, *, autoescape: bool, **more: object) -> str:
    told = _told(report.claims)
    filters = {"cell": lambda text: text.replace("|", "\\|"), "told": told.__getitem__}
    return _filled(
        name, filters, autoescape, **report._asdict() | words(report), printed=PRINTED, signs=SIGNS, told=told,
        summary=summary(report.claims), tables=tables(report.found), stamp=pages.stamp(), **more,
    )


def _told(claims: Sequence[Claim]) -> dict[str, str]:
    """By the words of a part, the key of the first statement that has it: it is told there."""
    return {part.statement: claim.key for claim in reversed(claims) for part in claim.parts}


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
    return f"Of {len(claims)} statements {holds}, {limited}, and {fails}."


def lines(report: Report) -> Iterator[Line]:
    """The table: parts of statements, checks of each part once, prints, equations, quantities, results and texts."""
    told, said, numbers = _told(report.claims), words(report), tables(report.found)
    for claim in report.claims:
        for number, part in enumerate(claim.parts, 1):
            yield _part(f"{claim.key}.{number}", claim.where, part)
            for check in part.checks if told[part.statement] == claim.key else ():
                yield Line("checks", f"{claim.key}.{number}", check.text, check.value, "",
                           "holds" if check.holds else "not", check.kind.value)
    for picture in report.pictures:
        for each in picture.compared.readings:
            yield Line("figures", str(picture.number), each.printed, each.ours, each.tolerance, _agrees(each.agrees),
                       each.what)
    printed = {each.number: each for each in PRINTED}
    for row in report.equations:
        text = printed[row.number]
        yield Line("equations", row.number, text.text.replace('"', ""), f"{row.compared}: {row.found + 0.0:.3g}",
                   "> 0" if row.margin else f"{row.allowed:.3g}", _agrees(row.agrees),
                   f"{row.says}; {row.function}; by {row.by}. {text.open}".strip())
    heads, quantities = report.quantities
    for name, *values in quantities:
        yield Line("quantities", "", name, _cells(dict(zip(heads[1:], values, strict=True))))
    for key, result in said["results"].items():
        yield Line("results", key, result["title"], note=f"{result['text']} {result['more']}")
        yield from (Line("results", key, "", _cells(row)) for row in numbers[key])
    for section in ("uncertainties", "definitions"):
        yield from (Line(section, "", name, note=text) for name, text in said[section].items())


def _part(number: str, where: str, part: Part) -> Line:
    close = " Close to a bound: other random starts could turn it." if part.close else ""
    turned = f" Turned by: {part.turned_in_short}." if part.turned else ""
    return Line("statements", number, part.statement, part.limits_in_short if part.limits else "", part.threshold,
                part.verdict.value, f"({where}) {part.why}{close}{turned}")


def _agrees(whether: bool) -> str:
    return "agrees" if whether else "does not"


def _cells(row: Mapping[str, str]) -> str:
    return "; ".join(f"{head}: {cell}" for head, cell in row.items())


def _figure(kind: str, image: bytes, text: str) -> Markup:
    """An image within the page, and its caption."""
    form = Markup('<figure><img alt="{0}" src="data:image/{1};base64,{2}"><figcaption>{0}.</figcaption></figure>')
    return form.format(text.rstrip("."), kind, base64.b64encode(image).decode("ascii"))

"""Measured pages are not older than what they measure: what must be equal is counted again, and times have an age.

Who changes the words of a template, a case, an effect or a bound writes the page anew, or by hand where nothing has to
be measured. Who makes the code faster need not measure at once: a page may be older than the last change of its sources
by `ALLOWED`. Results that are only known after minutes (errors of hard cases, random scenes, maps) have that age, too;
tests of their own hold the cases within their bounds.
"""

from __future__ import annotations

import csv
import functools
import re
import subprocess
from collections.abc import Iterator, Sequence
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from jinja2 import Environment, nodes

from grasp_ros import scene as scenes
from grasp_ros.accuracy.measure import contender_of
from grasp_ros.methods.registry import EXACT
from grasp_ros.simulation import GRID_POINTS, simulate
from lab.cases.registry import cases
from lab.drills.faults import run as faults
from lab.paper import page as paper
from lab.paper.cases import FIGURES
from lab.paper.equation_table import EQUATIONS
from lab.paper.statements import STATEMENTS
from lab.studies import accuracy, certificate, derivatives, digits, domain, effects, hard, pages

DOCS = Path(__file__).parents[2] / "docs"
ALLOWED = timedelta(days=30)
MOTION = ("grasp_ros/physics", "grasp_ros/scene", "grasp_ros/exact", "grasp_ros/simulation")
MEASURED = {  # what the numbers of a page depend on
    "accuracy": (*MOTION, "grasp_ros/methods"), "costs": MOTION,
    "derivatives": (*MOTION, "grasp_ros/sensitivity", "lab/oracles"),
    "digits": (*MOTION, "config", "lab/reference"), "faults": ("grasp_ros/graph", "lab/drills/faults"),
    "fuzz": (*MOTION, "lab/cases", "lab/oracles"),
    "hard": (*MOTION, "lab/cases"), "jumps": MOTION, "maps": (*MOTION, "grasp_ros/observe", "grasp_ros/maps"),
    "paper": (*MOTION, "lab/paper"),
}
TEMPLATES = {path.stem: path for path in (*pages.TEMPLATES.iterdir(), *paper.TEMPLATES.glob("*.md"))}
STAMP = re.compile(r"Measured on (\d{4}-\d\d-\d\d) from commit [0-9a-f]+( with changes)?: .*, python [\d.]+, ")


def page(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def table(name: str) -> list[dict[str, str]]:
    """The rows of a table beside the pages."""
    with (DOCS / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def cells(name: str, head: str) -> list[list[str]]:
    """The rows of the table of a page whose first head is this."""
    table = page(name).split(f"\n| {head} |")[1].split("\n\n")[0]
    return [line.strip("| ").split(" | ") for line in table.splitlines()[2:]]


def words(template: Path) -> Iterator[str]:
    """What a template says whatever the numbers are, piece by piece."""
    for node in Environment().parse(template.read_text(encoding="utf-8")).body:
        if isinstance(node, nodes.Output):
            yield from (" ".join(part.data.split()) for part in node.nodes if isinstance(part, nodes.TemplateData))


def test_every_template_has_a_page_and_sources() -> None:
    found = {*TEMPLATES, "derivatives"} ^ {*MEASURED, "domain"}
    assert not found, f"{found}: MEASURED says, of each template but domain.md, what its numbers depend on"


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_page_says_what_its_template_says(name: str) -> None:
    text, place = " ".join(page(name).split()), 0
    for part in words(TEMPLATES[name]):
        assert part in text[place:], part
        place = text.index(part, place) + len(part)


@pytest.mark.parametrize(("name", "sources"), MEASURED.items())
def test_a_page_is_not_older_than_what_it_measures(name: str, sources: Sequence[str]) -> None:
    found = [date.fromisoformat(stamp[1]) for stamp in STAMP.finditer(page(name))]
    assert found, "no date, commit and machine"
    log = ["git", "-C", str(DOCS.parent), "log", "-1", "--format=%cs", "--", *sources]
    try:
        changed = subprocess.run(log, capture_output=True, text=True, check=True).stdout.strip()
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("there is no git repository to ask")
    assert date.fromisoformat(changed) - min(found) <= ALLOWED, f"python -m lab ... writes {name}.md"


def test_every_table_of_derivatives_is_stamped() -> None:
    tables = {name: page("derivatives").split(f"<!-- {name} -->")[1] for name in derivatives.TABLES}
    assert [name for name, text in tables.items() if not STAMP.search(text)] == []


def test_make_draws_the_random_scenes_of_the_page() -> None:
    [options] = re.findall(r"^fuzz_options := (.*)$", (DOCS.parent / "Makefile").read_text(encoding="utf-8"), re.M)
    [command] = re.findall(r"`python -m lab fuzz (--seed .* --docs docs)`", page("fuzz"))
    drawn = [dict(re.findall(r"--(seed|draws) (\d+)", text)) for text in (options, command)]
    assert drawn[0] == drawn[1]


def test_the_domain_is_that_of_the_code() -> None:
    assert page("domain") == pages.render("domain", **domain.numbers())


def test_the_work_of_each_effect_is_that_of_the_code() -> None:
    bare = scenes.load(effects.SCENE)
    rows = {row[0]: [row[2], row[4], row[6], row[7]] for row in cells("costs", "scene")}
    expected = {name: effects.counts(scene) for name, scene in effects.variants(bare).items()}
    assert rows == expected, "`python -m lab effects --docs docs` writes docs/costs.md"


@pytest.mark.slow
def test_jumps_and_limits_are_those_of_the_code() -> None:
    assert cells("jumps", "scene") == certificate.jump_rows()
    assert cells("jumps", "Kp, N/m") == certificate.limit_rows()


def test_the_work_of_each_accuracy_is_that_of_the_code() -> None:
    subjects = {scene.name: scene for scene in accuracy.default_scenes()}
    exact = contender_of(EXACT)
    rows = [row for row in table("accuracy/records") if row["method"] == EXACT]
    assert len(rows) > 5 * len(subjects)
    for row in rows:
        scene = subjects[row["scene"]]
        answer = exact.build(scene, float(row["setting"]))(np.linspace(0.0, scene.duration, GRID_POINTS))
        assert [str(answer.steps), "/".join(map(str, answer.touches))] == [row["steps"], row["found"]], row


def test_the_hard_cases_are_those_of_the_code() -> None:
    rows = [(row["family"], row["case"], row["promised"]) for row in table("hard")]
    assert rows == [(case.family.name, case.name, f"{case.bound:.1g}") for case in cases()]


def test_the_digits_are_those_of_all_scenes() -> None:
    rows = {row["scene"]: row for row in table("digits")}
    assert sorted(rows) == sorted(scenes.names())
    assert all(digits.UNKNOWN not in row["reason"] for row in rows.values())
    assert [row[0] for row in cells("digits", "scene")] == [
        name for name in sorted(rows, key=lambda name: -float(rows[name]["ratio"]))
        if float(rows[name]["ratio"]) <= digits.MOST][: digits.WORST]


def test_a_run_is_told_from_one_with_larger_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scenes.load("hammer")
    assert 0.0 < digits.measure(scene).ratio <= digits.MOST
    coarse = functools.partial(simulate, setting=1e-12)
    monkeypatch.setattr(digits, "simulate", coarse)
    assert digits.measure(scene).reasons == [digits.UNKNOWN]


def test_the_regression_scenes_are_counted() -> None:
    numbers = hard.regression_numbers()
    assert cells("hard", "rule") == numbers["refused"]
    assert f"{numbers['inside']} of them are inside" in page("hard")


def test_the_faults_are_those_of_the_code() -> None:
    assert [row["fault"] for row in table("faults")] == [drill.fault for drill in faults.all_drills()]


def test_the_statements_of_the_paper_are_those_of_the_code() -> None:
    rows = {section: [row for row in table("paper") if row["section"] == section] for section in (
        "statements", "checks", "equations")}
    parts = {f"{each.key}.{number}": part for each in STATEMENTS.values() for number, part in enumerate(each.parts, 1)}
    found = {row["number"]: row["statement"] for row in rows["statements"]}
    assert list(found) == list(parts)
    expected = {number: getattr(part, "statement", found[number]) for number, part in parts.items()}
    assert found == expected
    assert {found[row["number"]] for row in rows["checks"]} == {*found.values()}
    assert [row["number"] for row in rows["equations"]] == [name.split()[0] for name in EQUATIONS]
    assert [row[1] for row in cells("paper", "figure")] == [figure.caption for figure in FIGURES]
    lines = re.findall(r"^\| ([PCT]\d+) \| (.*?) \| \*\*", page("paper"), re.M)
    assert lines == [(each.key, each.statement) for each in STATEMENTS.values()]

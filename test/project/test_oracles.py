"""The oracles O1 to O15 are defined once, in docs/oracles.md; whoever names one finds it there, and each is used."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

from lab.cases.registry import cases
from lab.paper.statements import STATEMENTS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "oracles.md"
NUMBER = re.compile(r"\bO(?:1[0-9]|[1-9])\b")
SECTIONS = {
    found[1]: found[2]
    for found in re.finditer(r"^## (O\d+) .*?\n(.*?)(?=^## |\Z)", PAGE.read_text(encoding="utf-8"), re.M | re.S)
}
SEARCHED = [
    path
    for path in (
        *(ROOT / "grasp_ros").rglob("*.py"), *(ROOT / "test").rglob("*.py"), *(ROOT / "docs").rglob("*.md"),
        *ROOT.glob("*.md"),
    )
    if path != Path(__file__)
]


def listed(name: str, key: str) -> list[str]:
    """The words of one line of a section."""
    line = re.search(rf"^\* {key}:? (.*?)(?=^\* |\Z)", SECTIONS[name], re.M | re.S)
    assert line, f"{name} says nothing of {key}"
    return re.findall(r"[\w./]+", line[1])


def test_the_numbers_are_defined_in_their_order() -> None:
    assert list(SECTIONS) == [f"O{number}" for number in range(1, 16)]


def test_every_number_that_is_used_is_defined() -> None:
    used = {name: path for path in SEARCHED for name in NUMBER.findall(path.read_text(encoding="utf-8"))}
    assert len(used) > 10
    assert {name: path for name, path in used.items() if name not in SECTIONS} == {}


def test_no_statement_of_the_paper_has_the_name_of_an_oracle() -> None:
    assert SECTIONS.keys().isdisjoint(STATEMENTS)
    for name in ("paper.md", "paper.csv"):
        assert not NUMBER.findall((ROOT / "docs" / name).read_text(encoding="utf-8")), name


@pytest.mark.parametrize("name", SECTIONS)
def test_functions_that_compute_an_oracle_exist(name: str) -> None:
    for function in listed(name, "Computed by"):
        module, _, attribute = function.rpartition(".")
        assert hasattr(importlib.import_module(module), attribute), function


@pytest.mark.parametrize("name", SECTIONS)
def test_families_of_cases_are_those_that_name_the_oracle(name: str) -> None:
    families = {case.family.name for case in cases() if name in NUMBER.findall(case.oracle)}
    assert set(listed(name, "Families")) == (families or {"none"})


@pytest.mark.parametrize("name", SECTIONS)
def test_tests_of_an_oracle_name_it(name: str) -> None:
    tests = listed(name, "Tests")
    assert tests
    for test in tests:
        assert name in NUMBER.findall((ROOT / test).read_text(encoding="utf-8")), test

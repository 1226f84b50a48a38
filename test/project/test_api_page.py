"""docs/api.md: every example runs, and what the page lists is there."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene, simulation
from grasp_ros.exact import Integrator
from grasp_ros.graph import bag

ROOT = Path(__file__).parents[2]
README, PAGE = ROOT / "README.md", ROOT / "docs" / "api.md"
SECTIONS = {part.split("\n")[0]: part for part in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]}


def blocks(section: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", SECTIONS[section], re.S)


@pytest.mark.parametrize(
    "section", [pytest.param(name, marks=pytest.mark.slow if name == "Bags" else ()) for name in SECTIONS]
)
def test_examples_of_a_section_run(section: str, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch,
                                   tmp_path: Path) -> None:
    namespace: dict[str, Any] = {}
    if section == "Bags":
        namespace["path"] = request.getfixturevalue("two_runs")[0]
    monkeypatch.chdir(tmp_path)
    assert blocks(section)
    for source in blocks(section):
        exec(compile(source, f"{PAGE.name}: {section}", "exec"), namespace)


def test_the_first_script_has_ten_lines_and_leaves_what_the_commands_leave(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    [source] = blocks("The command line in ten lines")
    assert len([line for line in source.splitlines() if line]) == 10
    assert f"```python\n{source}```" in README.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    exec(compile(source, PAGE.name, "exec"), {})
    assert re.fullmatch(r"reached the end of the horizon touches: \d+ \d+\nV_c at both ends: \S+ \S+ J\n",
                        capsys.readouterr().out)
    assert {path.name for path in tmp_path.iterdir()} == {"case.npz", "case.png"}


def members(section: str) -> set[str]:
    """Names in the first column of the tables of a section."""
    rows = re.findall(r"^\| (`.*?) \|", SECTIONS[section], re.M)
    return {name for row in rows for name in re.findall(r"`(\w+)[(`]", row)}


def test_what_the_page_lists_is_there(tmp_path: Path) -> None:
    case = scene.load("case_01", ["time.duration_s=0.01"])
    run = simulation.simulate(case)
    for section, thing in (
        ("Simulating", run), ("Integrator", Integrator(case.system, continuous=False)),
        ("A plant for a controller of your own", simulation.SampledPlant(case.system, case.period_ns)),
    ):
        arguments = set(inspect.signature(simulation.simulate).parameters) if section == "Simulating" else set()
        assert members(section) - arguments
        assert {name for name in members(section) - arguments if not hasattr(thing, name)} == set()
    fields = {field.name for field in dataclasses.fields(bag.Recording)}
    assert {name for name in members("Bags") if name not in fields and not hasattr(bag.Recording, name)} == set()
    run.save(tmp_path / "case.npz")
    listed = re.search(r"`numpy.load` finds in the file (.*?)\.\n", SECTIONS["Simulating"], re.S)
    assert listed is not None
    with np.load(tmp_path / "case.npz") as data:
        assert set(data.files) <= set(re.findall(r"`(\w+)`", listed[1]))

"""The contracts of pyproject.toml between rooms hold, files stay small, and tests mirror the rooms."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for room in ("grasp_ros", "lab") for path in (ROOT / room).rglob("*.py"))
ROOMS = {path.name for path in (ROOT / "grasp_ros").iterdir() if (path / "__init__.py").is_file()}
LINES = 300
LINTER = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache"]


def broken(directory: Path) -> list[str]:
    """Names of the contracts that do not hold in a checkout."""
    result = subprocess.run(LINTER, cwd=directory, capture_output=True, text=True, timeout=120, check=False)
    assert "Contracts: " in result.stdout, result.stdout + result.stderr
    return re.findall(r"^(.+) BROKEN", result.stdout, re.M)


def test_imports_keep_the_contracts() -> None:
    assert broken(ROOT) == []


def test_what_is_made_is_cleaned() -> None:
    """All that git ignores in the checkout but results of runs."""
    recipe = (ROOT / "Makefile").read_text().split("\nclean:\n")[1].replace("$(VENV)", ".venv").split()
    ignored = re.findall(r"^/(.+)/$", (ROOT / ".gitignore").read_text(), re.M)
    assert [name for name in ignored if not any(map(Path(name).match, recipe))] == ["runs", "fuzz"]


def test_a_forbidden_import_is_seen(tmp_path: Path) -> None:
    for room in ("grasp_ros", "lab", "pyproject.toml"):
        source = ROOT / room
        subprocess.run(["cp", "-r", str(source), str(tmp_path)], check=True)
    for file, line in (("physics/energy.py", "import lab.cases"), ("simulation/losses.py", "import rclpy"),
                       ("cli/plot.py", "import grasp_ros.graph.nodes.plant")):
        with (tmp_path / "grasp_ros" / file).open("a") as source_file:
            source_file.write(f"\n{line}\n")
    assert len(broken(tmp_path)) == 3


def test_nothing_lies_loose_at_the_root() -> None:
    loose = {path.name for path in (ROOT / "grasp_ros").iterdir() if path.name != "__pycache__"} - ROOMS
    assert loose == {"__init__.py", "__init__.pyi", "py.typed"}


def test_tests_mirror_the_rooms() -> None:
    folders = {path.parent.name for path in (ROOT / "test").rglob("test_*.py")}
    assert folders == {*ROOMS, "lab", "project"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_files_stay_small(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LINES

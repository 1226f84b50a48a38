"""README and pages: they print what their commands and scripts print, and the site is built without a warning."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.image import imread

from lab.site import examples

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
LONG = {f"docs/{name}.md" for name in (
    "tutorials/map", "tutorials/controller", "tutorials/exercises", "how-to/recover-a-bag",
    "how-to/identify-parameters", "how-to/choose-gains", "how-to/export-to-pandas", "how-to/test-your-node",
    "how-to/compare-methods")}
PAGES = [page for page in (README, *sorted((ROOT / "docs").rglob("*.md"))) if examples.has_examples(page.read_text())]


def marks(page: Path) -> list[pytest.MarkDecorator]:
    """How long the commands of a page take."""
    slow = [pytest.mark.slow] if examples.has_examples(page.read_text(), ("console", "sh")) else []
    return [*slow, pytest.mark.thorough] if page.relative_to(ROOT).as_posix() in LONG else slow


@pytest.mark.parametrize("page", [pytest.param(page, id=page.relative_to(ROOT).as_posix(), marks=marks(page))
                                  for page in PAGES])
def test_a_page_prints_what_its_examples_print(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "log"))
    pyplot.switch_backend("agg")
    before = set(pyplot.get_fignums())
    (tmp_path / "page").mkdir()
    outputs = examples.run(page, tmp_path / "page")
    for number in set(pyplot.get_fignums()) - before:
        pyplot.close(number)
    assert [output for output in outputs if not output.holds] == []
    for name in examples.PICTURE.findall(page.read_text(encoding="utf-8")):
        committed, drawn = page.parent / name, tmp_path / "page" / Path(name).name
        assert committed.exists() or drawn.is_file(), name
        if committed.exists() and drawn.is_file():
            assert np.abs(imread(committed) - imread(drawn)).mean() < 0.02, name


def test_every_tutorial_and_how_to_page_has_something_that_runs() -> None:
    shown_only = {"how-to/operate-the-graph.md", "how-to/run-over-a-network.md", "how-to/add-an-effect.md"}
    pages = {page.relative_to(ROOT / "docs").as_posix() for room in ("tutorials", "how-to")
             for page in (ROOT / "docs" / room).glob("*.md")}
    assert pages - {page.relative_to(ROOT / "docs").as_posix() for page in PAGES[1:]} <= shown_only


@pytest.mark.parametrize(("text", "said", "printed"), [
    ("```python\nprint(1)\n```\n\n```text\n2\n```\n", "2\n", "1\n"),
    ("```console\n$ echo a\nb\n$ echo c\n...\n```\n", "b\n", "a\n"),
])
def test_a_wrong_output_is_seen_and_can_be_rewritten(text: str, said: str, printed: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    outputs = examples.run(page, tmp_path)
    assert [(own.said, own.printed) for own in outputs if not own.holds] == [(said, printed)]
    page.write_text(examples.rewritten(text, outputs))
    assert all(own.holds for own in examples.run(page, tmp_path))


def test_a_command_that_fails_is_an_error(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("```sh\nfalse\n```\n")
    with pytest.raises(RuntimeError, match="false"):
        examples.run(page, tmp_path)


def test_the_readme_is_short_and_its_script_has_ten_lines() -> None:
    text = README.read_text(encoding="utf-8")
    assert 80 <= len(text.splitlines()) <= 100
    [script] = [block[2] for block in examples.BLOCK.findall(text) if block[0] == "python"]
    assert len([line for line in script.splitlines() if line]) <= 10


@pytest.mark.slow
@pytest.mark.thorough
def test_the_site_is_built_strictly(tmp_path: Path) -> None:
    """Every link, anchor and name of the reference leads somewhere; the figures of the pages are drawn."""
    result = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--site-dir", str(tmp_path)], cwd=ROOT,
        capture_output=True, text=True, timeout=1200, check=False)
    assert result.returncode == 0, result.stderr
    assert all((tmp_path / "tutorials" / f"{name}.png").stat().st_size > 10_000
               for name in ("restitution", "bifurcation", "closed_form", "map_last_outside"))
    commands = (tmp_path / "reference" / "commands" / "index.html").read_text(encoding="utf-8")
    assert all(f">grasp {name}<" in commands for name in ("simulate", "map", "run", "verify"))

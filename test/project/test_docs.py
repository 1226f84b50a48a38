"""The pages as they lie in the repository: every link leads somewhere, and every file can be reached.

What is made while the site is built, figures of examples, `test_pages.py` looks at.
"""

from __future__ import annotations

import re
import tomllib
from itertools import chain
from pathlib import Path

import pytest

from lab.site.__main__ import written
from lab.site.examples import has_examples

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
DOCS = ROOT / "docs"
PAGES = [README, ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]


def links(page: Path) -> list[tuple[Path, str]]:
    """Files of this repository that a page links to or shows, with the anchor or an empty text."""
    text = re.sub(r"(?ms)^ {4}[^\n]*|^```.*?^```", "", page.read_text(encoding="utf-8"))  # code may have brackets, too
    targets = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'<img src="([^"]+)"', text)
    found = [target.partition("#") for target in targets if "://" not in target]
    return [((page.parent / path).resolve() if path else page, anchor) for path, _, anchor in found]


def anchors(page: Path) -> set[str]:
    """Anchors of the headings of a page, as GitHub names them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_reference_is_what_the_code_says() -> None:
    """Written by `python -m lab.site`."""
    for page, text in written().items():
        assert page.read_text(encoding="utf-8") == text, f"{page}: write it with python -m lab.site"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    drawn = has_examples(page.read_text(encoding="utf-8"))  # figures of examples
    for path, anchor in links(page):
        assert path.exists() or (drawn and path.suffix == ".png"), path
        assert not anchor or anchor in anchors(path), (path, anchor)


def test_the_readme_has_every_package_and_extra() -> None:
    """Of what a table of pyproject.toml names; pytest-xdist, say, is under pytest."""
    listed = README.read_text(encoding="utf-8").split("## Packages, and why")[1].split("\n## ")[0].lower()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    packages = " ".join([*project["dependencies"], *chain(*extras.values())]).lower()
    names = re.findall(r"(?:^| )(?!grasp_ros)(?:types-)?(ros-[\w-]+|[\w.]+)", packages)
    assert [name for name in [*names, *(f"`{extra}`" for extra in extras)] if name not in listed] == []


def test_every_page_and_picture_can_be_reached() -> None:
    """From the README or the navigation of the site."""
    named = re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    reached, waiting = set(), [README, *(path for name in named if (path := DOCS / name).exists())]
    while waiting:
        page = waiting.pop()
        reached.add(page)
        if page.suffix == ".md":
            waiting += [path for path, _ in links(page) if path not in reached and path.exists()]
    lying = {path for path in DOCS.rglob("*") if path.is_file()}
    assert lying <= reached

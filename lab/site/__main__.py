"""`python -m lab.site`: write the pages of the reference, which the code itself says, into `docs/reference`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lab.site import nodes, reference

DIRECTORY = Path(__file__).parents[2] / "docs" / "reference"
PAGES: dict[str, Callable[[], str]] = {
    "python": reference.python, "scenes": reference.scene_keys, "commands": reference.commands,
    "topics": reference.topics_page, "nodes": nodes.page, "exit-codes": reference.statuses,
}


def written() -> dict[Path, str]:
    """Each page and its text."""
    return {DIRECTORY / f"{name}.md": f"{write()}\n" for name, write in PAGES.items()}


if __name__ == "__main__":
    for page, text in written().items():
        page.write_text(text, encoding="utf-8")

"""Pages: a template has the words, a study gives the numbers, and a stamp says when, from which commit, and where."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

import jinja2

from grasp_ros.scene.files import writing
from lab.studies.records import describe_machine

HOME = Path(__file__).parents[2]
TEMPLATES = Path(__file__).with_name("templates")
PRODUCT = "grasp_ros", "config"  # what is measured


def write(docs: Path | None, name: str, **numbers: object) -> None:
    """Write docs/NAME.md from its template with these numbers and a stamp; without a directory print it."""
    text = render(name, stamp=stamp(), **numbers)
    if docs is None:
        print(text, end="")
    else:
        put(docs / f"{name}.md", text)


def put(path: Path, text: str) -> None:
    """Write a text into a file, and make the directory that it needs; say so. Refused: it cannot be written."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    print(f"written to {path}")


def render(name: str, **numbers: object) -> str:
    """The text of a page; a number that its template names and that is missing is an error."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), undefined=jinja2.StrictUndefined, autoescape=False,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )
    environment.globals["table"] = table
    environment.filters["f"] = format
    return environment.get_template(f"{name}.md").render(numbers)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows))


def claim(path: Path) -> None:
    """Refuse, before the work, a file that could not be written to where it is to go."""
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        there = path.exists()
        path.open("a", encoding="utf-8").close()
        if not there:
            path.unlink()


def stamp() -> str:
    """The sentence that every measured page carries: date, commit and whether what is measured differs, machine."""
    machine = describe_machine()
    system, cpu = machine.pop("system"), machine.pop("cpu")
    versions = ", ".join(f"{name} {version}" for name, version in machine.items())
    commit = _git("rev-parse", "--short", "HEAD")
    changes = " with changes" if commit and _git("status", "--porcelain", "--", *PRODUCT) else ""
    return (f"Measured on {time.strftime('%Y-%m-%d')} from commit {commit or 'unknown'}{changes}: {system}, {cpu},"
            f" {versions}.")


def _git(*words: str) -> str:
    """What git answers; empty if there is no git, or no repository."""
    try:
        answer = subprocess.run(["git", "-C", HOME, *words], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return ""
    return answer.stdout.strip() if answer.returncode == 0 else ""

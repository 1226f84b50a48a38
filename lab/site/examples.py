"""Examples on pages: what a page prints is what its commands and scripts print.

Fenced blocks of a page run one after the other in one empty directory:

* `python` runs in one namespace for the page; with `title="name"` it is written to that file, like any other block;
* `console`: a line that begins with `$ ` is a command, the lines below it are its output;
* `sh`: commands whose output the page does not show;
* `text` directly after `python`: what that has printed.

All other blocks, `bash` among them, are only shown. Output is compared as in doctest: `...` stands for anything.

    python -m lab.site.examples docs/tutorials/first-grasp.md    # write today's output into a page
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.M | re.S)
PICTURE = re.compile(r'(?:!\[[^]]*\]\(|<img src=")([^):"]+)')  # that is a file
TITLE = re.compile(r'title="([^"]+)"')
SECONDS = 300.0
COMPARE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


class Output(NamedTuple):
    """What a page says that something prints, and what it prints."""

    begin: int  # where it stands in the page
    end: int
    said: str
    printed: str

    @property
    def holds(self) -> bool:
        """Whether both are the same."""
        return doctest.OutputChecker().check_output(self.said, self.printed, COMPARE)


def has_examples(text: str, kinds: Sequence[str] = ("python", "console", "sh")) -> bool:
    """Whether anything on a page runs, of these kinds; all but `python` start processes, which takes a while."""
    return any(kind in kinds for kind, *_ in BLOCK.findall(text))


def titled(page: Path, title: str) -> str:
    """The block of a page that has a title."""
    [found] = [source for _, options, source in BLOCK.findall(page.read_text(encoding="utf-8"))
               if f'title="{title}"' in options]
    return str(found)


def run(page: Path, directory: Path) -> list[Output]:
    """Run all that a page shows, in its order, with files in a directory that is empty.

    Raises whatever a script on the page raises, and `subprocess.CalledProcessError` for a command that fails
    unexpectedly.
    """
    text = page.read_text(encoding="utf-8")
    found: list[Output] = []
    namespace: dict[str, Any] = {"__name__": page.stem}
    last = ""  # what the last script has printed
    before = set(sys.modules)
    sys.path.insert(0, str(directory))
    try:
        with contextlib.chdir(directory):
            for block in BLOCK.finditer(text):
                kind, options, source = block.groups()
                if title := TITLE.search(options):
                    Path(title[1]).write_text(source, encoding="utf-8")
                elif kind == "python":
                    line = text.count("\n", 0, block.start())
                    last = _script("\n" * (line + 1) + source, page, namespace)
                    after = BLOCK.match(text, block.end() + 2)
                    if after and after[1] == "text":
                        found.append(Output(after.start(3), after.end(3), after[3], last))
                elif kind in ("console", "sh"):
                    found += _session(block.start(3), source, shown=kind == "console")
    finally:
        sys.path.remove(str(directory))
        for name in set(sys.modules) - before:  # the page's own
            if str(getattr(sys.modules[name], "__file__", None) or "").startswith(str(directory)):
                del sys.modules[name]
    return found


def _script(source: str, page: Path, namespace: dict[str, Any]) -> str:
    """Run a script; returns what it prints."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(source, str(page), "exec"), namespace)
    return printed.getvalue()


def _session(begin: int, source: str, shown: bool) -> list[Output]:
    """Run the commands of a block; the outputs, if the block shows them."""
    prompt = "$ " if shown else ""
    found = []
    lines = source.splitlines(keepends=True)
    starts = [k for k, line in enumerate(lines) if line.startswith(prompt) and line.strip()]
    for k, following in zip(starts, [*starts[1:], len(lines)], strict=True):
        printed = _command(lines[k].removeprefix(prompt))
        if shown:
            offset = begin + sum(map(len, lines[: k + 1]))
            said = "".join(lines[k + 1 : following])
            found.append(Output(offset, offset + len(said), said, printed))
    return found


def _command(line: str) -> str:
    """What a command prints: its errors, if it is refused."""
    environment = {
        **os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT),
        "COLUMNS": "100", "MPLBACKEND": "agg",
    }
    result = subprocess.run(
        ["bash", "-c", line], env=environment, capture_output=True, text=True, timeout=SECONDS, check=False)
    if result.returncode and not result.stderr.startswith("grasp"):
        raise RuntimeError(f"{line.strip()}: {result.stdout}{result.stderr}")
    return result.stderr if result.returncode else result.stdout


def rewritten(text: str, outputs: Sequence[Output]) -> str:
    """The page with what is printed today."""
    for output in reversed(outputs):
        if not output.holds:
            text = text[: output.begin] + output.printed.rstrip() + "\n" + text[output.end :]
    return text


def main(pages: Sequence[str]) -> int:
    """Write today's outputs into pages."""
    for page in map(Path, pages):
        with tempfile.TemporaryDirectory() as directory:
            outputs = run(page.resolve(), Path(directory))
        page.write_text(rewritten(page.read_text(encoding="utf-8"), outputs), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""The commands of the README, as a reader types them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from conftest import grasp

pytestmark = pytest.mark.slow  # some of the commands start a graph

README = Path(__file__).parents[2] / "README.md"


def test_readme_commands_work_in_their_order(command: Any, tmp_path: Path) -> None:
    """Every line of the README's sh blocks, one after the other in one directory.

    `run`, which handles signals, has a process of its own.
    """
    lines = [line for block in re.findall(r"```sh\n(.*?)```", README.read_text(), re.S) for line in block.splitlines()]
    assert len(lines) >= 8
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "grasp"
        result = grasp(*arguments, cwd=tmp_path) if arguments[0] == "run" else command(*arguments)
        assert result.returncode == 0, f"{line}: {result.stderr}"
    assert {"case.npz", "case.png", "figure.png", "run"} <= {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "case.png").read_bytes().startswith(b"\x89PNG")

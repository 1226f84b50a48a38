"""What the command line refuses: a sentence and exit status 2, no traceback."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from conftest import grasp


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["simulate", "nowhere"], "nowhere: no such scene; allowed: a path that ends in .yaml, or one of case_01"),
        (["simulate", "nowhere.yaml"], "nowhere.yaml: no such file"),
        (["simulate", "case_01", "--set", "left_arm.mass_kg=0"], "left_arm.mass_kg: 0 is not allowed; allowed: a num"),
        (["simulate", "case_01", "--set", "left_arm.mass=1"], "--set left_arm.mass=1: no such key; allowed: "),
        (["simulate", "case_01", "--set", "mass"], "--set mass: not understood; allowed: section.key=value"),
        (["simulate", "case_01", "--accuracy", "1"], "exact: accuracy 1.0 is not allowed; allowed: 1e-16 to 0.001"),
        (["simulate", "case_01", "--grid", "1"], "1 is not allowed; allowed: a whole number >= 2"),
        (["simulate", "case_01", "--max-work", "1e3"], "1e3 is not allowed; allowed: a whole number >= 1"),
        (["simulate", "case_01", "--method", "paper", "--tolerance", "1"], "--tolerance is not allowed; allowed for"),
        (["simulate", "case_01", "--method", "rk4", "--accuracy", "1e-8"], "--accuracy is not allowed; allowed for"),
        (["simulate", "case_01", "--method", "rk4", "--sampled"], "rk4: only continuous feedback"),
        (["simulate", "case_01", "-o", "no/such/directory.npz"], "No such file or directory"),
        (["inspect", "."], "not a bag of this package"),
        (["plot", "."], "not a bag of this package"),
        (["plot", "nothing.npz"], "nothing.npz: not a file of `grasp simulate`"),
        (["plot", "case_01", "-o", "figure.nonsense"], "nonsense"),
    ],
)
def test_bad_input_is_refused_in_a_line(command: Any, arguments: list[str], complaint: str) -> None:
    result = command(*arguments)
    assert result.returncode == 2
    assert complaint in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["simulate", "nowhere.yaml"], "nowhere.yaml: no such file"),
        (["run", "case_01", "-o", "."], "File exists"),
    ],
)
def test_a_process_that_refuses_shows_no_traceback(tmp_path: Path, arguments: list[str], complaint: str) -> None:
    result = grasp(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert complaint in result.stderr
    assert "Traceback" not in result.stderr

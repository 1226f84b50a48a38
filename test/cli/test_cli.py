"""The command line as a user meets it: processes, files, messages, exit statuses."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import grasp

from grasp_ros import scene, simulation

README = Path(__file__).parents[2] / "README.md"


def test_readme_commands_work_in_their_order(tmp_path: Path) -> None:
    """Every line of the README's sh blocks, one after the other in one directory."""
    lines = [line for block in re.findall(r"```sh\n(.*?)```", README.read_text(), re.S) for line in block.splitlines()]
    assert len(lines) >= 8
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "grasp"
        result = grasp(*arguments, cwd=tmp_path)
        assert result.returncode == 0, f"{line}: {result.stderr}"
    assert {"case.npz", "case.png", "figure.png", "run"} <= {path.name for path in tmp_path.iterdir()}
    assert (tmp_path / "case.png").read_bytes().startswith(b"\x89PNG")


def test_scenes_lists_all_with_their_titles(tmp_path: Path) -> None:
    lines = grasp("scenes", cwd=tmp_path).stdout.splitlines()
    assert lines[0] == "case_01  Case 1, Fig. 2: standard parameters"
    assert [line.split()[0] for line in lines] == scene.names()


def test_simulate_writes_what_the_function_returns(tmp_path: Path) -> None:
    result = grasp("simulate", "case_04", "--grid", "11", "--accuracy", "1e-12", "-o", "out.npz", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    loaded = simulation.load(tmp_path / "out.npz")
    expected = simulation.simulate(scene.load("case_04"), grid=np.linspace(0.0, 20.0, 11), accuracy=1e-12)
    assert loaded.state.tobytes() == expected.state.tobytes()
    assert loaded.events == expected.events
    assert loaded.scene.values == expected.scene.values
    assert loaded.status is expected.status


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
        (["run", "case_01", "-o", "."], "File exists"),
        (["inspect", "."], "not a bag of this package"),
        (["plot", "."], "not a bag of this package"),
        (["plot", "nothing.npz"], "nothing.npz: not a file of `grasp simulate`"),
        (["plot", "case_01", "-o", "figure.nonsense"], "nonsense"),
    ],
)
def test_bad_input_is_refused_in_a_line(tmp_path: Path, arguments: list[str], complaint: str) -> None:
    result = grasp(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert complaint in result.stderr
    assert "Traceback" not in result.stderr


def test_a_reader_that_stops_early_is_no_error() -> None:
    program = f"{shlex.quote(sys.executable)} -m grasp_ros.cli scenes | head -n 1; exit ${{PIPESTATUS[0]}}"
    result = subprocess.run(["bash", "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 0
    assert "Traceback" not in result.stderr


def test_a_scene_file_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(scene.load("case_05").to_yaml())
    result = grasp("simulate", "mine.yaml", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "Case 5" in result.stdout


def test_simulate_with_another_method_says_what_it_did(tmp_path: Path) -> None:
    result = grasp("simulate", "case_01", "--method", "paper", "--step", "1e-3", "-o", "out.npz", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "paper, step 0.001 s" in result.stdout
    assert "20088 steps, 80352 right hand sides" in result.stdout
    loaded = simulation.load(tmp_path / "out.npz")
    assert (loaded.method, loaded.setting) == ("paper", 1e-3)
    plain = grasp("simulate", "case_01", "--method", "rk4", cwd=tmp_path)
    assert "touches left, right  not looked for" in plain.stdout


def test_methods_lists_order_source_and_touch(tmp_path: Path) -> None:
    text = grasp("methods", cwd=tmp_path).stdout
    assert text.startswith("exact\n  order: ")
    assert text.count("at a touch:") == 13

"""The command line as a user meets it: what it prints and writes."""

from __future__ import annotations

import argparse
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import GRASP, ran

from grasp_ros import scene, simulation
from grasp_ros.cli.main import _parser
from grasp_ros.cli.parser import COMMANDS


def test_scenes_lists_all_with_their_titles(command: Any) -> None:
    lines = command("scenes").stdout.splitlines()
    assert lines[0].split(maxsplit=1) == ["case_01", "Case 1, Fig. 2: standard parameters"]
    assert [line.split()[0] for line in lines] == scene.names()


def test_simulate_writes_what_the_function_returns(command: Any, tmp_path: Path) -> None:
    result = command("simulate", "case_04", "--grid", "11", "--accuracy", "1e-12", "-o", "out.npz")
    assert result.returncode == 0, result.stderr
    loaded = simulation.load(tmp_path / "out.npz")
    expected = simulation.simulate(scene.load("case_04"), grid=np.linspace(0.0, 20.0, 11), setting=1e-12)
    assert loaded.state.tobytes() == expected.state.tobytes()
    assert loaded.events == expected.events
    assert loaded.scene.values == expected.scene.values
    assert loaded.status is expected.status


def test_simulate_with_a_controller_of_a_module_here(command: Any, tmp_path: Path) -> None:
    (tmp_path / "laws.py").write_text("def soft(tick, time, x, v):\n    return -5.0 * x - 0.5 * v\n")
    words = ("simulate", "case_01", "--set", "time.duration_s=1", "--controller", "left=laws:soft", "-o", "o.npz")
    result = command(*words)
    assert result.returncode == 0, result.stderr
    assert re.search(r"^left controller +laws:soft$", result.stdout, re.M)
    loaded = simulation.load(tmp_path / "o.npz")
    assert loaded.controllers == {"left": "laws:soft"}
    expected = simulation.simulate(scene.load("case_01", ["time.duration_s=1"]), sampled=True)
    assert loaded.state.tobytes() == expected.state.tobytes()


def test_a_controller_may_leave_the_working_directory(command: Any, tmp_path: Path) -> None:
    (tmp_path / "away").mkdir()
    (tmp_path / "away" / "force.txt").write_text("0.0")
    (tmp_path / "o.npz").write_bytes(b"of before")
    (tmp_path / "goes.py").write_text(
        'import os, pathlib\nos.chdir("away")\ndef law(tick, time, x, v):\n'
        '    force = float(pathlib.Path("force.txt").read_text())\n'
        '    if tick == 10: os.chdir("/")\n    return force\n')
    words = ("simulate", "arm_alone", "--set", "time.duration_s=0.01", "--controller", "left=goes:law", "-o", "o.npz")
    refused = command(*words)
    assert (refused.returncode, (tmp_path / "o.npz").read_bytes()) == (2, b"of before")
    assert refused.stderr == "grasp: o.npz: already exists; allowed: a new file, or --force to replace it\n"
    assert command(*words, "--force").returncode == 0
    assert len(simulation.load(tmp_path / "o.npz").t) == 11


BROKEN = """
import sys
def end(tick, time, x, v): sys.exit()
def close(tick, time, x, v): raise GeneratorExit
def write(tick, time, x, v): raise BrokenPipeError
def fill(tick, time, x, v): raise OSError(28, "No space left")
def divide(tick, time, x, v): return 1 / tick
class Fails:
    def __init__(self): raise ValueError("words")
class Ends:
    def reset(self): sys.exit()
    def __call__(self, tick, time, x, v): return 0.0
again = Ends()
"""


@pytest.mark.parametrize(("law", "words"), [
    ("broken_laws:end", r"left controller broken_laws:end: SystemExit, .*\.py, line 3, tick 0, t = 0\.0 s"),
    ("broken_laws:close", r"left controller broken_laws:close: GeneratorExit, .*\.py, line 4, tick 0, t = 0\.0 s"),
    *((f"broken_laws:{name}", rf"left controller broken_laws:{name}, tick 0, t = 0\.0 s: {error}, .*\.py, line {line}")
      for name, error, line in (
        ("write", "BrokenPipeError", 5), ("fill", r"OSError: \[Errno 28\] No space left", 6),
        ("divide", "ZeroDivisionError: division by zero", 7))),
    ("broken_laws:Fails", r"Fails'> cannot be initialised: ValueError: words, .*\.py, line 9.*"),
    ("broken_laws:again", r"cannot be initialised: SystemExit, .*\.py, line 11.*"),
    ("divides_by_0:law", r"divides_by_0 cannot be imported: ZeroDivisionError: division by zero, .*\.py, line 1"),
    ("ends_at_once:law", r"ends_at_once cannot be imported: SystemExit: 0, .*\.py, line 1"),
])
def test_what_a_controller_raises_is_one_line(law: str, words: str, command: Any, tmp_path: Path) -> None:
    for name, text in (("broken_laws", BROKEN), ("divides_by_0", "1 / 0"), ("ends_at_once", "raise SystemExit(0)")):
        (tmp_path / f"{name}.py").write_text(text)
    result = command("simulate", "arm_alone", "--controller", f"left={law}", "-o", "o.npz")
    assert (result.returncode, result.stdout) == (1 if "tick 0" in words else 2, "")
    assert re.fullmatch(rf"grasp: .*{words}\n", result.stderr), result.stderr
    assert not (tmp_path / "o.npz").exists()


DROPPED = """
import os, signal, sys
from grasp_ros.cli import simulate
from grasp_ros.cli.main import main
class Last:
    def __del__(self): os.kill(os.getpid(), signal.{signal})
prepare = simulate.prepare
simulate.prepare = lambda: (Last(), prepare())
sys.exit(main(["simulate", "case_02", "--set", "time.duration_s=1e6", "-o", "o.npz"]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("signal", ["SIGINT", "SIGTERM"])
def test_a_signal_whose_exception_python_drops_stops_the_command_all_the_same(signal: str, tmp_path: Path) -> None:
    result = ran(sys.executable, "-c", DROPPED.format(signal=signal), cwd=tmp_path)
    assert (result.returncode, result.stdout, result.stderr) == (130, "", "grasp: interrupted\n")
    assert not (tmp_path / "o.npz").exists()


def test_an_interrupt_within_exec_is_an_exit_status_too(tmp_path: Path) -> None:
    """`python -m` would end by the signal, because Python does not know that the interrupt was answered."""
    (tmp_path / "interrupted.py").write_text('exec("raise KeyboardInterrupt")')
    result = ran(*GRASP, "simulate", "case_01", "--controller", "left=interrupted:law", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (130, "grasp: interrupted\n")


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_behind_the_end_of_the_work_changes_nothing(number: str) -> None:
    code = (f"import atexit, os, signal, sys; atexit.register(lambda: os.kill(os.getpid(), signal.{number}));"
            " sys.argv = ['grasp', 'scenes']; from grasp_ros.cli.main import grasp; sys.exit(grasp())")
    result = ran(sys.executable, "-c", code)
    assert (result.returncode, result.stderr) == (0, "")


def test_simulate_with_another_method_says_what_it_did(command: Any, tmp_path: Path) -> None:
    result = command("simulate", "case_01", "--method", "paper", "--step", "1e-3", "-o", "out.npz")
    assert result.returncode == 0, result.stderr
    assert "paper, step 0.001 s" in result.stdout
    assert "20088 steps, 80352 right hand sides" in result.stdout
    loaded = simulation.load(tmp_path / "out.npz")
    assert (loaded.method, loaded.setting) == ("paper", 1e-3)
    plain = command("simulate", "case_01", "--method", "rk4")
    assert re.search(r"^touches left, right +not looked for$", plain.stdout, re.M)


def test_methods_lists_order_source_and_touch(command: Any) -> None:
    text = command("methods").stdout
    assert text.startswith("exact\n  order: ")
    assert text.count("at a touch:") == 13


def test_commands_are_found_in_the_files_that_have_them() -> None:
    for module in {entry.module for entry in COMMANDS.values()}:
        commands = argparse.ArgumentParser().add_subparsers()
        import_module(f"grasp_ros.cli.{module}").add_to(commands)
        assert {*commands.choices} == {name for name, entry in COMMANDS.items() if entry.module == module}


@pytest.mark.parametrize(("program", "unneeded"), [
    ("import grasp_ros", {"numpy", "numba"}),
    ("from grasp_ros.cli.main import main; main(['--help'])", {"numpy", "numba", "yaml", "matplotlib", "rclpy"}),
    ("from grasp_ros.cli import graph, main; from grasp_ros.graph.nodes import monitor",
     {"numba", "scipy", "matplotlib"}),
    ("import grasp_ros.cli.report, grasp_ros.cli.simulate", {"rosbags", "mcap", "matplotlib", "rclpy"}),
])
def test_what_is_not_needed_is_not_imported(program: str, unneeded: set[str]) -> None:
    program = f"import sys; {program}; print({unneeded} & {{*sys.modules}})"
    found = ran(sys.executable, "-c", program)
    assert found.stdout.splitlines()[-1] == "set()"


@pytest.mark.parametrize("number", ["-1", "-.5", "-1e-3", "-2.E+5"])
def test_a_negative_number_is_no_option(number: str) -> None:
    words = ["ctl", "set", "left_controller", "left_feedback.set_point_m", number]
    assert _parser(words).parse_args(words).words == words[1:]

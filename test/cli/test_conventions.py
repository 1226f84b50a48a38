"""What every command line has: versions, levels, JSON, pipes, completion, and errors that fit into a line."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from processes import GRASP, ran

from grasp_ros import scene, simulation
from grasp_ros.cli.parser import COMMANDS

SHORT = ("--set", "time.duration_s=1")


def shell(program: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A line for bash, in which $GRASP is the command."""
    return ran("bash", "-c", program, env={**os.environ, "GRASP": " ".join(GRASP), **environment})


def test_version(command: Any) -> None:
    result = command("--version")
    assert (result.returncode, result.stdout.split()[0], result.stderr) == (0, "grasp", "")


def test_help_is_one_screen_with_every_command(command: Any) -> None:
    for words in (("--help",), ("-h",)):
        lines = command(*words).stdout.splitlines()
        assert len(lines) <= 30
        assert max(map(len, lines)) <= 100
        assert {*COMMANDS} <= {line.split()[0] for line in lines if line.startswith("  ")}
        assert lines[-1].endswith("A traceback is a bug: please report it.")


def test_help_is_there_at_once() -> None:
    def seconds() -> float:
        """Of the processor, which other tests do not change."""
        before = os.times()
        subprocess.run([*GRASP, "--help"], capture_output=True, timeout=60, check=True)
        after = os.times()
        return after.children_user + after.children_system - before.children_user - before.children_system

    assert min(seconds() for _ in range(3)) < 0.3


def test_json_of_scenes_and_methods(command: Any) -> None:
    found = json.loads(command("scenes", "--json").stdout)
    assert [entry["name"] for entry in found] == scene.names()
    assert found[0]["sections"][0] == "time"
    assert json.loads(command("scenes", "case_01", "--json").stdout)["object"]["mass_kg"] == 5.0
    assert json.loads(command("methods", "--json").stdout)[0]["name"] == "exact"


def test_json_of_a_simulation_has_the_numbers_of_the_table(command: Any) -> None:
    found = json.loads(command("simulate", "case_01", *SHORT, "--json").stdout)
    run = simulation.simulate(scene.load("case_01", SHORT[1:]))
    assert found["touches"]["left"] == len(run.contacts("left"))
    assert found["V_c_J"] == run.energy.V_c[[0, -1]].tolist()
    assert found["certificate"] == run.scene.certificate_in_words(sampled=False)
    assert min(found["settled_s"].values()) > 10.0  # V_c decides it behind the end of the run
    wild = json.loads(command("simulate", "case_02", *SHORT, "--json").stdout)
    assert wild.get("settled_s", {"left": None})["left"] is None  # JSON has no infinity
    assert found["status"] == "DONE"


def test_quiet_says_nothing_but_the_result(command: Any) -> None:
    words = ("simulate", "case_01", *SHORT, "--set", "loop.delay_ticks=0", "-o", "a.npz", "--force")
    loud, still = command(*words), command(*words, "-q")
    assert "warning: case_01: loop.delay_ticks" in loud.stderr
    assert "written to a.npz" in loud.stderr
    assert (still.stdout, still.stderr) == (loud.stdout, "")
    assert command("-q", *words).stderr == ""
    assert "numpy " in command(*words, "-v").stderr


@pytest.mark.slow
def test_output_goes_to_a_pipe(command: Any) -> None:
    result = command("simulate", "case_01", *SHORT, "--grid", "3", "-o", "-")
    rows = list(csv.reader(result.stdout.splitlines()))
    assert rows[0][:2] == ["t_s", "x_left_m"]
    assert len(rows) == 4
    assert "touches left, right" in result.stderr
    program = "$GRASP plot case_01 --set time.duration_s=1 -o - | head -c 8 | od -c"
    assert "P   N   G" in shell(program).stdout


def test_a_table_for_other_programs(command: Any, tmp_path: Path) -> None:
    assert command("simulate", "case_01", *SHORT, "-o", "a.csv").returncode == 0
    numbers = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1)
    run = simulation.simulate(scene.load("case_01", SHORT[1:]))
    assert numbers[:, 1:7].tobytes() == run.state.tobytes()


@pytest.mark.parametrize("program", ["$GRASP scenes >&-", "$GRASP --help >&-", "$GRASP --help | head -n 1",
                                     "$GRASP scenes | head -n 1",
                                     "$GRASP scenes --json >&- 2>&-"])
def test_a_closed_output_is_no_traceback(program: str) -> None:
    result = shell(f"{program}; exit ${{PIPESTATUS[0]}}")
    assert result.returncode == 0
    assert "Traceback" not in result.stderr
    assert "Exception" not in result.stderr


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_failure_is_one_although_nobody_reads_of_it(unbuffered: str) -> None:
    """A closed pipe made it a success."""
    program = "$GRASP simulate case_01 --max-events 3 | true; exit ${PIPESTATUS[0]}"
    assert shell(program, PYTHONUNBUFFERED=unbuffered).returncode == 1


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_file_is_written_although_nobody_reads_the_table(tmp_path: Path, unbuffered: str) -> None:
    path = tmp_path / "run.npz"
    result = shell(f"$GRASP simulate case_01 --set time.duration_s=1 -o {path} | true; exit ${{PIPESTATUS[0]}}",
                   PYTHONUNBUFFERED=unbuffered)
    assert (result.returncode, result.stderr) == (0, f"written to {path}\n")
    assert path.exists()
    words = f"$GRASP simulate case_01 --set time.duration_s=1 -o - 2>&1 >{tmp_path}/run.csv | true"
    assert shell(f"{words}; exit ${{PIPESTATUS[0]}}", PYTHONUNBUFFERED=unbuffered).returncode == 0
    assert (tmp_path / "run.csv").read_text().count("\n") == 2002


def test_a_table_into_a_closed_output_is_not_lost_in_silence() -> None:
    found = shell("$GRASP new - >&-")
    assert (found.returncode, found.stderr) == (2, "grasp: -o -: the standard output is closed\n")


@pytest.mark.parametrize("words", ["--help", "simulate --help", "scenes", "new - -q"])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_an_output_that_cannot_be_written_is_no_success(words: str, unbuffered: str) -> None:
    result = shell(f"$GRASP {words} > /dev/full", PYTHONUNBUFFERED=unbuffered)
    assert (result.returncode, result.stderr) == (1, "grasp: the output cannot be written: No space left on device\n")


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_table_that_nobody_takes_in_time_is_no_success(unbuffered: str) -> None:
    """Into a pipe that does not wait; without a buffer Python would drop the rest without a word."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    result = subprocess.run([*GRASP, "simulate", "case_01", "-q", "-o", "-"], stdout=writer, stderr=subprocess.PIPE,
                            text=True, timeout=60, check=False, env={**os.environ, "PYTHONUNBUFFERED": unbuffered})
    os.close(reader), os.close(writer)
    words = "grasp: the output cannot be written: write could not complete without blocking"
    assert (result.returncode, result.stderr.splitlines()[-1]) == (1, words)


def test_a_working_directory_that_is_gone_is_refused_in_a_line(tmp_path: Path) -> None:
    result = shell(f"cd {tmp_path} && rmdir {tmp_path} && $GRASP simulate case_01")
    assert result.returncode == 2
    assert result.stderr == "grasp: the working directory is gone; allowed: one that is there\n"
    assert shell(f"mkdir {tmp_path} && cd {tmp_path} && rmdir {tmp_path} && $GRASP --help").returncode == 0


def test_wrong_words_are_refused_where_nobody_can_read_why() -> None:
    assert shell("$GRASP bogus 2> /dev/full").returncode == 2


@pytest.mark.slow
def test_what_is_written_under_a_name_in_capitals_is_read_under_it(command: Any) -> None:
    for line in ("new A.YAML", "simulate A.YAML -o A.NPZ", "plot A.NPZ -o A.PNG"):
        result = command(*line.split())
        assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("name", scene.names())
def test_a_new_scene_is_the_one_it_is_like_and_every_offer_can_be_taken(name: str) -> None:
    from grasp_ros.cli.scenes import commented

    like = scene.load(name)
    text = commented(like)
    assert scene.parse(text, name, "new.yaml") == like
    offered = text.split("# What else there is")[1]
    lines = [line[2:] for line in offered.splitlines() if line.startswith(("#   ", "# ")) and ":" in line
             and not line[2:].lstrip().startswith("#") and line[2].islower()]
    taken = [line for line in lines if not line.startswith("  ") or "..." not in line]
    assert isinstance(yaml.safe_load("\n".join(taken) or "{}"), dict)


def test_new_writes_a_file_that_runs(command: Any, tmp_path: Path) -> None:
    assert command("new", "mine.yaml", "--like", "case_03", "--set", "object.mass_kg=7").returncode == 0
    assert scene.load(str(tmp_path / "mine.yaml")).values["object"]["mass_kg"] == 7.0
    assert command("new", "mine.yaml").returncode == 2
    assert command("simulate", "mine.yaml", *SHORT).returncode == 0
    assert command("new", "-").stdout.startswith("# A scene")


def test_scenes_prints_one_as_it_was_written(command: Any) -> None:
    text = command("scenes", "case_01").stdout
    assert text.startswith("# Fukuda, Shoji, Inaba (1990)")
    assert scene.parse(text, "case_01", "case_01") == scene.load("case_01")


@pytest.mark.slow
def test_a_shell_completes_commands_options_and_scenes() -> None:
    def completed(line: str) -> set[str]:
        """As argcomplete's function for bash asks."""
        result = shell(f"{sys.executable} -m grasp_ros.cli 8>&1 9>/dev/null >/dev/null", _ARGCOMPLETE="1",
                       _ARGCOMPLETE_IFS="\n", COMP_LINE=line, COMP_POINT=str(len(line)), _ARGCOMPLETE_SHELL="bash")
        return {word.strip() for word in result.stdout.split("\n")}

    assert {"simulate", "scenes"} <= completed("grasp s")
    assert {"case_10", "case_11"} <= completed("grasp simulate case_1")
    assert "--method" in completed("grasp simulate case_01 --me")
    assert "discrete_gradient" in completed("grasp simulate case_01 --method d")

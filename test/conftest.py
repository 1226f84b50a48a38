"""A ROS domain of this test run alone, checked messages, and results that several tests look at."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pytest

from grasp_ros import scene
from grasp_ros.cli.main import main
from grasp_ros.simulation import simulate

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))  # each has domains of its own
os.environ["ROS_DOMAIN_ID"] = str(1 + 50 * (WORKER % 2) + os.getpid() % 50)
ROOT = Path(__file__).parents[1]
os.environ["PYTHONPATH"] = str(ROOT)  # processes, too, are those of the checkout
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # of hundreds of processes each would compile the package anew
for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
    if signal.getsignal(number) is signal.SIG_IGN:  # as under nohup, or in the background: children would inherit it
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)

RUN_SECONDS = 90.0
RUN = 'run #1 "🦾'  # a name that is not quoted alike by all
SECOND_DOMAIN = str(215 + 8 * (WORKER % 2) + os.getpid() % 8)  # those between have ports that the system gives away


def grasp(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own, with a deadline."""
    command = [sys.executable, "-m", "grasp_ros.cli", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=RUN_SECONDS, check=False)


@pytest.fixture
def command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """The command line within this process, in a directory of its own: much cheaper than `grasp`."""
    monkeypatch.chdir(tmp_path)
    return partial(_answer, main, capsys)


@pytest.fixture
def lab_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """`python -m lab` likewise."""
    from lab.__main__ import main as lab

    monkeypatch.chdir(tmp_path)
    return partial(_answer, lab, capsys)


def _answer(
    program: Callable[[Sequence[str]], int], capsys: pytest.CaptureFixture[str], *arguments: str
) -> subprocess.CompletedProcess[str]:
    try:
        status = program(arguments)
    except SystemExit as stop:  # of argparse
        status = stop.code
    return subprocess.CompletedProcess(arguments, status, *capsys.readouterr())


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of case 1 over its first contacts, the bytes of a graph (see `two_runs`) without one."""
    from lab.drills import recorder

    path = tmp_path_factory.mktemp("recorded") / "bag"
    recorder.write(path, simulate(scene.load("case_01", ["time.duration_s=3"]), sampled=True))
    return path


@pytest.fixture(scope="session")
def two_runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Directories of two runs of `grasp run` at the same time: case 1 over its first contacts, in a domain each.

    The first has four processes, the second has one.
    """
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("log"))
    command = [sys.executable, "-m", "grasp_ros.cli", "run", "case_01", "--set", "time.duration_s=3", "-o", RUN]
    started = []
    runs = (("first", os.environ["ROS_DOMAIN_ID"], []), ("second", SECOND_DOMAIN, ["--one-process"]))
    for name, domain, words in runs:
        cwd, environment = tmp_path_factory.mktemp(name), {**os.environ, "ROS_DOMAIN_ID": domain}
        run = subprocess.Popen(
            [*command, *words], cwd=cwd, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        started.append((cwd, run))
    for cwd, run in started:
        out, err = run.communicate(timeout=RUN_SECONDS)
        assert run.returncode == 0, err
        (cwd / "stdout").write_text(out)
    return started[0][0] / RUN, started[1][0] / RUN

"""A ROS domain of this test run alone, checked messages, and results that several tests look at."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from grasp_ros.cli.main import main

os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"

RUN_SECONDS = 90.0


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

    def call(*arguments: str) -> subprocess.CompletedProcess[str]:
        try:
            status = main(arguments)
        except SystemExit as stop:  # of argparse
            status = stop.code
        return subprocess.CompletedProcess(arguments, status, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def two_runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two directories of `grasp run`, of the same scene: case 1 over its first contacts."""
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("log"))
    directories = []
    for name in ("first", "second"):
        cwd = tmp_path_factory.mktemp(name)
        result = grasp("run", "case_01", "--set", "time.duration_s=3", "-o", "run #1", cwd=cwd)
        assert result.returncode == 0, result.stderr
        (cwd / "stdout").write_text(result.stdout)
        directories.append(cwd / "run #1")
    return directories[0], directories[1]

"""What `grasp run` has started never outlives it, whatever ends it, and what was recorded is whole."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import DEADLINE, GRASP, START, children, ended, growing, ran, wait_for

from grasp_ros import scene
from grasp_ros.graph import bag, host
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.errors import Failed
from grasp_ros.scene.topics import JOINT_STATES

pytestmark = pytest.mark.slow


def check_bag(directory: Path) -> None:
    """It was closed, and lacks nothing."""
    assert (directory / "run" / "bag" / "metadata.yaml").exists()
    recording = bag.read(directory / "run" / "bag")
    assert np.array_equal(recording.tick, np.arange(recording.counts[JOINT_STATES.name]))
    assert recording.lost["end"] == "closed"


@pytest.fixture
def survivors(tmp_path: Path) -> Iterator[None]:
    """Ends what a failed test has left behind."""
    yield
    for process in children(tmp_path).values():
        os.kill(process, signal.SIGKILL)


def test_a_process_that_cannot_be_started_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: Any, **__: Any) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(subprocess, "Popen", none)
    graph = Graph(scene.load("case_01"), tmp_path / "run", 1e-16)
    with pytest.raises(Failed, match="monitor: cannot be started: Resource temporarily unavailable"):
        graph.start()
    graph.stop()


@pytest.mark.parametrize("options", [[], ["--one-process"]], ids=["four processes", "one process"])
def test_a_quiet_run_prints_its_results_alone(tmp_path: Path, options: list[str]) -> None:
    words = ["run", "case_01", "--quiet", "--set", "time.duration_s=0.1", "--no-figure", "-o", "run", *options]
    found = ran(*GRASP, *words, cwd=tmp_path)
    assert (found.returncode, found.stderr) == (0, "")
    assert found.stdout.startswith("bag  ")


@pytest.mark.usefixtures("survivors")
@pytest.mark.parametrize("options", [[], ["--one-process"]], ids=["four processes", "one process"])
def test_nothing_outlives_a_run_that_is_killed(grasp_run: Any, tmp_path: Path, options: list[str]) -> None:
    """Not even a process that is stopped at that moment. Before, the reader of its progress has had enough."""
    run = grasp_run("case_01", *options)
    assert run.stderr.read(10)
    run.stderr.close()
    run.stdout.close()
    growing(tmp_path / "run" / "bag", 300_000)
    started = children(tmp_path)
    assert len(started) == (1 if options else 4)
    os.kill(started.get("right_controller", 0) or started["graph"], signal.SIGSTOP)
    run.kill()
    run.wait(DEADLINE)
    wait_for(lambda: not children(tmp_path), "the end of all processes")
    check_bag(tmp_path)


@pytest.mark.usefixtures("survivors")
def test_a_terminal_that_is_closed_ends_a_run_cleanly(launch: Any, tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    words = ["setsid", "-c", *GRASP, "run", "case_01", "-o", "run"]  # whose terminal is that of its input
    run = launch(*words, cwd=tmp_path, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    growing(tmp_path / "run" / "bag", 300_000)
    os.close(ours)
    assert run.wait(DEADLINE) in (0, 1)
    assert not children(tmp_path)
    check_bag(tmp_path)


def segments() -> set[str]:
    """Names of the segments of shared memory, but for those of ports."""
    found = {path.name.removesuffix("_el") for path in host.SHARED.glob("fastrtps_*_el")}
    return {name for name in found if not name.startswith(host.PORT)}


def test_shared_memory_of_a_killed_process_is_removed_and_no_other(launch: Any) -> None:
    before = segments()
    node = launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    maps = Path(f"/proc/{node.pid}/maps")
    wait_for(lambda: any(name in maps.read_text() for name in segments() - before), "its segment")
    own = {name for name in segments() - before if name in maps.read_text()}
    old = time.time() - 60.0
    for name in own:
        os.utime(host.SHARED / f"{name}_el", (old, old))  # a young one may be of one who starts
    host.remove_left()
    assert own <= segments()
    node.kill()
    node.wait(DEADLINE)
    assert own <= segments()
    launch(*START, "left_controller", stderr=subprocess.DEVNULL)
    wait_for(lambda: not own & segments(), "the next one to remove it")


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_long_command_ends_cleanly_on_a_signal(launch: Any, tmp_path: Path, number: signal.Signals) -> None:
    command = launch(
        *GRASP, "simulate", "case_01", "--set", "time.duration_s=1e6", "-o", "out.npz", cwd=tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )
    handlers = Path(f"/proc/{command.pid}/status")

    def caught() -> bool:
        [mask] = [line.split()[1] for line in handlers.read_text().splitlines() if line.startswith("SigCgt")]
        return bool(int(mask, 16) >> (signal.SIGHUP - 1) & 1)

    wait_for(caught, "the handlers")
    command.send_signal(number)
    _, err = ended(command, 130)
    assert err.splitlines()[-1] == "grasp: interrupted"
    assert not list(tmp_path.iterdir())


IMPORTING = """
import os, signal, time
from grasp_ros.cli.main import run

def parser():
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(60.0)
    except KeyboardInterrupt:
        raise ImportError("of numpy") from None

raise SystemExit(run(parser, []))
"""


def test_a_signal_of_which_an_import_has_made_another_error_is_an_interrupt() -> None:
    """As numpy does it, with advice on broken installations."""
    found = ran(sys.executable, "-c", IMPORTING)
    assert (found.returncode, found.stderr) == (130, "grasp: interrupted\n")

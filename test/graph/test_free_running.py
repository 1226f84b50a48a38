"""The graph with the wall clock: held commands, timeouts, and the quality that it publishes."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from processes import DEADLINE, START

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.graph.processes import Graph
from grasp_ros.graph.verify import verify
from grasp_ros.physics.accuracy import ACCURACY

pytestmark = pytest.mark.slow  # real processes
PAGE = Path(__file__).parents[2] / "docs" / "graph.md"


def test_a_controller_at_its_own_rate_is_held_recorded_and_verified(launch: Any, tmp_path: Path) -> None:
    """The one that the page prints, beside one of ours."""
    [source] = re.findall(r"```python\n(.*?)```", PAGE.read_text().split("## With the wall clock")[1], re.S)[:1]
    begin = time.monotonic()
    run = launch(
        sys.executable, "-m", "grasp_ros.cli", "run", "case_01", "--set", "time.duration_s=1.5", "-o", "run",
        "--without", "left_controller", "--free-running", "0.5", cwd=tmp_path, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    launch(sys.executable, "-c", source, stderr=subprocess.DEVNULL)
    out, err = run.communicate(timeout=DEADLINE)
    assert run.returncode == 0, out + err
    assert time.monotonic() - begin > 3.0  # half as fast as the clock
    recording = bag.read(tmp_path / "run" / "bag")
    assert recording.running.words == "free-running, 0.5 s in a second"
    assert recording.tick.tolist() == list(range(1501))
    assert verify(recording).holds
    assert 3 < len(np.unique(recording.effort[:, 0])) < 200  # held over many periods
    assert np.isnan(recording.lyapunov[:, 0]).all()
    with (tmp_path / "run" / "bag" / "bag.mcap").open("rb") as file:
        rows = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/timing"])
        timing = [dict(zip(row.decoded_message.name, row.decoded_message.position, strict=True)) for row in rows]
    assert timing
    assert {"period_s", "jitter_s", "overruns", "right_age_p99", "left_age_max"} <= timing[0].keys()
    assert 0.001 < np.median([row["period_s"] for row in timing]) < 0.01


@pytest.mark.parametrize(("reaction", "status"), [("stop", 1), ("zero", 0)])
def test_a_silent_controller_has_the_declared_reaction(launch: Any, reaction: str, status: int) -> None:
    plant = launch(
        *START, "plant", "--ros-args", "-p", "scene:=arm_alone", "-p", "free_running:=true", "-p",
        "real_time_factor:=50", "-p", "left_timeout_s:=0.25", "-p", f"left_on_timeout:={reaction}",
        stderr=subprocess.PIPE,
    )
    errors = plant.communicate(timeout=DEADLINE)[1]
    assert plant.returncode == status
    assert f"left: no command for 0.25 s at tick 250: {reaction}" in errors
    assert ("finished 20000 ticks" in errors) is (reaction == "zero")


def test_a_plant_that_is_faster_than_its_monitor_loses_no_state(tmp_path: Path, command: Any) -> None:
    """Three seconds in a sixtieth of one: it waits for what records it; what its controllers answer acts late."""
    plant = {"free_running": "true", "real_time_factor": "180", "left_timeout_s": "9", "right_timeout_s": "9"}
    case = scene.load("case_01", ["time.duration_s=3"])
    graph = Graph(case, tmp_path / "run", ACCURACY, errors=subprocess.DEVNULL, plant=plant)
    graph.start()
    try:
        graph.wait([])
    finally:
        graph.stop()
    recording = bag.read(graph.bag)
    assert recording.tick.tolist() == list(range(3001))
    assert verify(recording).words == "3001 states follow from the recorded inputs, bit for bit"
    assert recording.missing["joint_states"] == recording.missing["contact/left"] == 0
    refused = command("study", "free-running", "case_01", "--factor", "0")
    assert refused.returncode == 2
    assert "--seconds 60 --factor 0: not allowed; allowed: a factor > 0" in refused.stderr

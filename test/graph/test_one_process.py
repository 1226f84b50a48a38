"""All nodes in one process, and the node classes as an API."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import grasp
from processes import DEADLINE

from grasp_ros import scene
from grasp_ros.graph import bag
from grasp_ros.simulation import simulate

pytestmark = pytest.mark.slow  # real nodes
PAGE = Path(__file__).parents[2] / "docs" / "graph.md"


def test_one_process_records_the_same_bits(tmp_path: Path) -> None:
    settings = ["time.duration_s=0.6"]
    found = grasp("run", "case_01", "--set", *settings, "--one-process", "-o", "run", cwd=tmp_path)
    assert found.returncode == 0, found.stderr
    assert "equal, bit for bit" in found.stdout
    recording = bag.read(tmp_path / "run" / "bag")
    simulated = simulate(scene.load("case_01", settings), sampled=True)
    assert recording.state.tobytes() == simulated.state.tobytes()
    assert recording.command.tobytes() == simulated.command.tobytes()
    assert not any(recording.missing.values())
    assert recording.closed


def test_the_example_of_the_page_runs() -> None:
    """In a process of its own: it ends rclpy's default context."""
    [source] = re.findall(r"```python\n(.*?)```", PAGE.read_text().split("## One process")[1].split("\n## ")[0], re.S)
    last = "\nassert plant.tick >= 100 and plant.scene.values['left_arm']['position_m'] == 0.25\n"
    found = subprocess.run(
        [sys.executable, "-c", source + last], capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert found.returncode == 0, found.stderr

"""The node classes as an API; that one process records the same bytes as four stands in `test_bags`."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from processes import DEADLINE

pytestmark = pytest.mark.slow  # real nodes
PAGE = Path(__file__).parents[2] / "docs" / "graph.md"


def test_the_example_of_the_page_runs() -> None:
    """In a process of its own: it ends rclpy's default context."""
    [source] = re.findall(r"```python\n(.*?)```", PAGE.read_text().split("## One process")[1].split("\n## ")[0], re.S)
    last = "\nassert plant.tick >= 100 and plant.scene.values['left_arm']['position_m'] == 0.25\n"
    found = subprocess.run(
        [sys.executable, "-c", source + last], capture_output=True, text=True, timeout=DEADLINE, check=False
    )
    assert found.returncode == 0, found.stderr

"""Starting nodes in processes of their own, and waiting for them with a deadline."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

DEADLINE = 60.0  # s
START = [sys.executable, "-m", "grasp_ros.graph.nodes.start"]


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.01)

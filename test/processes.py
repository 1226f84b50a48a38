"""Starting nodes in processes of their own, and waiting for them with a deadline."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

DEADLINE = 60.0  # s
START = [sys.executable, "-m", "grasp_ros.graph"]


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.01)


def end_nodes(*nodes: Any) -> None:
    """End nodes of this process, as their own process would."""
    for node in nodes:
        node.close()
        node.destroy_node()


def children(directory: Path) -> dict[str, int]:
    """Process ids of what `grasp run` has started in a directory, by node."""
    found = {}
    for process in Path("/proc").iterdir():
        try:
            words = (process / "cmdline").read_bytes().decode().split("\0") if process.name.isdigit() else []
            own = words and (process / "cwd").resolve() == directory.resolve()
        except OSError:  # it has just ended
            continue
        if own and "child" in words:
            found[words[words.index("child") + 1]] = int(process.name)
    return found

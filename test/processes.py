"""Starting nodes in processes of their own, and waiting for them with a deadline."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

DEADLINE = 60.0  # s
START = [sys.executable, "-m", "grasp_ros.graph"]
GRASP = [sys.executable, "-m", "grasp_ros.cli"]
NODES = ("monitor", "left_controller", "right_controller", "plant")


def ran(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """A process that has ended by itself, with what it said."""
    return subprocess.run(words, capture_output=True, text=True, timeout=DEADLINE, check=False, **options)


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + DEADLINE
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.01)


def growing(bag: Path, size: int = 20_000) -> Path:
    """The file of a bag, once a graph has written so many bytes into it."""
    file = bag / "bag.mcap"
    wait_for(lambda: file.exists() and file.stat().st_size > size, "a bag that grows")
    return file


def more_ticks(file: Path) -> None:
    """Wait until a graph has recorded some more."""
    size = file.stat().st_size
    wait_for(lambda: file.stat().st_size > size + 20_000, "more ticks")


def node_command(name: str, **numbers: object) -> list[str]:
    """What starts a node with some parameters."""
    return [*START, name, "--ros-args", *(word for key, value in numbers.items() for word in ("-p", f"{key}:={value}"))]


class Terminals:
    """Four nodes, each with its terminal."""

    def __init__(self, launch: Any, directory: Path, scene: str, options: Sequence[str] = ()) -> None:
        self.directory, self.processes = directory, {}
        for name in NODES:
            own = {"plant": ["-p", f"scene:={scene}"], "monitor": ["-p", f"bag:={directory / 'bag'}"]}.get(name, [])
            wait = [] if name == "monitor" else ["-p", "wait_for_monitor:=true"]
            with (directory / name).open("w") as log:
                words = [*START, name, "--ros-args", *own, *wait, *options]
                self.processes[name] = launch(*words, stderr=log)
        self.file = growing(directory / "bag")

    def said(self, *names: str) -> str:
        return "".join((self.directory / name).read_text() for name in names or NODES)

    def wait_for(self, name: str, words: str) -> None:
        """Until a node has said something."""
        wait_for(lambda: bool(re.search(words, self.said(name))), words)


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

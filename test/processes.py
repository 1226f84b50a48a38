"""Starting nodes in processes of their own, and waiting for them with a deadline."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

DEADLINE = 60.0  # s
START = [sys.executable, "-m", "grasp_ros.graph"]
GRASP = [sys.executable, "-m", "grasp_ros.cli"]
NODES = ("monitor", "left_controller", "right_controller", "plant")


def ran(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """A process that has ended by itself, with what it said."""
    return subprocess.run(words, capture_output=True, text=True, timeout=DEADLINE, check=False, **options)


def ended(process: Any, status: int = 0) -> tuple[str, str]:
    """What a process has said by its end, which has this status and is no fault of ours."""
    out, err = (words or "" for words in process.communicate(timeout=DEADLINE))
    assert process.returncode == status, out + err
    assert "Traceback" not in out + err
    return out, err


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


STRANGER = """
import sys, time
import rclpy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
rclpy.init()
node = rclpy.create_node({!r})
"""
ANSWERS = """
commands = node.create_publisher(WrenchStamped, "left/effort_command", 1000)
def answer(state):
    force = force_for(state)
    if force is not None:
        command = WrenchStamped(header=state.header)
        command.wrench.force.x = force
        commands.publish(command)
while commands.get_subscription_count() < 2:  # plant and monitor
    rclpy.spin_once(node, timeout_sec=0.01)
node.create_subscription(JointState, "joint_states", answer, 1000)
rclpy.spin(node)
"""


def stranger(name: str, source: str, answers: bool = False) -> list[str]:
    """What starts a node that is not of this package, of which this is the source; or its `force_for` a state."""
    return [sys.executable, "-c", STRANGER.format(name) + source + answers * ANSWERS]


def write_law(directory: Path, *lines: str) -> None:
    """A module `mine` whose `law` has the feedback of case 1, and does something before each answer: from line 3 on.

    `seen` is a list that it keeps.
    """
    words = ["import os, sys, time", "def law(tick, t, x, v, seen=[]):", *(f"    {line}" for line in lines)]
    (directory / "mine.py").write_text("\n".join([*words, "    return -5.0 * x - 0.5 * v\n"]))


class Terminals:
    """Four nodes, each with its terminal; parameters of the plant, and of all."""

    def __init__(
        self, launch: Any, directory: Path, plant: Mapping[str, object] = MappingProxyType({}), **everywhere: object
    ) -> None:
        self.directory, self.processes = directory, {}
        own = {"plant": {"scene": "case_01", **plant}, "monitor": {"bag": directory / "bag"}}
        for name in NODES:
            wait = {} if name == "monitor" else {"wait_for_monitor": "true"}
            with (directory / name).open("w") as log:
                words = node_command(name, **own.get(name, {}), **wait, **everywhere)
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

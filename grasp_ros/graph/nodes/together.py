"""Several nodes of the graph in one process and one thread."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial

from grasp_ros.graph.nodes.controller import Controller
from grasp_ros.graph.nodes.monitor import Monitor
from grasp_ros.graph.nodes.plant import Plant
from grasp_ros.graph.ros.life import run
from grasp_ros.graph.ros.node import GraspNode

NODES: dict[str, Callable[[], GraspNode]] = {
    "plant": Plant,
    "monitor": Monitor,
    **{name: partial(Controller, name) for name in ("left_controller", "right_controller")},
}


def main(_: str, received: Sequence[int]) -> int:
    """Run the nodes that stand on the command line before `--ros-args`; their parameters as `-p node:name:=value`."""
    words = sys.argv[1 : sys.argv.index("--ros-args")]
    return run([NODES[word] for word in words], received)

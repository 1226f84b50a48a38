"""Ticks a second of a graph, and of the same graph on bare rclpy: the same messages and QoS, and nothing else."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from pathlib import Path

from grasp_ros.graph.processes import Graph
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene import Scene
from lab.drills import nodes

RUN_SECONDS = 300.0
NODES = ("monitor", "left_controller", "right_controller", "plant")  # the last one says how fast
SPEED = re.compile(r"(\d+(?:\.\d+)?) ticks/s")


def our_speed(scene: Scene) -> float:
    """Ticks per second of the whole graph with physics, monitor and bag."""
    with tempfile.TemporaryDirectory() as directory:
        folder = Path(directory) / "run"
        graph = Graph(scene, folder, ACCURACY, errors=subprocess.PIPE)
        graph.start()
        try:
            graph.wait([])
        finally:
            graph.stop()
        return _speed(graph.processes["plant"])


def baseline_speed(ticks: int) -> float:
    """Ticks per second of the same graph on plain rclpy."""
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    started = [
        subprocess.Popen(
            [*nodes.command("baseline"), str(ticks), name], env=environment, stderr=subprocess.PIPE,
        )
        for name in NODES
    ]
    try:
        return _speed(started[-1])
    finally:
        for process in started:
            process.kill()
            process.communicate()


def _speed(plant: subprocess.Popen[bytes]) -> float:
    _, text = plant.communicate(timeout=RUN_SECONDS)
    found = SPEED.search(text.decode())
    if found is None:
        raise RuntimeError(f"the plant did not finish: {text.decode()}")
    return float(found[1])

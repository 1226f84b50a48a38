"""How much of a bare rclpy graph's speed is left when there is physics, a monitor and a bag.

Both graphs are four processes with the same messages and QoS; they run in turn, so that the ratio holds on a machine
that is shared.
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from tqdm import tqdm

from grasp_ros.exact.integrator import ACCURACY
from grasp_ros.graph.processes import Graph
from grasp_ros.scene import Scene
from grasp_ros.simulation.versions import versions

REPEATS = 5
RUN_SECONDS = 300.0
SPEED = re.compile(r"(\d+(?:\.\d+)?) ticks/s")


def run(scene: Scene) -> None:
    """Print ticks per second of both graphs and their ratio.

    Raises
    ------
    RuntimeError
        If a graph does not finish.
    """
    bare, ours = [], []
    for _ in tqdm(range(REPEATS), desc="pairs of runs", unit="pair"):
        bare.append(bare_speed(scene.ticks))
        ours.append(our_speed(scene))
    ratios = [mine / theirs for mine, theirs in zip(ours, bare, strict=True)]
    print(f"{scene.title}, {scene.ticks} ticks in lockstep, {REPEATS} pairs of runs, {os.cpu_count()} processors")
    print(", ".join(f"{name} {version}" for name, version in versions().items()))
    for name, unit, values in (
        ("bare rclpy", " ticks/s", bare),
        ("grasp_ros with physics, V and bag", " ticks/s", ours),
        ("ratio, pair by pair", "", ratios),
    ):
        median, low, high = statistics.median(values), min(values), max(values)
        print(f"{name:<34} median {median:.4g}{unit}, {low:.4g} to {high:.4g}")


def our_speed(scene: Scene) -> float:
    """Ticks per second of the whole graph with physics, monitor and bag."""
    with tempfile.TemporaryDirectory() as directory:
        graph = Graph(scene, Path(directory) / "run", ACCURACY, errors=subprocess.PIPE)
        graph.start()
        try:
            graph.wait([])
        finally:
            graph.stop()
        return _speed(graph.processes["plant"])


def bare_speed(ticks: int) -> float:
    """Ticks per second of the same graph on plain rclpy."""
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    processes = {
        name: subprocess.Popen(
            [sys.executable, "-P", "-m", "grasp_ros.graph.nodes.bare", name, str(ticks)], env=environment,
            stderr=subprocess.PIPE,
        )
        for name in ("monitor", "left_controller", "right_controller", "plant")
    }
    try:
        return _speed(processes["plant"])
    finally:
        for process in processes.values():
            process.kill()
            process.communicate()


def _speed(plant: subprocess.Popen[bytes]) -> float:
    _, text = plant.communicate(timeout=RUN_SECONDS)
    found = SPEED.search(text.decode())
    if found is None:
        raise RuntimeError(f"the plant did not finish: {text.decode()}")
    return float(found[1])

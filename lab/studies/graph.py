"""How much of a bare rclpy graph's speed is left when there is physics, a monitor and a bag, in four processes and one.

The graphs have the same messages and QoS; they run in turn, so that ratios hold on a machine that is shared. Then: how
long a run takes to its first state, and how long a bag of a minute takes to be verified.
"""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from tqdm import tqdm

from grasp_ros.graph.processes import Graph
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene import Scene
from grasp_ros.scene.versions import versions
from grasp_ros.simulation import simulate
from lab.drills import nodes, recorder

REPEATS = 5
RUN_SECONDS = 300.0
NODES = ("monitor", "left_controller", "right_controller", "plant")
FINISHED = re.compile(r"\[INFO\] \[(\d+\.\d+)\] \[plant\]: finished (\d+) ticks at (\d+\.\d+) ticks/s")
SPEED = re.compile(r"(\d+(?:\.\d+)?) ticks/s")
LOG_FORMAT = "[{severity}] [{time}] [{name}]: {message}"
START_TICKS = 100
VERIFIED_SECONDS = 60.0  # simulated
GRASP = [sys.executable, "-P", "-m", "grasp_ros.cli"]


def run(scene: Scene, repeats: int = REPEATS) -> None:
    """Print ticks per second of the graphs and their ratios, the time to the first state, and that of a verification.

    Raises
    ------
    RuntimeError
        If a graph does not finish.
    """
    graphs: dict[str, Callable[[], float]] = {
        "bare rclpy, four processes": lambda: bare_speed(scene.ticks),
        "grasp_ros, four processes": lambda: our_speed(scene),
        "bare rclpy, one process": lambda: bare_speed(scene.ticks, one_process=True),
        "grasp_ros, one process": lambda: our_speed(scene, one_process=True),
    }
    speeds: dict[str, list[float]] = {name: [] for name in graphs}
    for _ in tqdm(range(repeats), desc="rounds", unit="round"):
        for name, measure in graphs.items():
            speeds[name].append(measure())
    bare, ours, floor, one = speeds.values()
    print(f"{scene.title}, {scene.ticks} ticks in lockstep, {repeats} rounds, {os.cpu_count()} processors")
    print(", ".join(f"{name} {version}" for name, version in versions().items()))
    for name, values in speeds.items():
        _show(name, values, " ticks/s")
    _show("grasp_ros / bare, four processes", _ratios(ours, bare))
    _show("grasp_ros / bare, one process", _ratios(one, floor))
    _show("one process / four, grasp_ros", _ratios(one, ours))
    _show("start to first state", [first_state(scene) for _ in range(repeats)], " s")
    _show(f"grasp verify, {VERIFIED_SECONDS:g} s", verification(scene, repeats), " s")


def _ratios(these: Sequence[float], those: Sequence[float]) -> list[float]:
    """Round by round."""
    return [this / that for this, that in zip(these, those, strict=True)]


def _show(name: str, values: Sequence[float], unit: str = "") -> None:
    median, low, high = statistics.median(values), min(values), max(values)
    print(f"{name:<34} median {median:.4g}{unit}, {low:.4g} to {high:.4g}")


def our_speed(scene: Scene, one_process: bool = False) -> float:
    """Ticks per second of the whole graph with physics, monitor and bag."""
    with tempfile.TemporaryDirectory() as directory:
        place = Path(directory) / "run"
        graph = Graph(scene, place, ACCURACY, errors=subprocess.PIPE, one_process=one_process)
        graph.start()
        try:
            graph.wait([])
        finally:
            graph.stop()
        return _speed(graph.processes["graph" if one_process else "plant"])


def bare_speed(ticks: int, one_process: bool = False) -> float:
    """Ticks per second of the same graph on plain rclpy."""
    processes = [NODES] if one_process else [(name,) for name in NODES]  # the plant is in the last one
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    started = [
        subprocess.Popen(
            [*nodes.command("baseline"), str(ticks), *names], env=environment,
            stderr=subprocess.PIPE,
        )
        for names in processes
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


def first_state(scene: Scene) -> float:
    """Wall time in s from the start of `grasp run` to the first state, with everything compiled.

    The plant says when it has finished, and how fast it was since the first state.
    """
    duration = START_TICKS * scene.duration / scene.ticks
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory) / "scene.yaml"
        file.write_text(scene.changed({"time.duration_s": duration}).to_yaml(), encoding="utf-8")
        begin = time.time()
        found = subprocess.run(
            [*GRASP, "run", str(file), "-o", str(Path(directory) / "run")], capture_output=True, text=True,
            check=False, timeout=RUN_SECONDS, env={**os.environ, "RCUTILS_CONSOLE_OUTPUT_FORMAT": LOG_FORMAT},
        )
    end = FINISHED.search(found.stderr)
    if end is None:
        raise RuntimeError(f"the run did not finish: {found.stderr}")
    return float(end[1]) - int(end[2]) / float(end[3]) - begin


def verification(scene: Scene, repeats: int) -> list[float]:
    """Wall times in s of `grasp verify` of a bag of a minute."""
    times = []
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "bag"
        recorder.write(path, simulate(scene.changed({"time.duration_s": VERIFIED_SECONDS}), sampled=True))
        for _ in range(repeats):
            begin = time.perf_counter()
            subprocess.run([*GRASP, "verify", str(path)], check=True, stdout=subprocess.DEVNULL)
            times.append(time.perf_counter() - begin)
    return times

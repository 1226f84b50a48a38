"""What accuracy costs over topics: the control period against deviation and against wall time.

The deviation is that of the sampled loop from the paper's continuous feedback. It is the same in one process and in
four, bit for bit; only the price differs. The floor is the same graph on bare rclpy, without physics or a bag.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import simulation
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.scene import Scene
from lab.drills import nodes
from lab.studies.records import Journal, origin, scene_key

PERIODS_MS = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
GRAPH_PERIODS_MS = (20.0, 5.0, 1.0, 0.5, 0.1)
COMMON_S = 0.02  # the deviation is looked at where all periods have a tick
PAIRS = 2  # of runs, baseline and ours in turn; the fastest counts
TICKS = 1000  # of a graph; its speed does not depend on how far it goes
RUN_SECONDS = 300.0
NODES = ("monitor", "left_controller", "right_controller", "plant")  # the last one says how fast
SPEED = re.compile(r"(\d+(?:\.\d+)?) ticks/s")


class Point(NamedTuple):
    """One control period."""

    period_ms: float
    deviation: float  # largest distance of a position from continuous feedback, m
    one_process: float  # wall seconds per simulated second
    four_processes: float | None  # None: not measured at this period
    baseline: float | None


def run(scene: Scene, directory: Path, graph_periods: tuple[float, ...] = GRAPH_PERIODS_MS) -> list[Point]:
    """Measure every period; resumes from the journal."""
    journal = Journal(directory)
    steps = round(scene.duration / COMMON_S)
    grid = np.linspace(0.0, scene.duration, steps + 1)
    ideal = simulation.simulate(scene, grid=grid).state
    points = []
    for period in (bar := tqdm(PERIODS_MS, unit="period", file=sys.stderr)):
        bar.set_description(f"control period {period:g} ms")
        key = f"loop {scene_key(scene)} {origin('grasp_ros')} {period!r} {period in graph_periods}"
        points.append(journal.kept(key, Point, partial(_measure, scene, period, grid, ideal, period in graph_periods)))
    return points


def _measure(scene: Scene, period_ms: float, grid: Any, ideal: Any, with_graph: bool) -> Point:
    sampled = scene.changed({"time.control_period_s": period_ms / 1e3})
    begin = time.perf_counter()
    state = simulation.simulate(sampled, grid=grid, sampled=True).state
    one = (time.perf_counter() - begin) / scene.duration
    four = baseline = None
    if with_graph:
        short = sampled.changed({"time.duration_s": TICKS * round(period_ms * 1e6) / 1e9})
        per_tick = 1e3 / period_ms  # ticks per simulated second
        pairs = [(baseline_speed(TICKS), our_speed(short)) for _ in range(PAIRS)]
        baseline, four = (per_tick / max(speeds) for speeds in zip(*pairs, strict=True))
    return Point(period_ms, float(np.abs(state - ideal)[:, ::2].max()), one, four, baseline)


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
    command = [*nodes.command("baseline"), str(ticks)]
    started = [subprocess.Popen([*command, name], env=environment, stderr=subprocess.PIPE) for name in NODES]
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

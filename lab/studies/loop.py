"""What accuracy costs over topics: the control period against deviation and wall time, and where stability ends.

The deviation is that of the sampled loop from the paper's continuous feedback. It is the same in one process and in
four, bit for bit; only the price differs. The floor is the same graph on bare rclpy, without physics or a bag. At which
control period the sampled loop of a free arm loses stability is confirmed by simulation.
"""

from __future__ import annotations

import math
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
from scipy.optimize import brentq
from tqdm import tqdm

from grasp_ros import simulation
from grasp_ros.graph.processes import Graph
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.control import ControlLaw
from grasp_ros.physics.layout import LEFT, Of, V, X
from grasp_ros.physics.model import Arm
from grasp_ros.physics.sampled import spectral_radius
from grasp_ros.physics.system import System
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from grasp_ros.simulation import SampledPlant
from lab.drills import nodes
from lab.reference.grasp import commands
from lab.studies.records import Journal, origin, scene_key

PERIODS_MS = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
GRAPH_PERIODS_MS = (20.0, 5.0, 1.0, 0.5, 0.1)
COMMON_S = 0.02  # the deviation is looked at where all periods have a tick
PAIRS = 2  # of runs, baseline and ours in turn; the fastest counts
TICKS = 1000  # of a graph; its speed does not depend on how far it goes
RUN_SECONDS = 300.0
FIRST_S, LAST_S, SCAN = 1e-4, 10.0, 3000  # periods that are looked at for the first crossing
GROWTH_TICKS = 4000
NEAR = (0.98, 1.02)  # of the limit: where the simulation confirms it
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


class Limit(NamedTuple):
    """Loss of stability of one arm."""

    delay: int  # periods
    period: float  # s; infinite if there is none
    checks: tuple[tuple[float, float], ...]  # period, growth per period in the simulation


def first_limit(arm: Arm, delay: int) -> float:
    """Smallest period in s at which the spectral radius passes 1 upwards; infinite if there is none up to LAST_S."""
    periods = np.geomspace(FIRST_S, LAST_S, SCAN)
    above = spectral_radius(arm, periods, delay) >= 1.0
    crossings = np.nonzero(above[1:] & ~above[:-1])[0]
    if not len(crossings):
        return math.inf
    low, high = periods[crossings[0]], periods[crossings[0] + 1]
    return float(brentq(lambda h: spectral_radius(arm, h, delay) - 1.0, low, high, xtol=1e-15, rtol=1e-15))


def simulated_growth(arm: Arm, period: float, delay: int, ticks: int = GROWTH_TICKS) -> float:
    """Growth per period of an arm alone in the plant's own simulation, from the second half of the run."""
    system = System(delay=delay, laws={LEFT: ControlLaw(arm.position_gain, arm.velocity_gain)})
    system.bodies[LEFT, :Of.FORCE] = arm.mass, arm.stiffness, arm.damping
    system.state[X.L] = 1e-150  # room to grow
    plant = SampledPlant(system, round(period * NANOSECONDS))
    sizes = []
    for tick in range(ticks):
        state = plant.state
        speed = math.sqrt((arm.stiffness + arm.position_gain) / arm.mass) * state[X.L]
        sizes.append(math.hypot(speed, state[V.L]))
        plant.step(commands(system, tick, state))
    half = ticks // 2
    window = ticks // 8  # maxima over a window: the phase of the oscillation drops out
    return float((max(sizes[-window:]) / max(sizes[half - window : half])) ** (1.0 / (ticks - half)))


def limits(arm: Arm, delays: tuple[int, ...] = (0, 1)) -> list[Limit]:
    """The first limit for each delay, confirmed by simulation a little below and above it."""
    found = []
    for delay in delays:
        period = first_limit(arm, delay)
        near = [factor * period for factor in NEAR if math.isfinite(period)]
        checks = tuple((h, simulated_growth(arm, h, delay)) for h in near)
        found.append(Limit(delay, period, checks))
    return found

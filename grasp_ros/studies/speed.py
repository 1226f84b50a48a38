"""What it costs to simulate a scene to a given error: this package beside heyoka and scipy, in one run.

The error is measured against `reference`, not believed from a tolerance. Every solver climbs a ladder of settings
from loose to tight and is timed at the first one that reaches the error. The timings are interleaved, so that their
ratios hold on a machine that is shared.
"""

from __future__ import annotations

import json
import platform
import statistics
import sys
import time
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import reference, simulation
from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, RIGHT, Event
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.studies.peer_heyoka import heyoka_methods
from grasp_ros.studies.peers import Answer, Method, Solve, scipy_methods
from grasp_ros.studies.speed_report import OURS, Attempt, Growth, Timing, report

DIGITS = 25
PATIENCE_S = 20.0  # a solver that needs longer for one run climbs no further
BUDGET_S, FEWEST, MOST = 3.0, 3, 200  # per solver: time for its repeats, and their number
ENDURANCE = (1.0, 1e2, 1e4, 1e6)  # s
MULTIPLES = (0.25, 0.5, 1.0, 2.0)  # of the scene's duration
SWINGING = (  # an undamped left arm that swings for ever and touches nothing
    "left_arm.position_m=-0.3", "left_arm.damping_Ns_per_m=0", "left_feedback.velocity_gain_Ns_per_m=0",
    "object.position_m=1", "object.velocity_m_per_s=0", "right_arm.position_m=2", "right_arm.velocity_m_per_s=0",
    "right_arm.stiffness_N_per_m=0", "right_feedback.position_gain_N_per_m=0",
)


class Truth(NamedTuple):
    """The solution in high precision."""

    grid: Array  # (n,), s
    state: Array  # (n, 6), m and m/s
    touches: tuple[int, int]


def run(scene: Scene, error: float, out: Path | None) -> None:
    """Print time to an error of all solvers, their ratios, and how the cost grows; write the records as JSON.

    Parameters
    ----------
    scene : Scene
    error : float
        Largest absolute error allowed, over all six states (m and m/s) and all output times.
    out : Path, optional

    Raises
    ------
    ValueError
        If the error is not positive, a pair starts in contact, or condition (10)'s second surface acts: the peers
        know neither.
    """
    _check(scene, error)
    truth = _truth(scene)
    outputs = {"grid": truth.grid, "end": truth.grid[-1:]}
    attempts: list[Attempt] = []
    timings: list[Timing] = []
    methods = [_ours(scene), *heyoka_methods(scene), *scipy_methods(scene)]
    for output, grid in outputs.items():
        finalists = []
        for method in tqdm(methods, desc=f"error at the {output}", file=sys.stderr):
            tries, solve = _climb(method, output, grid, truth, error)
            attempts += tries
            if solve is not None:
                finalists.append((tries[-1], solve))
        timings += _race(finalists, grid, output)
    endurance = [_growth(_horizon(scene, seconds, SWINGING)) for seconds in ENDURANCE]
    contacts = [_growth(_horizon(scene, factor * scene.duration)) for factor in MULTIPLES]
    heading = [
        f"{scene.name}: time to an error of at most {error:g}",
        f"error: {_metric(scene, truth)}",
        f"touches there are: {truth.touches[LEFT]}/{truth.touches[RIGHT]} left/right; -: not looked for",
        "first: construction and first run, with what it compiles; min, median: later runs, solvers in turn",
        ", ".join(f"{name} {version}" for name, version in _machine().items()),
    ]
    print("\n".join([*heading, *report(attempts, timings, endurance, contacts)]))
    if out is not None:
        record = {
            "scene": scene.to_yaml(), "metric": _metric(scene, truth), "error": error, "machine": _machine(),
            "touches": truth.touches, "attempts": [attempt._asdict() for attempt in attempts],
            "timings": [{**timing._asdict(), "attempt": timing.attempt._asdict()} for timing in timings],
            "duration": [row._asdict() for row in endurance], "contacts": [row._asdict() for row in contacts],
        }
        out.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _check(scene: Scene, error: float) -> None:
    if not error > 0.0:
        raise ValueError(f"--error {error!r} is not allowed; allowed: a number > 0")
    x_l, _, x_o, _, x_r, _ = scene.initial_state
    if not x_l < x_o < x_r:
        raise ValueError(f"{scene.name}: starts in contact; allowed here: scenes that start with gaps on both sides")
    if any(event.kind == Event.CLAMP for event in simulation.simulate(scene).events):
        raise ValueError(f"{scene.name}: a pair separates faster than 1/p; allowed here: scenes where none does")


def _truth(scene: Scene) -> Truth:
    grid = np.linspace(0.0, scene.duration, simulation.GRID_POINTS)
    with tqdm(total=1, desc="reference", file=sys.stderr) as bar:
        exact = reference.integrate(scene.grasp, scene.initial_state.tolist(), grid.tolist(), digits=DIGITS)
        bar.update()
    return Truth(grid, exact.as_array(), (len(exact.touches[LEFT]), len(exact.touches[RIGHT])))


def _ours(scene: Scene) -> Method:
    def build(accuracy: float) -> Solve:
        def solve(grid: Array) -> Answer:
            motion = simulation.simulate(scene, grid=grid, accuracy=accuracy)
            touches = len(motion.times(Event.TOUCH, LEFT)), len(motion.times(Event.TOUCH, RIGHT))
            return Answer(motion.state, touches, motion.status.name.lower())

        return solve

    return Method(OURS, "simulate", "accuracy", tuple(10.0 ** (-k / 2) for k in range(12, 33)), build)


def _climb(method: Method, output: str, grid: Array, truth: Truth, error: float) -> tuple[list[Attempt], Solve | None]:
    """Try the settings from loose to tight up to the first that reaches the error; None if none does."""
    tries = []
    for setting in method.ladder:
        begin = time.perf_counter()
        note = partial(Attempt, method.family, method.name, f"{method.knob} {setting:.0e}", output)
        try:
            solve = method.build(setting)
            answer = solve(grid)
        except ImportError:
            return [Attempt(method.family, method.name, "", output, None, None, 0.0, "not installed", False)], None
        seconds = time.perf_counter() - begin
        complete = len(answer.state) == len(grid)
        found = float(np.abs(answer.state - truth.state[-len(grid) :]).max()) if complete else None
        reached = found is not None and found <= error
        tries.append(note(found, answer.touches, seconds, answer.status, reached))
        if reached:
            return tries, solve
        if seconds > PATIENCE_S:
            break
    return tries, None


def _race(finalists: list[tuple[Attempt, Solve]], grid: Array, output: str) -> list[Timing]:
    """Time the finalists in turn; slow ones drop out once their time is used up."""
    samples: list[list[float]] = [[] for _ in finalists]
    for _ in tqdm(range(MOST), desc=f"timing at the {output}", file=sys.stderr):
        for (_, solve), times in zip(finalists, samples, strict=True):
            if len(times) < FEWEST or sum(times) < BUDGET_S:
                times.append(_seconds(solve, grid))
    return [
        Timing(attempt, min(times), statistics.median(times), len(times))
        for (attempt, _), times in zip(finalists, samples, strict=True)
    ]


def _seconds(solve: Solve, grid: Array) -> float:
    begin = time.perf_counter()
    solve(grid)
    return time.perf_counter() - begin


def _horizon(scene: Scene, duration: float, settings: tuple[str, ...] = ()) -> Scene:
    return scenes.parse(scene.to_yaml(), scene.name, scene.name, [*settings, f"time.duration_s={duration}"])


def _growth(scene: Scene) -> Growth:
    grid = np.array([scene.duration])
    touches = sum(event.kind == Event.TOUCH for event in simulation.simulate(scene, grid=grid).events)
    times = [_seconds(partial(_final_state, scene), grid) for _ in range(MOST)]
    return Growth(scene.duration, touches, statistics.median(times))


def _final_state(scene: Scene, grid: Array) -> Answer:
    return Answer(simulation.simulate(scene, grid=grid).state, None, "")


def _metric(scene: Scene, truth: Truth) -> str:
    return (
        f"largest absolute error over six states (m, m/s), against {DIGITS} digits; grid: {len(truth.grid)} times in"
        f" [0, {scene.duration:g}] s; end: the last of them only"
    )


def _machine() -> dict[str, str]:
    cpu = Path("/proc/cpuinfo")
    model = platform.processor()
    if cpu.exists():
        model = next((line.split(": ")[1] for line in cpu.read_text().splitlines() if "model name" in line), model)
    packages = {}
    for name in ("grasp_ros", "numpy", "numba", "llvmlite", "heyoka", "scipy"):
        try:
            packages[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            packages[name] = "not installed"
    return {"platform": platform.platform(), "cpu": model, "python": platform.python_version(), **packages}

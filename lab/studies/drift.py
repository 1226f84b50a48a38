"""Energy over a long time in the marginal elastic case, where V_c must stay what it is."""

from __future__ import annotations

import sys
import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from grasp_ros import scene as scenes
from grasp_ros.accuracy.measure import Contender
from grasp_ros.physics.energy import energy
from grasp_ros.scene import Scene
from lab.reference.deadline import Deadline, deadline
from lab.studies.accuracy import all_contenders
from lab.studies.records import Journal, origin, scene_key

SECONDS = 2000.0
POINTS = 2001
DEADLINE_S = 60.0
ENTRIES = {  # what a user would choose to be safe, as far as 2000 s in a minute allow
    "exact": 1e-16, "paper": 1e-3, "rk4": 1e-3, "rk4_events": 1e-3, "discrete_gradient": 1e-3, "dop853_events": 1e-12,
    "rk45_events": 1e-9, "odeint": 1e-12, "cvode_adams": 1e-12, "heyoka": 1e-15,
}


class Drift(NamedTuple):
    """Relative drift of V_c of one method."""

    method: str
    setting: str
    t: list[float]  # s
    drift: list[float]  # V_c / V_c(0) - 1 at t
    seconds: float  # wall time of the run
    status: str

    @property
    def worst(self) -> float:
        """Largest relative drift so far as the method came."""
        return max(map(abs, self.drift), default=float("nan"))


def elastic(seconds: float = SECONDS) -> Scene:
    """Case 2, over a longer horizon."""
    return scenes.load("case_02", [f"time.duration_s={seconds!r}"])


def run(directory: Path, seconds: float = SECONDS, methods: dict[str, float] | None = None) -> list[Drift]:
    """Energy drift of each method; resumes from the journal."""
    journal, scene = Journal(directory), elastic(seconds)
    chosen = ENTRIES if methods is None else methods
    contenders = {contender.name: contender for contender in all_contenders(scene)}
    results = []
    for name, setting in (bar := tqdm(chosen.items(), unit="method", file=sys.stderr)):
        bar.set_description(f"energy drift {name}")
        key = f"drift {scene_key(scene)} {origin(contenders[name].family)} {name} {setting!r}"
        results.append(journal.kept(key, Drift, partial(_measure, contenders[name], scene, setting)))
    return results


def _measure(contender: Contender, scene: Scene, setting: float) -> Drift:
    grid = np.linspace(0.0, scene.duration, POINTS)
    text = f"{contender.knob} {setting:.0e}"
    try:
        solve = contender.build(scene, setting)
        solve(grid[:2])  # compiles
        with deadline(DEADLINE_S):
            begin = time.perf_counter()
            answer = solve(grid)
            seconds = time.perf_counter() - begin
    except ImportError:
        return Drift(contender.name, text, [], [], 0.0, "not installed")
    except Deadline:
        return Drift(contender.name, text, [], [], DEADLINE_S, f"stopped: longer than {DEADLINE_S:g} s")
    level = energy(scene.system, answer.state).V_c
    drift = level / energy(scene.system, scene.initial_state).V_c - 1.0
    return Drift(contender.name, text, grid[: len(level)].tolist(), drift.tolist(), seconds, answer.status)

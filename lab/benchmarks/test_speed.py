"""Speed of what a user waits for, compared with the last saved result of this machine: `make benchmark`.

pytest-benchmark repeats, stores and compares; a test fails if its fastest run is slower than before by more than the
Makefile allows. Times are those of warm calls: pytest-benchmark's calibration is the first one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.simulation import simulate
from lab.studies.accuracy import default_scenes
from lab.studies.derivative_cost import NUMBERS

SCENES = {scene.name: scene for scene in default_scenes()}
STEPPING = {"paper": 1e-3, "rk4": 1e-3, "rk4_events": 1e-3, "discrete_gradient": 1e-3, "dop853_events": 1e-6}


@pytest.mark.parametrize("name", SCENES)
def test_exact_at_2001_times(benchmark: Any, name: str) -> None:
    benchmark(simulate, SCENES[name])


@pytest.mark.parametrize("name", SCENES)
def test_exact_at_the_end(benchmark: Any, name: str) -> None:
    benchmark(simulate, SCENES[name], grid=np.array([SCENES[name].duration]))


def test_sampled(benchmark: Any) -> None:
    benchmark(simulate, scenes.load("case_01", ["time.duration_s=2"]), sampled=True)


@pytest.mark.parametrize("method", STEPPING)
def test_method(benchmark: Any, method: str) -> None:
    benchmark(simulate, SCENES["case_01"], method=method, setting=STEPPING[method])


def test_elastic_over_a_long_time(benchmark: Any) -> None:
    scene = scenes.load("case_02", ["time.duration_s=200"])
    benchmark(simulate, scene, grid=np.array([200.0]))


@pytest.mark.parametrize("count", [1, len(NUMBERS)])
def test_derivatives_at_the_end(benchmark: Any, count: int) -> None:
    scene = SCENES["case_01"]
    benchmark(simulate, scene, grid=np.array([scene.duration]), sensitivity=NUMBERS[:count])

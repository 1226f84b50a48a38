"""No change of the code changes a bit of a result unless it means to."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from project.digests import digest, last_state, runs, versions

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import EPS
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.cases.regression import nearby

FILE = Path(__file__).with_name("digests.json")
RECORD = "python test/project/digests.py > test/project/digests.json"

DRAWS = 8  # of scenes whose numbers are one rounding off; two may leave the growth of `case_05` out
ROUNDINGS = 32.0  # of those: an accuracy of 1e-14 changes a last state by up to 26


def allowed(scene: Scene, sampled: bool, last: list[float]) -> float:
    """What roundings on the way may change of its last state: some of what one of each number at the start becomes."""
    ends = [last_state(simulate(near, sampled=sampled)) for near in nearby(scene, DRAWS)]
    return ROUNDINGS * float(np.abs(np.subtract(ends, last)).max() + EPS * np.abs(last).max())


@pytest.mark.parametrize("name", ["case_01", "case_06", "case_10", "noise"])
def test_an_error_is_told_from_roundings(name: str) -> None:
    scene = scenes.load(name)
    last, other = (last_state(simulate(scene, setting=accuracy)) for accuracy in (None, 1e-14))
    found, size = allowed(scene, scene.sampled, last), np.abs(last).max()
    assert np.abs(np.subtract(other, last)).max() <= found < 1e-8 * size
    assert name != "case_10" or found < 1e-12 * size


@pytest.mark.slow
@pytest.mark.parametrize("script", ["project/digests.py", "exact/mutants.py"])
def test_a_script_measures_the_checkout_that_it_stands_in(tmp_path: Path, script: str) -> None:
    """Not what is installed."""
    code = "import runpy, sys; runpy.run_path(sys.argv[1]); import grasp_ros; print(grasp_ros.__file__)"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    found = subprocess.run([sys.executable, "-c", code, FILE.parents[1] / script], cwd=tmp_path, env=environment,
                           capture_output=True, text=True, timeout=60.0, check=True)
    assert Path(found.stdout.strip()) == FILE.parents[2] / "grasp_ros" / "__init__.py"


@pytest.mark.slow
def test_states_events_and_counters_of_every_scene_keep_every_bit() -> None:
    """Where the last bits of another machine differ, the states at the end are what they were but for roundings."""
    recorded, found = json.loads(FILE.read_text(encoding="utf-8")), runs()
    new = sorted(found.keys() - recorded["digests"].keys())
    assert not new, f"{FILE.name} does not have the runs of a new scene: {', '.join(new)}. Record them: {RECORD}"
    for key, run in found.items():
        before, now = recorded["last states"][key], last_state(run)
        assert now == before or now == pytest.approx(before, rel=0, abs=allowed(run.scene, run.sampled, now)), key
    if recorded["versions"] != versions():
        pytest.skip(f"digests were recorded with {recorded['versions']}, this is {versions()}: last bits may differ")
    different = sorted(key for key, before in recorded["digests"].items()
                       if key not in found or digest(found[key]) != before)
    assert not different, (
        f"{len(different)} of {len(found)} runs have other states, events or counters: {', '.join(different)}. If a"
        " scene that was changed or removed, or a change of the numerics that the CHANGELOG names, explains every one:"
        f" {RECORD}. If not, it is a fault."
    )

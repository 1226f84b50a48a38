"""Runs of whole scenes: continuous, on any grid, and on disk."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import case_of, horizon

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, Work
from grasp_ros.simulation import GRID_POINTS, load, simulate
from grasp_ros.simulation.ensemble import ensemble


def test_continuous_is_the_integrator() -> None:
    scene = case_of(duration=5.0)
    result = simulate(scene)
    integrator = Integrator(scene.system, continuous=True)
    states = integrator.advance(5.0, np.linspace(0.0, 5.0, GRID_POINTS))
    assert np.array_equal(result.state, states)
    assert [event._replace(state=()) for event in result.events] == integrator.events
    assert result.status is Status.DONE
    assert not result.sampled
    assert np.array_equal(result.state[0], scene.initial_state)
    assert result.work[Work.FLIGHTS] > 0 < result.work[Work.CONTACT_STEPS]


@pytest.mark.parametrize("grid", [[0.0, 2.1], [-0.1, 1.0], [1.0, 0.5], [0.0, np.nan], [0.0, np.inf], [2.0000000001]])
@pytest.mark.parametrize("sampled", [False, True])
def test_bad_grids_are_refused(grid: Any, sampled: bool) -> None:
    with pytest.raises(Refused, match="grid"):
        simulate(case_of(), grid=np.array(grid), sampled=sampled)


@pytest.mark.parametrize("grid", [[], [0.0], [2.0], [0.0, 0.0, 2.0, 2.0], [0.4307053966231132]])
@pytest.mark.parametrize("sampled", [False, True])
def test_small_grids(grid: Any, sampled: bool) -> None:
    result = simulate(case_of(), grid=np.array(grid), sampled=sampled)
    assert result.state.shape == (len(grid), 6)
    assert result.command.shape == (len(grid), 2)
    assert len(result.events) > 2
    if len(grid) and grid[-1] == 2.0:
        assert np.array_equal(result.state[-1], simulate(case_of(), sampled=sampled).state[-1])


def test_commands_follow_4_and_5() -> None:
    scene = case_of("case_09")
    result = simulate(scene)
    assert result.command[:, 0] == pytest.approx(-50.0 * result.state[:, 0] - 0.5 * result.state[:, 1])
    assert result.command[:, 1] == pytest.approx(-50.0 * result.state[:, 4] - 0.5 * result.state[:, 5])


@pytest.mark.parametrize(
    ("reports", "settings"),
    [(5, {"sampled": True}), (5, {}), (5, {"method": "rk4"}), (5, {"method": "paper"}),
     (5, {"method": "discrete_gradient"}), (5, {"method": "rk45"}), (5, {"method": "rk45_events"})],
)
def test_progress_is_reported(monkeypatch: pytest.MonkeyPatch, reports: int, settings: dict[str, Any]) -> None:
    monkeypatch.setattr("grasp_ros.exact.integrator.BREATH", 20)  # of some 400
    monkeypatch.setattr("grasp_ros.methods.equations.PIECE", 2**14)  # of 100,000 steps
    seen: list[float] = []
    simulate(case_of(duration=10.0), progress=seen.append, **settings)
    assert seen == sorted(seen)
    assert len(seen) >= reports
    assert seen[-1] == 10.0


def test_no_end_is_reported_that_is_not_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grasp_ros.exact.integrator.BREATH", 20)
    seen: list[float] = []
    run = simulate(case_of(duration=10.0), progress=seen.append, max_work=100)
    assert run.status is Status.WORK_BUDGET
    assert 0.0 < seen[-1] < 10.0


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("name", ["case_01", "case_04"])
def test_file_holds_everything(tmp_path: Path, name: str, sampled: bool) -> None:
    result = simulate(case_of(name, 3.0), sampled=sampled)
    path = tmp_path / "run.npz"
    result.save(path)
    with np.load(path, allow_pickle=False) as data:
        level = result.energy
        assert np.array_equal(data["t"], result.t)
        assert np.array_equal(data["state"], result.state)
        assert np.array_equal(data["command"], result.command)
        assert np.array_equal(data["inputs"], result.inputs, equal_nan=True)
        for key, values in zip(("V", "V_c", "V_rate", "mode"), level, strict=True):
            assert np.array_equal(data[key], values)
        for side, word in ((LEFT, "left"), (RIGHT, "right")):
            assert np.array_equal(data[f"touch_{word}"], result.times(Transition.TOUCH, side))
            assert np.array_equal(data[f"release_{word}"], result.times(Transition.RELEASE, side))
            assert len(data[f"touch_{word}"]) >= 2
        assert data["events"].shape == (len(result.events), 5)
        assert dict(zip(data["work_names"].tolist(), data["work"].tolist(), strict=True)) == {
            entry.name.lower(): result.work[entry] for entry in Work
        }
        assert str(data["status"]) == "DONE"
        assert bool(data["sampled"]) is sampled
        assert scenes.parse(str(data["scene"]), name, "x").values == result.scene.values
    assert load(path) == result


@pytest.mark.parametrize(("name", "seconds", "grid", "rests"), [
    ("case_01", 0.1, [], False), ("preload", 100.0, None, True),
])
def test_file_of_a_run_without_events_or_with_a_rest(
    tmp_path: Path, name: str, seconds: float, grid: Any, rests: bool
) -> None:
    result = simulate(horizon(name, seconds), grid=grid)
    result.save(tmp_path / "run.npz")
    again = load(tmp_path / "run.npz")
    assert again == result
    assert (again.events == [], again.at_rest is not None) == (not rests, rests)


def test_the_name_of_a_scene_is_no_scene() -> None:
    for door in (simulate, partial(ensemble, changes={})):
        with pytest.raises(Refused, match=r"scene: str is not allowed; allowed: a Scene, see load\('case_01'\)"):
            door("case_01")  # type: ignore[operator]

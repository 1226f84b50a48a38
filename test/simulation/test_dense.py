"""Dense output: a run at any time is the run with that output time, bit for bit."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import case_of

from grasp_ros import scene
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, Transition
from grasp_ros.simulation import ensemble, load, simulate
from grasp_ros.simulation.quantities import summary

TIMES = np.array([1.7, 0.0, 0.43070539, 2.0, 0.43070539, 1.23456789])
RUNS = {
    "continuous": ("case_01", {}), "sampled": ("case_01", {"sampled": True}), "delay": ("delay", {}),
    "pushed": ("sine", {}), "noise": ("noise", {}), "one arm": ("hammer", {}),
    "another method": ("case_01", {"method": "rk4_events", "setting": 1e-3}),
    "own controller": ("case_01", {"controllers": {"left": lambda tick, time, x, v: -5.0 * x - 0.5 * v}}),
    "changes": ("case_01", {"sampled": True, "changes": {700: {"left_feedback.position_gain_N_per_m": 50.0}}}),
}


@pytest.mark.parametrize("kind", RUNS)
def test_states_at_any_time_are_those_of_a_run_with_these_output_times(kind: str) -> None:
    name, how = RUNS[kind]
    case: Any = scene.load(name, ["time.duration_s=2"])
    run = simulate(case, **how)
    order = np.sort(TIMES)
    expected = simulate(case, grid=order, **how).state[np.searchsorted(order, TIMES)]
    assert run.at(TIMES).tobytes() == expected.tobytes()
    assert run.at(TIMES.reshape(2, 3)).shape == (2, 3, 6)
    assert run.at(1.7).tobytes() == expected[0].tobytes()
    assert run.at([]).shape == (0, 6)


@pytest.mark.parametrize("times", [np.timedelta64(1500, "ms"), [np.timedelta64(1500, "ms")], (t for t in (1.5,))])
def test_times_may_be_lengths_of_time(times: Any) -> None:
    assert np.ravel(simulate(case_of()).at(times)).tolist() == simulate(case_of(), grid=1.5).state[0].tolist()


@pytest.mark.parametrize("times", ["1.5", None, True, [[0.0], [0.0, 1.0]], 1j])
def test_what_is_no_time_is_refused(times: Any) -> None:
    with pytest.raises(Refused, match=r"^t: .*; allowed: numbers \(n,\)"):
        simulate(case_of()).at(times)


@pytest.mark.parametrize(("kind", "side"), [("touch", LEFT), (Transition.TOUCH, "left"), (9, LEFT)])
def test_what_is_no_kind_or_side_is_refused(kind: Any, side: Any) -> None:
    with pytest.raises(Refused, match=r"allowed: (Transition\.TOUCH|Body\.LEFT), "):
        simulate(case_of()).times(kind, side)


def test_records_are_equal_whose_content_is(tmp_path: Path) -> None:
    run = simulate(case_of(), sensitivity=["object.mass_kg"])
    table = ensemble(run.scene, {"object.mass_kg": [1.0, -1.0]}, ["touches"])
    for record in (run, run.scene, table):
        again = copy.deepcopy(record)
        assert again == record
        assert {again} == {record}
    other = simulate(case_of(), max_events=3)
    assert run != other
    other.save(tmp_path / "run.npz")
    assert load(tmp_path / "run.npz") == other
    assert table != ensemble(run.scene, {"object.mass_kg": [1.0, 1.0]}, ["touches"])


def test_a_run_from_a_file_is_as_dense(tmp_path: Path) -> None:
    run = simulate(case_of(), grid=np.linspace(0.0, 2.0, 7))
    run.save(tmp_path / "run.npz")
    again = load(tmp_path / "run.npz")
    assert again.at(TIMES).tobytes() == run.at(TIMES).tobytes()
    assert again.events == run.events
    assert again.impacts.tobytes() == run.impacts.tobytes()
    with np.load(tmp_path / "run.npz") as data:
        assert data["impacts"].tobytes() == run.impacts.tobytes()


def test_events_have_the_state_at_their_time() -> None:
    run = simulate(case_of())
    assert len(run.events) > 4
    for event in run.events:
        assert event.state == tuple(run.at(event.time).tolist())
        x_l, v_l, x_o, v_o, x_r, v_r = event.state
        u, d = (x_l - x_o, v_l - v_o) if event.side == 0 else (x_o - x_r, v_o - v_r)
        assert u == pytest.approx(event.u, abs=1e-14)
        assert d == pytest.approx(event.u_rate, abs=1e-12)


def test_a_run_that_stopped_is_dense_up_to_where_it_came() -> None:
    run = simulate(case_of(), max_events=3)
    end = run.events[-1].time
    assert run.at(end).tobytes() == simulate(case_of()).at(end).tobytes()
    with pytest.raises(Refused, match=r"time 1\.99 is not allowed; allowed: 0 to "):
        run.at(1.99)


@pytest.mark.parametrize("method", ["rk45", "rk45_events", "lsoda_events", "radau_events", "dop853"])
def test_a_solver_of_scipy_gives_each_output_for_itself(method: str) -> None:
    run = simulate(scene.load("case_01", ["time.duration_s=4"]), method=method, setting=1e-9)
    assert run.at(np.linspace(0.0, 4.0, 1001)).shape == (1001, 6)
    assert "lost_J" in summary(run)


def test_what_cannot_be_repeated_is_refused() -> None:
    for how in ({"controllers": {"left": lambda *_: 0.1}},
                {"sampled": True, "changes": {500: {"left_feedback.position_gain_N_per_m": 50.0}}}):
        with pytest.raises(Refused, match="its controllers cannot be asked"):
            simulate(case_of(), grid=[0.0, 2.0], **how).at(1.0)
    for time in (-1e-9, 2.1, np.nan):
        with pytest.raises(Refused, match=r"allowed: 0 to 2\.0 s"):
            simulate(case_of()).at([1.0, time])

"""The contract of `grasp_ros.methods`, by its numbers: every method is held to all of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from documents import horizon, scene_of
from oracles import flight_array

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.contract import ACCURACY_KNOB, STEP, TOLERANCE, Problem, Solution
from grasp_ros.methods.registry import EXACT, METHODS, check
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.simulation import simulate

COARSE = {STEP: 0.1, TOLERANCE: 1e-6, ACCURACY_KNOB: 1e-16}  # steps in which a pair changes more than once
TIMES = np.array([0.0, 0.1, 0.3, 0.3, 0.5123, 1.0, 1.5])


def ask(name: str, grid: Any = TIMES, seconds: float = 1.5, **options: Any) -> Solution:
    """Case 1 over some contacts, from a start that is not symmetric."""
    method, scene = METHODS[name], horizon("case_01", seconds, "left_arm.position_m=-0.25")
    return method.solve(Problem(scene.system, scene.duration, np.array(grid), COARSE[method.knob], **options))


def steps_of(name: str, solution: Solution) -> list[int]:
    """Counters that output times must not touch."""
    counters = METHODS[name].counters
    return [int(solution.work[entry]) for entry in counters if entry.name in ("STEPS", "FLIGHTS", "CONTACT_STEPS")]


@pytest.mark.parametrize("name", METHODS)
def test_1_and_2_a_problem_is_only_read_and_its_solution_is_new(name: str) -> None:
    scene, method = horizon("case_01", 1.0), METHODS[name]
    arrays = (scene.system.bodies, scene.system.pairs, scene.system.state, np.array([0.2, 1.0]))
    before = [array.tobytes() for array in arrays]
    problem = Problem(scene.system, scene.duration, arrays[-1], COARSE[method.knob])
    first = method.solve(problem)
    assert [array.tobytes() for array in arrays] == before
    kept = [array.tobytes() for array in first[:3]]
    for array in first[:3]:
        array[:] = 0
    again = method.solve(problem)
    assert [array.tobytes() for array in again[:3]] == kept
    assert (again.state.shape, again.state.dtype) == ((2, 6), np.float64)
    assert (again.status, again.stop) == (Status.DONE, "")


@pytest.mark.parametrize("name", METHODS)
def test_3_no_state_and_no_event_depends_on_the_other_output_times(name: str) -> None:
    whole = ask(name)
    assert whole.state[0].tolist() == [-0.25, 0.0, 0.0, 0.0, 0.5, 0.0]
    for grid in ([], TIMES, TIMES[4:5], TIMES[2:4], np.linspace(0.01, 1.49, 33)):
        other = ask(name, grid)
        assert other.state.shape == (len(grid), 6)
        assert other.event_table.tobytes() == whole.event_table.tobytes()
        assert steps_of(name, other) == steps_of(name, whole)
        for row, time in enumerate(grid):
            for place in np.flatnonzero(time == TIMES):
                assert other.state[row].tobytes() == whole.state[place].tobytes()


@pytest.mark.parametrize("name", METHODS)
def test_4_events_ascend_or_are_none(name: str) -> None:
    table = ask(name).event_table
    assert table.shape[1] == 5
    assert (np.diff(table[:, 0]) >= 0.0).all()
    both = {(side, kind) for side in (LEFT, RIGHT) for kind in (Transition.TOUCH, Transition.RELEASE)}
    assert {(side, kind) for side, kind in table[:, 1:3].tolist()} == (both if METHODS[name].events else set())


@pytest.mark.parametrize("name", METHODS)
def test_5_a_budget_of_events_ends_a_run_with_its_status(name: str) -> None:
    times = np.linspace(0.0, 3.0, 601)
    whole = ask(name, times, 3.0)
    total = len(whole.event_table)
    for budget in range(total + 2):
        cut = ask(name, times, 3.0, max_events=budget)
        assert cut.status is (Status.EVENT_BUDGET if budget < total else whole.status)
        assert cut.event_table.tobytes() == whole.event_table[: len(cut.event_table)].tobytes()
        assert cut.state.tobytes() == whole.state[: len(cut.state)].tobytes()
        if budget < total:
            beyond = whole.event_table[budget, 0]
            assert len(cut.event_table) >= budget
            assert (cut.event_table[budget:, 0] == beyond).all()
            assert np.searchsorted(times, beyond, side="right") >= len(cut.state)


@pytest.mark.parametrize("name", [name for name in METHODS if METHODS[name].work_budget])
def test_5_a_budget_of_work_ends_a_run_with_its_status(name: str) -> None:
    whole, cut = ask(name), ask(name, max_work=20)
    assert cut.status is Status.WORK_BUDGET
    assert cut.stop.startswith(cut.status.value)
    assert len(cut.state) < len(whole.state)
    assert cut.state.tobytes() == whole.state[: len(cut.state)].tobytes()


@pytest.mark.parametrize("name", METHODS)
def test_6_counters_are_whole_numbers_with_names(name: str) -> None:
    work = ask(name).work
    assert np.issubdtype(work.dtype, np.integer)
    assert work.shape == (len(METHODS[name].counters),)
    assert work.sum() > 0


@pytest.mark.parametrize("name", METHODS)
def test_7_and_9_settings_are_in_their_range_or_refused(name: str) -> None:
    method, scene = METHODS[name], horizon("case_01", 2.0)
    assert check(name, scene, None) == method.default
    assert [check(name, scene, setting) for setting in method.ladder] == list(method.ladder)
    assert list(method.ladder) == sorted(method.ladder, reverse=True)
    for setting in (0.0, -1.0, math.nan, math.inf, 1e-30):
        with pytest.raises(Refused, match=f"^{name}: {method.knob} {setting!r} is not allowed; allowed: "):
            simulate(scene, method=name, setting=setting)


@pytest.mark.parametrize("name", METHODS)
def test_8_and_9_what_a_method_does_not_declare_is_refused(name: str) -> None:
    method, scene = METHODS[name], horizon("case_01", 0.02)
    offset = scenes.load("preload").changed({"time.duration_s": 0.02})
    pushed = scenes.load("pulse").changed({"time.duration_s": 0.02, "object_pulse.start_s": 0.01})
    for able, asked, options in (
        (method.sampled, scene, {"sampled": True}), (method.effects, pushed, {}), (method.effects, offset, {}),
        (method.work_budget, scene, {"max_work": 10**6}),
    ):
        if able:
            assert simulate(asked, method=name, **options).status is Status.DONE
        else:
            with pytest.raises(Refused, match=f"{name}.*allowed.*: {EXACT}$"):
                simulate(asked, method=name, **options)


@pytest.mark.parametrize(
    ("sections", "words"),
    [(("left_feedback", "right_feedback"), "lacks left_feedback, right_feedback"), (("object", "left_contact",
      "right_contact"), "lacks left_contact, object, right_contact")],
)
def test_9_the_refusal_names_what_is_lacking(sections: tuple[str, ...], words: str) -> None:
    with pytest.raises(Refused, match=rf"dop853: case_01 {words}; it supports only the paper's grasp"):
        check("dop853", scene_of("case_01", without=sections), None)
    with pytest.raises(Refused, match=r"dop853: everything has .*left_sensor.*; it supports"):
        check("dop853", scenes.load("everything"), None)


@pytest.mark.parametrize("name", [name for name in METHODS if METHODS[name].sampled])
def test_8_a_drive_gets_an_integrator_and_gives_the_states(name: str) -> None:
    """Nobody sets an input: with the controllers in the drive the arms swing by themselves."""
    scene, times = scenes.load("no_contact", ["time.duration_s=1"]), np.linspace(0.0, 1.0, 11)
    problem = Problem(
        scene.system, 1.0, times, METHODS[name].default, drive=lambda integrator: integrator.advance(1.0, times)
    )
    x, v = scene.initial_state[:2]
    for sampled, stiffness, damping in ((False, 15.0, 0.7), (True, 10.0, 0.2)):
        found = METHODS[name].solve(problem._replace(sampled=sampled))
        exact = flight_array((1.0, stiffness, damping, 0.0), x, v, times)
        assert np.abs(found.state[:, :2] - np.array(exact).T).max() < 1e-14

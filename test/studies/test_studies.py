"""The studies: failures stay visible, runs resume, limits are exact, advice follows from measurements."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import grasp
from oracles import FREE, energy, flight

from grasp_ros import scene as scenes
from grasp_ros.physics import sampled
from grasp_ros.physics.model import Arm
from grasp_ros.studies import accuracy, adviser, drift, figures, measure, predictability, stability
from grasp_ros.studies.contenders import own_contenders
from grasp_ros.studies.measure import Truth
from grasp_ros.studies.peers import Answer, Contender
from grasp_ros.studies.records import Journal, Record, to_record

STANDARD = Arm(1.0, 10.0, 0.2, 5.0, 0.5)
STRONG = Arm(1.0, 10.0, 0.2, 50.0, 5.0)
HEAVY = Arm(1.0, 1.0, 9.0, 0.0, 0.0)  # over-damped
SHORT = "time.duration_s=2"
QUICK = measure.QUICK._replace(stride=1)


def contender(name: str, *ladder: float) -> Contender:
    return next(c for c in own_contenders() if c.name == name)._replace(ladder=ladder)


def record(method: str, error: float | None, seconds: float | None, **other: Any) -> Record:
    values: dict[str, Any] = {
        "scene": "s", "family": "f", "method": method, "knob": "tolerance", "setting": 1e-6, "error": error,
        "seconds": seconds, "least": seconds, "repeats": 3, "first": 1.0, "steps": 10, "right_hand_sides": 60,
        "found": (3, 2), "there_are": (3, 2), "status": "done",
    }
    return Record(**{**values, **other})


# Measuring.


def test_error_contacts_and_work_are_measured_not_believed(tmp_path: Path) -> None:
    scene = scenes.load("case_01", [SHORT])
    target = measure.truth(scene, Journal(tmp_path))
    exact, _ = measure.attempt(contender("exact", 1e-16), scene, 1e-16, target, QUICK)
    coarse, _ = measure.attempt(contender("paper", 1e-3), scene, 1e-3, target, QUICK)
    assert exact.error is not None
    assert coarse.error is not None
    assert exact.error < 1e-13 < 1e-6 < coarse.error
    assert exact.found == exact.there_are == target.touches
    assert (coarse.steps, coarse.right_hand_sides) == (2000 + 2 * sum(target.touches), 8000 + 8 * sum(target.touches))
    assert coarse.seconds is not None
    assert coarse.first > coarse.time > 0.0
    assert coarse.repeats >= 1
    again = measure.truth(scene, Journal(tmp_path))
    assert (again.state == target.state).all()


def test_missed_contacts_are_counted_on_both_sides() -> None:
    assert record("a", 0.1, 1.0, found=(5, 0)).missed == 4
    assert record("a", 0.1, 1.0).missed == 0
    assert record("a", 0.1, 1.0, found=None).missed is None


def test_a_method_that_misses_contacts_is_shown_with_its_count(tmp_path: Path) -> None:
    case = scenes.load("case_02")
    records = accuracy.run([case], tmp_path, QUICK, [contender("dop853_events", 1e-5, 1e-4)])
    wrong, stalled = records
    assert wrong.status == "done"
    assert wrong.missed is not None
    assert wrong.missed > 0
    assert stalled.error is None
    assert stalled.status.startswith("stopped: a search for the next event does not end")
    text = accuracy.report(records)
    assert "2/2" in text
    assert "stopped: a search" in text
    rows = list(csv.DictReader((tmp_path / "records.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["missed"] for row in rows] == [str(wrong.missed), str(stalled.missed)]
    figures.work_precision(records, accuracy.METRIC, tmp_path / "a.png")
    figures.contacts_missed(records, tmp_path / "b.png")


def test_a_solver_that_is_missing_or_too_slow_is_a_record(tmp_path: Path) -> None:
    scene = scenes.load("case_01", [SHORT])
    target = Truth(np.array([0.0, 2.0]), np.zeros((2, 6)), (0, 0))

    def absent(*_: Any) -> Any:
        raise ImportError("no such solver")

    def endless(*_: Any) -> Any:
        while True:
            pass

    missing, none = measure.attempt(Contender("x", "x", "tolerance", (1.0,), absent), scene, 1.0, target, QUICK)
    assert (missing.status, missing.error, none) == ("not installed", None, None)
    effort = QUICK._replace(deadline=0.05)
    slow, _ = measure.attempt(Contender("x", "x", "tolerance", (1.0,), endless), scene, 1.0, target, effort)
    assert slow.status == "stopped: longer than 0.05 s"
    assert measure.given_up(slow, effort)


def test_a_study_resumes_and_survives_a_line_cut_short(tmp_path: Path) -> None:
    scene = scenes.load("case_01", [SHORT])
    calls = []

    def build(scene: scenes.Scene, setting: float) -> Any:
        def solve(grid: Any) -> Answer:
            calls.append(setting)
            return Answer(np.zeros((len(grid), 6)), None, "done", None, None)

        return solve

    solver = Contender("grasp_ros", "paper", "step", (1.0, 0.5, 0.25), build)
    first = accuracy.run([scene], tmp_path, QUICK, [solver._replace(ladder=(1.0, 0.5))])
    assert set(calls) == {1.0, 0.5}
    path = tmp_path / "journal.jsonl"
    with path.open("a") as file:
        file.write('{"key": "half a li')
    calls.clear()
    second = accuracy.run([scene], tmp_path, QUICK, [solver])
    assert set(calls) == {0.25}
    assert second[:2] == first
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert len(lines) == 3
    assert to_record(lines[-1]["value"]) == second[2]


def test_a_ladder_ends_where_a_run_takes_too_long(tmp_path: Path) -> None:
    scene = scenes.load("case_01", [SHORT])
    effort = QUICK._replace(patience=0.0)
    records = accuracy.run([scene], tmp_path, effort, [contender("rk4", 1e-2, 1e-3, 1e-4)])
    assert [r.setting for r in records] == [1e-2]


def test_scenes_that_the_peers_do_not_know_are_refused(tmp_path: Path) -> None:
    peer = Contender("x", "x", "tolerance", (), lambda *_: pytest.fail("not to be built"))
    with pytest.raises(ValueError, match="starts in contact"):
        accuracy.run([scenes.load("case_01", ["left_arm.position_m=0.1"])], tmp_path, QUICK, [peer])


# Choosing.


def test_frontier_holds_what_nobody_beats() -> None:
    records = [record("a", 1e-3, 1.0), record("b", 1e-2, 2.0), record("c", 1e-6, 3.0), record("d", None, None)]
    assert [r.method for r in accuracy.frontier(records)] == ["a", "c"]
    fastest = accuracy.fastest(records, 1e-5)
    assert fastest is not None
    assert fastest.method == "c"
    assert accuracy.fastest(records, 1e-9) is None


def test_advice_is_the_fastest_sound_run_within_the_error() -> None:
    lucky = record("lucky", 1e-9, 0.1, found=(2, 2))
    cut = record("cut", 1e-9, 0.1, status="stopped: something")
    good, slow = record("good", 1e-7, 1.0), record("slow", 1e-10, 5.0)
    advice = adviser.advise([lucky, cut, slow, good], error=1e-6)
    assert advice.choice is good
    assert advice.others == [slow]
    nobody = adviser.advise([slow, good], error=1e-12)
    assert nobody.choice is None
    assert nobody.limit is slow


def test_advice_within_a_budget_is_the_most_accurate() -> None:
    good, slow = record("good", 1e-7, 1.0), record("slow", 1e-10, 5.0)
    assert adviser.advise([slow, good], budget=2.0).choice is good
    assert adviser.advise([slow, good], budget=9.0).choice is slow
    none = adviser.advise([slow, good], budget=0.5)
    assert none.choice is None
    assert none.limit is good


@pytest.mark.parametrize("wish", [{}, {"error": 1.0, "budget": 1.0}, {"error": 0.0}, {"budget": math.nan}])
def test_advice_needs_one_positive_wish(wish: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="allowed: exactly one of them, a number > 0"):
        adviser.advise([record("a", 1.0, 1.0)], **wish)


# Energy, prediction.


def test_energy_drift_tells_the_methods_apart(tmp_path: Path) -> None:
    chosen = {"exact": 1e-16, "discrete_gradient": 1e-3, "rk4": 1e-3, "paper": 1e-3}
    rows = {row.method: row for row in drift.run(tmp_path, 40.0, chosen)}
    assert rows["exact"].worst < 1e-13
    assert rows["discrete_gradient"].worst < 1e-12
    assert rows["rk4"].worst > 1e-8
    assert rows["paper"].worst > 1e-4
    assert rows["exact"].t[-1] == 40.0
    assert drift.run(tmp_path, 40.0, {"paper": 1e-3}) == [rows["paper"]]
    figures.energy_drift(list(rows.values()), tmp_path / "drift.png")


def test_discrete_gradient_does_not_drift_with_the_roundings_of_its_matrix(tmp_path: Path) -> None:
    """A million steps: a damper of one rounding would show as 1e-11."""
    row = drift.run(tmp_path, 1000.0, {"discrete_gradient": 1e-3})[0]
    assert row.worst < 3e-12


def test_what_a_scene_can_hold() -> None:
    """design.md: case 1 amplifies by some 4e2 in 20 s, case 3 by 7e6."""
    tame, wild = predictability.run([scenes.load("case_01"), scenes.load("case_03")], 60.0)
    assert 1e2 < tame.growth < 1e4
    assert 1e6 < wild.growth < 1e8
    assert tame.until(1e-9) is None
    first, last = wild.until(1e-9), wild.until(1e-3)
    assert first is not None
    assert last is not None
    assert 10.0 < first < last < 60.0
    assert (np.diff(wild.distance) >= 0.0).all()


# Stability of the sampled loop: oracles.md, "Sampled control".


@pytest.mark.parametrize(
    ("arm", "delay", "limit"),
    [(STANDARD, 0, 0.275056637414546), (STANDARD, 1, 0.0887780231816513), (STRONG, 0, 0.2027695528985455)],
)
def test_largest_stable_period(arm: Arm, delay: int, limit: float) -> None:
    assert stability.first_limit(arm, delay) == pytest.approx(limit, rel=1e-9)


def test_stability_returns_in_an_island() -> None:
    radii = [sampled.spectral_radius(STANDARD, h, 0) for h in (1.6, 1.7, 2.6, 2.7)]
    assert [radius < 1.0 for radius in radii] == [False, True, True, False]


@pytest.mark.parametrize("arm", [STANDARD, FREE, Arm(2.0, 0.0, 3.0, 1.0, 1.0), Arm(1.0, 9.0, 6.0, 1.0, 1.0), HEAVY])
def test_flow_under_a_held_command(arm: Arm) -> None:
    """Against the matrix exponential: under-, over- and critically damped arms, without spring, without anything."""
    flow = sampled.held_flow(arm, np.array([0.3]))[0]
    body = (arm.mass, arm.stiffness, arm.damping)
    for column, (x, v, force) in enumerate(np.eye(3)):
        expected = [float(value) for value in flight((*body, force), x, v, 0.3)]
        assert flow[:, column] == pytest.approx(expected, abs=1e-14)


def test_without_feedback_there_is_no_limit() -> None:
    assert stability.first_limit(Arm(1.0, 10.0, 0.2, 0.0, 0.0), 1) == math.inf
    assert stability.limits(Arm(1.0, 10.0, 0.2, 0.0, 0.0), (0,))[0].checks == ()


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_simulation_grows_as_the_spectral_radius_says(delay: int) -> None:
    limit = stability.first_limit(STANDARD, delay)
    for factor, stable in ((0.9, True), (1.1, False)):
        radius = sampled.spectral_radius(STANDARD, factor * limit, delay)
        growth = stability.simulated_growth(STANDARD, factor * limit, delay, 1600)
        assert (growth < 1.0) is stable
        assert growth == pytest.approx(radius, abs=3e-4)


def test_continuous_feedback_is_the_limit_of_short_periods() -> None:
    """Growth over 1 s tends to exp(-C / 2 m)."""
    for delay in (0, 1):
        assert sampled.spectral_radius(STANDARD, 1e-4, delay) ** 1e4 == pytest.approx(math.exp(-0.35), rel=2e-3)


# The commands.


def test_accuracy_quick_writes_records_and_figures(tmp_path: Path) -> None:
    result = grasp("study", "accuracy", "case_01", "--set", SHORT, "--quick", "-o", "out", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert {"journal.jsonl", "records.csv", "error_against_time.png", "contacts_missed.png"} <= {
        path.name for path in (tmp_path / "out").iterdir()
    }
    assert "discrete_gradient" in result.stdout
    assert "largest absolute error over six states" in result.stdout


def test_page_quick_has_all_sections_and_figures(tmp_path: Path) -> None:
    result = grasp("study", "page", "--quick", "--docs", "docs", "-o", "journal", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    text = (tmp_path / "docs" / "accuracy.md").read_text()
    for title in ("Which method", "What the paper's method costs", "Energy in the elastic case", "over topics",
                  "Where the time goes", "How many times as long others take"):
        assert title in text
    shown = [part.split(")")[0] for part in text.split("](accuracy/")[1:]]
    assert len(shown) == 7
    assert all((tmp_path / "docs" / "accuracy" / name).stat().st_size > 1000 for name in shown)
    assert "275.0566374 ms" in text


def test_advise_answers_with_a_command(tmp_path: Path) -> None:
    wish = ("study", "advise", "case_01", "--set", "time.duration_s=0.5", "--quick", "-o", "out")
    result = grasp(*wish, "--error", "1e-6", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert "\nthat is: grasp simulate case_01 --method " in result.stdout
    too_much = grasp(*wish, "--error", "1e-30", cwd=tmp_path)
    assert too_much.returncode == 1
    assert "no method reaches it; closest: " in too_much.stdout
    neither = grasp(*wish, cwd=tmp_path)
    assert neither.returncode == 2
    assert "--error, --budget: allowed: exactly one of them" in neither.stderr


def test_elastic_scene_is_case_2_for_longer() -> None:
    long = drift.elastic(100.0)
    assert long.duration == 100.0
    assert energy(long.grasp, long.initial_state).V_c == pytest.approx(5.1)

"""Numbers of a scene that are chosen for an outcome."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import grasp_ros as gr
from grasp_ros.maps.plan import Axis
from grasp_ros.optimization.search import DesignProblem, front, read_bound
from grasp_ros.simulation.quantities import summary

BOTH_KV = "left_feedback.velocity_gain_Ns_per_m+right_feedback.velocity_gain_Ns_per_m"
BOTH_KP = "left_feedback.position_gain_N_per_m+right_feedback.position_gain_N_per_m"
CRITICAL = 2.0 * math.sqrt(15.0) - 1.0  # of an arm of Table 1 alone: 2 sqrt(K m) - c


@pytest.mark.thorough
def test_every_start_finds_the_gain_beside_critical_damping() -> None:
    scene = gr.load("case_01")
    found = [gr.design(scene, {BOTH_KV: (0.5, 30.0)}, "settling_time", seed=seed) for seed in range(10)]
    gains = np.array([list(own.numbers.values()) for own in found])
    assert np.ptp(gains) < 1e-6
    assert 0.7 * CRITICAL < gains[0, 0] < CRITICAL
    least = gr.ensemble(scene, {key: np.linspace(0.5, 30.0, 2001) for key in BOTH_KV.split("+")}, ["settling_time"])
    assert found[0].outcomes["settling_time"] <= np.nanmin(least.columns["settling_time"])


@pytest.mark.slow
def test_outcomes_are_those_of_a_simulation_and_bounds_are_kept() -> None:
    scene = gr.load("case_01")
    found = gr.design(scene, {BOTH_KV: (0.5, 30.0), BOTH_KP: (1.0, 100.0)}, "settling_time", {"peak_input": 10.0})
    told = summary(gr.simulate(found.scene))
    assert found.outcomes["settling_time"] == max(told["settled_s"].values())
    assert found.outcomes["peak_input"] <= 10.0
    assert found.numbers["left_feedback.position_gain_N_per_m"] == pytest.approx(20.0, rel=1e-6)  # 10 N at 0.5 m
    with pytest.raises(AttributeError):
        found.runs = 1  # type: ignore[misc]


def test_a_search_does_not_end_where_many_choices_are_alike() -> None:
    """Of most gains nothing touches, and the object stays."""
    bounds = {"touches": 2.0}
    found = [gr.design(gr.load("case_01", ["time.duration_s=3"]), {BOTH_KV: (0.5, 30.0)}, "x_object_end", bounds,
                       seed=seed).outcomes["x_object_end"] for seed in range(3)]
    assert max(found) == pytest.approx(-0.00097076, rel=1e-4)


@pytest.mark.parametrize("most", [30.0, 300.0])
def test_an_outcome_that_a_small_part_of_a_range_has_is_found_by_every_seed(most: float) -> None:
    """Gains from 4.97 to 6.11."""
    scene = gr.load("case_01", ["time.duration_s=1"])
    found = [gr.design(scene, {BOTH_KV: (0.5, most)}, "last_outside", seed=seed) for seed in range(4)]
    gains = np.linspace(4.9, 5.1, 2001)
    least = gr.ensemble(scene, dict.fromkeys(BOTH_KV.split("+"), gains), ["last_outside"])
    assert max(own.outcomes["last_outside"] for own in found) <= np.nanmin(least.columns["last_outside"])


def test_a_choice_at_the_end_of_a_range_is_found_there() -> None:
    found = gr.design(gr.load("case_01", ["time.duration_s=3"]), {"left_feedback.velocity_gain_Ns_per_m": (0.5, 10.0)},
                      "peak_impact_left", {"peak_input_left": 2.0})
    assert [*found.numbers.values()] == [0.5]


def test_a_body_that_is_not_there_has_no_part_in_a_group() -> None:
    scene = gr.load("arm_alone").changed({"left_feedback.set_point_m": 0.0})
    gain = {"left_feedback.velocity_gain_Ns_per_m": (0.5, 20.0)}
    alone, group = (gr.design(scene, gain, name) for name in ("settling_time", "settling_times"))
    assert group.outcomes["settling_times"] == pytest.approx(alone.outcomes["settling_time"], rel=1e-9)


@pytest.mark.slow
def test_no_choice_along_two_outcomes_is_better_in_both(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grasp_ros.optimization.search.FRONT", 4)
    scene = gr.load("case_01", ["left_feedback.velocity_gain_Ns_per_m=7", "right_feedback.velocity_gain_Ns_per_m=7"])
    problem = DesignProblem(scene, [Axis(BOTH_KP, 1.0, 40.0)], ["settling_time", "peak_input"])
    choices = front(problem)
    times, inputs = ([own.outcomes[name] for own in choices] for name in problem.minimise)
    assert len(choices) >= 3
    assert times == sorted(times)
    assert inputs == sorted(inputs, reverse=True)


@pytest.mark.slow
def test_a_bound_that_no_choice_keeps_costs_the_front_one_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the smallest forces are, the masses do not come to stay within the horizon."""
    monkeypatch.setattr("grasp_ros.optimization.search.FRONT", 4)
    scene = gr.load("case_01", ["time.duration_s=3"])
    outcomes = ["last_outside", "peak_input"]
    for names in (outcomes, outcomes[::-1]):
        choices = front(DesignProblem(scene, [Axis(BOTH_KV, 0.5, 30.0)], names))
        finite = [np.isfinite(own.outcomes["last_outside"]) for own in choices]
        assert sorted(finite) == [False, *[True] * (len(choices) - 1)]
        assert len(choices) >= 3


@pytest.mark.parametrize(("free", "minimise", "bounds", "words"), [
    ({"left_arm.weight_kg": (1.0, 2.0)}, "settling_time", {}, "left_arm.weight_kg"),
    ({"left_arm.mass_kg": (-1.0, 2.0)}, "settling_time", {}, "-1.0 is not allowed"),
    ({BOTH_KV: (1.0, 2.0)}, "beauty", {}, "outcome beauty: not known"),
    ({BOTH_KV: (1.0, 2.0)}, "extremes", {}, "has several units; allowed: one of x_left_min"),
    ({BOTH_KV: (1.0, 2.0)}, "settling_time", {"beauty": 1.0}, "outcome beauty: not known"),
    ({BOTH_KV: (1.0, 2.0)}, "settling_time", {"peak_input": 1e-3},
     r"none of .* with peak_input <= 0.001; the nearest has settling_time [\d.]+, peak_input 2\.5$"),
    ({"right_contact.dissipation_s_per_m": (0.1, 0.2)}, "peak_input_left", {}, r"nothing to choose: .* 1\.5 for all"),
    ({}, "settling_time", {}, "parameters to vary: none"),
    ({BOTH_KV: (2.0, 1.0)}, "settling_time", {}, "2.0 to 1.0 is not .* allowed: low < high"),
    ({BOTH_KV: ("1", 2.0)}, "settling_time", {}, "low: '1' is not allowed; allowed: a number"),
    ({BOTH_KV: 3.0}, "settling_time", {}, "3.0 is not allowed; allowed: two numbers, low and high"),
    ([BOTH_KV], "settling_time", {}, "free: .* is not allowed; allowed: a dict"),
    ({BOTH_KV: (1.0, 2.0)}, ["settling_time"], {}, "minimise: .* is not allowed; allowed: a list of texts"),
    ({BOTH_KV: (1.0, 2.0)}, "settling_time", [1.0], "subject_to: .* is not allowed; allowed: a dict"),
    ({BOTH_KV: (1.0, 2.0)}, "settling_time", {"peak_input": float("nan")}, "peak_input <= nan is not allowed"),
])
def test_what_cannot_be_designed_is_refused(free: Any, minimise: str, bounds: Any, words: str) -> None:
    with pytest.raises(gr.Refused, match=words):
        gr.design(gr.load("case_01"), free, minimise, bounds)


def test_a_bound_that_no_choice_keeps_is_named_where_the_outcome_is_missing_as_well() -> None:
    scene = gr.load("case_01", ["time.duration_s=2"])
    with pytest.raises(gr.Refused, match=r"<= 0.001; the nearest has last_outside inf, peak_input 2\.5$"):
        gr.design(scene, {BOTH_KV: (1.0, 2.0)}, "last_outside", {"peak_input": 1e-3})


def test_runs_that_are_too_short_are_named_as_the_reason() -> None:
    scene = gr.load("case_01", ["time.duration_s=0.2"])
    with pytest.raises(gr.Refused, match=r"outside the bound at the end of every run; allowed: a longer"):
        gr.design(scene, {BOTH_KV: (0.5, 30.0)}, "last_outside")


@pytest.mark.parametrize(("minimise", "bounds"), [
    ("last_outside_object", {}), ("last_outside", {"x_right_max": 1.0}),
])
def test_an_outcome_of_a_body_that_the_scene_does_not_have_is_refused(minimise: str, bounds: Any) -> None:
    with pytest.raises(gr.Refused, match=r"outcome \w+: arm_alone has no such body; allowed: outcomes of those"):
        gr.design(gr.load("arm_alone"), {"left_arm.mass_kg": (1.0, 2.0)}, minimise, bounds)


def test_a_settling_time_that_nothing_proves_is_refused_with_the_reason() -> None:
    with pytest.raises(gr.Refused, match=r"V_c may rise: commands are held .* last_outside needs no proof"):
        gr.design(gr.load("case_01", ["loop={}"]), {BOTH_KV: (1.0, 2.0)}, "settling_time")


@pytest.mark.parametrize("text", ["peak_input", "peak_input<=", "peak_input>=3", "peak_input<=1_0"])
def test_a_bound_is_written_in_one_way(text: str) -> None:
    with pytest.raises(gr.Refused):
        read_bound(text)
    assert read_bound("peak_input <= 3").most == 3.0


@pytest.mark.slow
def test_the_command_writes_a_scene_and_figures(command: Any, tmp_path: Path) -> None:
    words = ("design", "case_01", "--free", f"{BOTH_KV}=0.5:30", "--minimise", "settling_time")
    result = command(*words, "-o", "best.yaml", "--figure", "best.png")
    assert result.returncode == 0, result.stderr
    assert "settling_time" in result.stdout
    best = gr.load(tmp_path / "best.yaml")
    assert best.numbers_of("left_controller") != gr.load("case_01").numbers_of("left_controller")
    assert (tmp_path / "best.png").read_bytes().startswith(b"\x89PNG")
    again = command(*words, "--json")
    gain = best.values["left_feedback"]["velocity_gain_Ns_per_m"]
    assert json.loads(again.stdout)["choices"][0]["numbers"] == dict.fromkeys(BOTH_KV.split("+"), gain)
    both = command(*words, "--minimise", "peak_input", "--figure", "both.svg")
    assert both.returncode == 0, both.stderr
    assert command(*words, "-o", "best.yaml").returncode == 2  # is there
    assert command(*words, "--minimise", "peak_input", "-o", "no.yaml").returncode == 2
    assert "at an end" not in result.stdout
    end = command("design", "case_01", "--free", f"{BOTH_KV}=1:3", "--minimise", "peak_impact")
    assert "an end of its range" in end.stdout
    wide = "left_contact.dissipation_s_per_m=1e-3:1e7::log", "--minimise", "peak_impact_left"
    inside = command("design", "case_01", "--set", "time.duration_s=3", "--free", *wide)  # at 1.2
    assert inside.returncode == 0, inside.stderr
    assert "an end of its range" not in inside.stdout


def test_a_number_without_effect_on_the_outcome_is_named(command: Any) -> None:
    """The largest input is the one at the start, as long as the damping is small: whatever the contacts are."""
    free = "--free", "left_contact.hertz_N_per_m1_5=1e3:1e5", "--free", "left_feedback.velocity_gain_Ns_per_m=0.5:10"
    result = command("design", "case_01", "--set", "time.duration_s=3", *free, "--minimise", "peak_input")
    assert result.returncode == 0, result.stderr
    assert [line.split()[0] for line in result.stdout.splitlines() if "no effect" in line] == [
        "left_contact.hertz_N_per_m1_5"]

"""What accuracy costs: measurements, the truth they are held against, and the setting to take."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import case_of
from measurements import record

from grasp_ros import scene as scenes
from grasp_ros.accuracy.measure import (
    NOT_INSTALLED,
    QUICK,
    Answer,
    Contender,
    Truth,
    advise,
    attempt,
    compare,
    fastest,
    finest,
    own_contenders,
)
from grasp_ros.cli.accuracy import _not_here, _table
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import simulate

LAST = [-0.008512122262300985, -0.011087931065097529, -0.005641499599319586, 0.0034325068122038564,
        -0.0008363089547169395, 0.0033174261285577183]  # case 1 at 20 s, from the reference with 25 digits


def test_the_truth_knows_its_own_error() -> None:
    truth = finest(scenes.load("case_01"))
    error = np.abs(truth.state[-1] - LAST).max()
    assert error <= truth.uncertainty < 1e-11
    assert truth.touches == (22, 22)
    wild = finest(scenes.load("case_03"))
    assert wild.uncertainty > 10.0 * truth.uncertainty  # it amplifies what it is given 1e4 times as much


def test_a_truth_that_begins_at_0_is_known_to_roundings_of_its_way() -> None:
    thrown = ["left_arm.position_m=0", "left_arm.velocity_m_per_s=1", "time.duration_s=1"]
    moving = finest(scenes.load("hammer", thrown))
    assert 1e-17 < moving.uncertainty < 1e-13
    still = finest(scenes.load("case_01", ["left_arm.position_m=0", "right_arm.position_m=0", "time.duration_s=1"]))
    assert still.uncertainty == 0.0


def test_error_and_touches_are_measured_not_believed() -> None:
    scene = case_of()
    truth, (contenders, others) = finest(scene), own_contenders(scene)
    assert others == {}
    by_name = {contender.name: contender for contender in contenders}
    exact, paper = (attempt(by_name[name], scene, setting, truth, QUICK)
                    for name, setting in (("exact", 1e-16), ("paper", 1e-3)))
    assert exact.error == truth.uncertainty
    assert paper.error is not None
    assert 1e-8 < paper.error < 1e-2
    assert exact.found == exact.there_are == truth.touches
    assert exact.sound
    assert min(paper.first, paper.time) > 0.0  # where kernels are compiled already, either may be longer


def test_solvers_take_turns_within_the_time_and_leave_when_they_are_slow() -> None:
    scene, truth = case_of(), Truth(np.array([0.0, 2.0]), np.zeros((2, 6)), (0, 0), 1e-14)
    calls: list[tuple[str, float]] = []

    def solver(name: str, seconds: float) -> Contender:
        def build(_: Any, setting: float) -> Any:
            def solve(grid: Any) -> Answer:
                calls.append((name, setting))
                end = time.perf_counter() + seconds
                while time.perf_counter() < end:
                    pass
                return Answer(np.zeros((len(grid), 6)), None, "done")

            return solve

        return Contender("f", name, "step", (3.0, 2.0, 1.0), build)

    def absent(*_: Any) -> Any:
        raise ImportError("no such solver")

    slow, fast = solver("slow", 0.05), solver("fast", 0.0)
    missing = Contender("f", "missing", "step", (1.0, 0.5), absent)
    found, late = compare(scene, [slow, fast, missing], truth, QUICK._replace(patience=0.02))
    assert [(r.method, r.setting, r.status) for r in found] == [
        ("slow", 3.0, "done"), *(("fast", setting, "done") for setting in (3.0, 2.0, 1.0)),
        ("missing", 1.0, NOT_INSTALLED)]
    assert list(dict.fromkeys(calls)) == [("slow", 3.0), ("fast", 3.0), ("fast", 2.0), ("fast", 1.0)]
    assert late == []
    found, late = compare(scene, [slow, fast], truth, seconds=0.09)  # a first run and a repeat take 0.1 s
    assert [r.method for r in found] == ["slow"]
    assert late == ["slow", "fast"]


def test_advice_is_the_fastest_sound_run_within_the_error() -> None:
    lucky, cut = record("lucky", 1e-9, 0.1, found=(2, 2)), record("cut", 1e-9, 0.1, status="stopped: something")
    good, slow = record("good", 1e-7, 1.0), record("slow", 1e-10, 5.0)
    advice = advise([lucky, cut, slow, good], 1e-6)
    assert (advice.choice, advice.others) == (good, [slow])
    nobody = advise([slow, good], 1e-12)
    assert (nobody.choice, nobody.closest) == (None, slow)
    assert fastest([lucky, good, slow], 1e-9) is slow
    with pytest.raises(Refused, match="no method has a result"):
        advise([cut], 1.0)


def test_advice_within_a_budget_is_the_most_accurate() -> None:
    good, slow = record("good", 1e-7, 1.0), record("slow", 1e-10, 5.0)
    assert advise([slow, good], budget=2.0).choice is good
    both = advise([slow, good], budget=9.0)
    assert (both.choice, both.others) == (slow, [good])
    none = advise([slow, good], budget=0.5)
    assert (none.choice, none.closest) == (None, good)


@pytest.mark.parametrize("wish", [
    {}, {"error": 1.0, "budget": 1.0}, {"error": 0.0}, {"error": math.nan}, {"budget": math.nan}, {"budget": -1.0},
])
def test_advice_needs_one_positive_wish(wish: dict[str, float]) -> None:
    with pytest.raises(Refused, match=r"^(error|budget).* allowed: (exactly one of them|a number > 0)"):
        advise([record("a", 1.0, 1.0)], **wish)


def test_too_many_touches_are_not_called_missed_and_no_row_is_done_without_a_result() -> None:
    truth = Truth(np.zeros(1), np.zeros((1, 6)), (1, 1), 1e-14)
    [_, _, more, only] = _table(truth, [record("more", 1e-3, 1.0, found=(9, 9)), record("more", 1e-6, 2.0),
                                        record("only", 1e-3, 1.0, found=(0, 0))])
    assert more.endswith("; 1 of 2 runs stop or count touches wrongly")
    assert only.endswith("-  no usable run; 1 of 1 runs stop or count touches wrongly")


def test_a_coarser_accuracy_may_take_more_work() -> None:
    """As docs/accuracy.md says."""
    coarse, fine = (simulate(scenes.load("friction"), setting=setting).work for setting in (1e-3, 1e-16))
    assert coarse.sum() > fine.sum()


def test_methods_that_do_not_know_a_scene_are_named() -> None:
    contenders, others = own_contenders(scenes.load("everything"))
    assert [contender.name for contender in contenders] == ["exact"]
    assert "only continuous feedback" in others["rk4"]
    assert len(_not_here(others)) == 1


@pytest.mark.slow
@pytest.mark.thorough
def test_the_command_answers_with_a_command_and_a_picture(command: Any, tmp_path: Path) -> None:
    words = ("accuracy", "case_01", "--set", "time.duration_s=0.5", "--seconds", "8")
    result = command(*words, "--error", "1e-6", "-o", "a.png")
    assert result.returncode == 0, result.stderr
    last = result.stdout.splitlines()[-1]
    assert last.startswith("grasp simulate case_01 --set time.duration_s=0.5 --method ")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert command(*last.split()[1:]).returncode == 0
    too_much = command(*words, "--error", "1e-30")
    assert too_much.returncode == 1
    assert "no method reaches an error of 1e-30; closest: exact" in too_much.stdout
    found = json.loads(command("accuracy", "noise", "--set", "time.duration_s=0.5", "--json").stdout)
    assert {entry["method"] for entry in found["records"]} == {"exact"}
    in_time = command(*words, "--budget", "10")
    assert in_time.stdout.splitlines()[-1].startswith("grasp simulate case_01 ")
    assert command(*words, "--budget", "1e-9").returncode == 1
    assert command(*words, "--error", "0").returncode == 2
    assert command(*words, "--error", "1", "--budget", "1").returncode == 2
    assert command(*words[:-1], "inf").returncode == 2

"""Measuring: failures stay visible, runs resume, ladders end."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import horizon, stalling

from grasp_ros import scene as scenes
from grasp_ros.accuracy.measure import Answer, Contender, Record, Truth, contender_of, finest
from lab.studies import accuracy, figures
from lab.studies.records import Journal, write_records

SHORT = "time.duration_s=2"
QUICK = accuracy.QUICK._replace(stride=1)


def contender(name: str, *ladder: float) -> Contender:
    return contender_of(name)._replace(ladder=ladder)


def test_error_contacts_and_work_are_measured_not_believed(tmp_path: Path) -> None:
    scene = scenes.load("case_01", [SHORT])
    target = accuracy.truth(scene, Journal(tmp_path))
    exact = accuracy.attempt(contender("exact", 1e-16), scene, 1e-16, target, QUICK)
    coarse = accuracy.attempt(contender("paper", 1e-3), scene, 1e-3, target, QUICK)
    assert exact.error is not None
    assert coarse.error is not None
    assert exact.error < 1e-13 < 1e-6 < coarse.error
    assert exact.found == exact.there_are == target.touches
    assert (coarse.steps, coarse.right_hand_sides) == (2000 + 2 * sum(target.touches), 8000 + 8 * sum(target.touches))
    assert coarse.seconds is not None
    assert coarse.first > coarse.time > 0.0
    assert coarse.repeats >= 1
    again = accuracy.truth(scene, Journal(tmp_path))
    assert (again.state == target.state).all()


@pytest.mark.slow
def test_a_method_that_misses_contacts_is_shown_with_its_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(accuracy, "truth", lambda scene, journal: finest(scene))  # in place of 20 s with 25 digits
    case = horizon("v_jump_one_sided", 5.0)
    effort = QUICK._replace(each=QUICK.each._replace(patience=math.inf))  # on a machine that is slow, too
    records = accuracy.run([case], tmp_path, effort, [contender("lsoda_events", 1e-4, stalling())])
    wrong, stalled = records
    assert wrong.status == "done"
    assert wrong.missed is not None
    assert wrong.missed > 0
    assert stalled.error is None
    assert stalled.status.startswith("stopped: a search for the next event does not end")
    assert stalled.missed is not None
    write_records(records, tmp_path / "records.csv")
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

    missing = accuracy.attempt(Contender("x", "x", "tolerance", (1.0,), absent), scene, 1.0, target, QUICK)
    assert (missing.status, missing.error) == ("not installed", None)
    effort = QUICK._replace(deadline=0.05)
    slow = accuracy.attempt(Contender("x", "x", "tolerance", (1.0,), endless), scene, 1.0, target, effort)
    assert slow.status == "stopped: longer than 0.05 s"
    assert accuracy.given_up(slow, effort)


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
    assert len(lines) == 4  # the reference is the first
    assert Journal(tmp_path).get(lines[-1]["key"], Record) == second[2]


@pytest.mark.slow
def test_a_ladder_ends_where_a_run_takes_too_long(tmp_path: Path) -> None:
    scene = scenes.load("case_01", [SHORT])
    effort = QUICK._replace(each=QUICK.each._replace(patience=0.0))
    records = accuracy.run([scene], tmp_path, effort, [contender("rk4", 1e-2, 1e-3, 1e-4)])
    assert [r.setting for r in records] == [1e-2]

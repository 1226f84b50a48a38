"""Drift of the energy over long times, and how far ahead double precision sees."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles import energy

from grasp_ros import scene as scenes
from lab.reference.grasp import grasp_of
from lab.studies import drift, figures, predictability


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


def test_elastic_scene_is_case_2_for_longer() -> None:
    long = drift.elastic(100.0)
    assert long.duration == 100.0
    assert energy(grasp_of(long), long.initial_state).V_c == pytest.approx(5.1)


def test_what_a_scene_can_hold() -> None:
    """Case 1 amplifies by some 4e2 in 20 s, case 3 by 7e6."""
    tame, wild = (predictability.predict(scenes.load(name), 60.0) for name in ("case_01", "case_03"))
    assert 1e2 < tame.growth < 1e4
    assert 1e6 < wild.growth < 1e8
    assert tame.until(1e-9) is None
    first, last = wild.until(1e-9), wild.until(1e-3)
    assert first is not None
    assert last is not None
    assert 10.0 < first < last < 60.0
    assert (np.diff(wild.distance) >= 0.0).all()

"""How runs end: at a budget, where the energy rises, and never because a kernel took breath."""

from __future__ import annotations

import re

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.exact import integrator
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import OBJECT, Of, Work
from grasp_ros.simulation import simulate


@pytest.mark.parametrize("sampled", [False, True])
def test_runs_stop_where_the_energy_rises(sampled: bool) -> None:
    """An object that its surroundings drive, which no scene can ask for."""
    scene = scenes.load("case_01").changed({"time.duration_s": 1.0, "object.velocity_m_per_s": 0.01})
    whole = simulate(scene, sampled=sampled)
    assert (whole.status, whole.stop) == (Status.DONE, "")
    driven = scene.changed({})
    driven.system.bodies.setflags(write=True)
    driven.system.bodies[OBJECT, Of.DAMPING] = -50.0
    cut = simulate(driven, sampled=sampled)
    assert cut.status is Status.ENERGY_RISES
    found = re.fullmatch(rf"{cut.status.value}: t = (\S+) s, mode (\d), state \[.*\]", cut.stop)
    assert found is not None
    assert cut.t[-1] <= float(found[1]) < 1.0
    assert 0 < len(cut.t) == len(cut.state) == len(cut.command) < len(whole.t)
    np.testing.assert_allclose(cut.state, whole.state[: len(cut.t)], atol=1e-2)


@pytest.mark.parametrize("breath", [10**6, 50])
def test_the_budget_of_work_ends_a_run(monkeypatch: pytest.MonkeyPatch, breath: int) -> None:
    monkeypatch.setattr(integrator, "BREATH", breath)
    run = simulate(scenes.load("case_02"), max_work=300)
    assert run.status is Status.WORK_BUDGET
    spent = int(run.work.sum() - run.work[Work.REJECTED_STEPS])
    assert 300 <= spent < 400
    assert run.stop.startswith(f"{run.status.value}: t = ")
    assert 0 < len(run.t) < 2001


@pytest.mark.parametrize("name", ["case_02", "friction", "friction_slide"])
def test_a_run_that_takes_breath_gives_the_same_bits(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    whole = simulate(scenes.load(name))
    monkeypatch.setattr(integrator, "BREATH", 7)
    pieces = simulate(scenes.load(name))
    np.testing.assert_array_equal(pieces.state, whole.state)
    np.testing.assert_array_equal(pieces.event_table, whole.event_table)
    np.testing.assert_array_equal(pieces.work, whole.work)

"""Every hard case within its bound, or with the status that it announces; the study shows the same errors."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.exact import integrator
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import DAMPING, OBJECT, Work
from grasp_ros.simulation import simulate
from grasp_ros.verification.cases.case import Case, Product, evaluate
from grasp_ros.verification.cases.registry import cases

PARAMETERS = [pytest.param(case, id=f"{case.family.name}: {case.name}") for case in cases()]


def test_names_are_unique_and_families_are_many() -> None:
    names = [(case.family.name, case.name) for case in cases()]
    assert len(names) == len(set(names)) >= 60
    assert {family for family, _ in names} == {
        "impact", "chain", "creep", "touch", "graze", "clamp", "start", "extreme", "rest", "flight", "wait", "horizon",
        "tail", "balance", "loop", "growth", "limit", "relation", "found",
    }


@pytest.mark.parametrize("case", PARAMETERS)
def test_hard_case(case: Case) -> None:
    verdict = evaluate(case, Product(case.max_events, case.max_work))
    assert verdict.right(case), verdict


@pytest.mark.parametrize("status", [Status.EVENT_BUDGET, Status.WORK_BUDGET, Status.NOT_FINITE])
def test_announced_ends_do_come(status: Status) -> None:
    """A limit that is never met would let a case pass for nothing."""
    case = next(case for case in cases() if case.limit is status)
    product = Product(case.max_events, case.max_work)
    assert evaluate(case, product).status == status.value
    assert len(product.runs[-1].t) < len(product.runs[-1].scene.system.state) * 10**6
    assert len(product.runs[-1].state) == len(product.runs[-1].t)


def test_oracles_notice_a_coarse_solver() -> None:
    """With an accuracy of 1e-3 nearly all the cases with contacts fail."""
    families = ("touch", "clamp", "start", "extreme")
    found = [case for case in cases() if case.family.name in families and case.bound > 0.0][::4]
    failed = [case for case in found if not evaluate(case, Product(accuracy=1e-3)).right(case)]
    assert len(failed) > 0.7 * len(found)


def test_an_error_that_is_not_a_number_is_no_success() -> None:
    case = replace(cases()[0], error=lambda _: float("nan"))
    assert not evaluate(case, Product()).right(case)


@pytest.mark.parametrize("sampled", [False, True])
def test_runs_stop_where_the_energy_rises(sampled: bool) -> None:
    """An object that its surroundings drive, which no scene can ask for."""
    scene = scenes.load("case_01").changed({"time.duration_s": 1.0, "object.velocity_m_per_s": 0.01})
    whole = simulate(scene, sampled=sampled)
    assert (whole.status, whole.stop) == (Status.DONE, "")
    driven = scene.changed({})
    driven.system.bodies[OBJECT, DAMPING] = -50.0
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
    parts = simulate(scenes.load(name))
    np.testing.assert_array_equal(parts.state, whole.state)
    np.testing.assert_array_equal(parts.event_table, whole.event_table)
    np.testing.assert_array_equal(parts.work, whole.work)

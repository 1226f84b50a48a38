"""Every hard case within its bound, or with the status that it announces; the study shows the same errors."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import pytest

from grasp_ros.exact.integrator import Status
from lab.cases.case import Case, Product, Verdict, evaluate
from lab.cases.families import ORDER
from lab.cases.registry import cases
from lab.studies import hard

REFERENCE = [pytest.mark.slow]  # 25 digits
PARAMETERS = [
    pytest.param(case, id=f"{case.family.name}: {case.name}", marks=REFERENCE if "reference" in case.oracle else ())
    for case in cases()
]


def test_names_are_unique_and_families_are_many() -> None:
    names = [(case.family.name, case.name) for case in cases()]
    assert len(names) == len(set(names)) >= 60
    assert {family for family, _ in names} == {family.name for family in ORDER}
    assert len(ORDER) == 18


@pytest.mark.parametrize("case", PARAMETERS)
def test_hard_case(case: Case) -> None:
    verdict = evaluate(case, Product(case.max_events, case.max_work))
    assert verdict.right(case), verdict


@pytest.mark.parametrize("status", [Status.EVENT_BUDGET, Status.WORK_BUDGET, Status.OUTSIDE])
def test_announced_ends_do_come(status: Status) -> None:
    """A limit that is never met would let a case pass for nothing."""
    case = next(case for case in cases() if case.limit is status)
    product = Product(case.max_events, case.max_work)
    assert evaluate(case, product).status == status.value
    assert len(product.runs[-1].t) < len(product.runs[-1].scene.system.state) * 10**6
    assert len(product.runs[-1].state) == len(product.runs[-1].t)


@pytest.mark.slow
def test_oracles_notice_a_coarse_solver() -> None:
    """With an accuracy of 1e-3 nearly all the cases with contacts fail."""
    families = ("touch", "clamp", "start", "extreme")
    found = [case for case in cases() if case.family.name in families and case.bound > 0.0][::4]
    failed = [case for case in found if not evaluate(case, Product(accuracy=1e-3)).right(case)]
    assert len(failed) > 0.7 * len(found)


def test_an_error_that_is_not_a_number_is_no_success() -> None:
    case = replace(cases()[0], error=lambda _: float("nan"))
    assert not evaluate(case, Product()).right(case)


def test_the_picture_counts_what_is_kept_broken_and_without_a_result() -> None:
    """A method that is not asked in a case is not counted there, nor is a family in which it is asked nothing."""
    bounded = next(case for case in cases() if case.bound > 0.0 and case.limit is Status.DONE)
    ended = next(case for case in cases() if case.limit is not Status.DONE and case.family != bounded.family)
    kept, broken, none = Verdict(0.0, "done"), Verdict(2.0 * bounded.bound, "done"), Verdict(None, "refused")
    rows = [hard.Row(bounded, kept, [broken, none]), hard.Row(bounded, broken, []), hard.Row(ended, none, [])]
    found = hard.counts(rows, 2)
    assert found[bounded.family.name] == [Counter(kept=1, broken=1), Counter(broken=1), Counter({"no result": 1})]
    assert found[ended.family.name] == [Counter({"no result": 1}), None, None]

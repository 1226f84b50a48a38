"""Records of measurements, and the advice that follows from them."""

from __future__ import annotations

import math

import pytest
from measurements import record

from lab.studies import accuracy, adviser


def test_missed_contacts_are_counted_on_both_sides() -> None:
    assert record("a", 0.1, 1.0, found=(5, 0)).missed == 4
    assert record("a", 0.1, 1.0).missed == 0
    assert record("a", 0.1, 1.0, found=None).missed is None


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

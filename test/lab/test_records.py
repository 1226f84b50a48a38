"""Records of measurements, and what nobody beats among them."""

from __future__ import annotations

from measurements import record

from lab.studies import accuracy


def test_missed_contacts_are_counted_on_both_sides() -> None:
    assert record("a", 0.1, 1.0, found=(5, 0)).missed == 4
    assert record("a", 0.1, 1.0).missed == 0
    assert record("a", 0.1, 1.0, found=None).missed is None


def test_frontier_holds_what_nobody_beats() -> None:
    records = [record("a", 1e-3, 1.0), record("b", 1e-2, 2.0), record("c", 1e-6, 3.0), record("d", None, None)]
    assert [r.method for r in accuracy.frontier(records)] == ["a", "c"]

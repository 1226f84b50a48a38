"""Every statement of the paper broken on purpose, or repaired where it fails: its verdict must change."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.energy import Energy
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.paper import compare, measures, motion, universal
from lab.paper.cases import Cases, load_cases, random_starts, with_values
from lab.paper.claims import Kind, Verdict
from lab.paper.statements import STATEMENTS

CASES = load_cases()
STARTS = random_starts(3)
HOLDS, LIMITED, FAILS = Verdict.HOLDS, Verdict.LIMITED, Verdict.FAILS
LOSSLESS = {"c": 0.0, "Kv": 0.0, "p": 0.0}
SLACK = {"k": 0.0, "Kp": 0.0}  # nothing draws the arms


class Break(NamedTuple):
    """One part of a statement, a case to change, and the verdicts before and after."""

    key: str
    part: int
    before: tuple[Verdict, ...]
    after: tuple[Verdict, ...]
    case: int
    change: dict[str, float]  # by the paper's letters
    looked_at: tuple[int, ...] = ()  # the cases that a statement about every motion is asked of; default: that one


@pytest.fixture(autouse=True)
def _no_other_readings(monkeypatch: pytest.MonkeyPatch) -> None:
    """They do not enter a verdict, and take most of the time."""
    for module in (compare, universal):
        monkeypatch.setattr(module, "read_starts", lambda *several: {})
    monkeypatch.setattr(measures, "OFFSETS", (0.0,))


def put(case: int, change: dict[str, float], cases: Cases) -> Cases:
    return {**cases, case: with_values(cases[case], change)}


def verdict(key: str, part: int, cases: Cases, looked_at: tuple[int, ...]) -> Verdict:
    """Of one part, without its sweep."""
    judged: Any = STATEMENTS[key].parts[part]
    fields: dict[str, Any] = {"values": ()}
    if "cases" in judged._fields:
        fields |= {"cases": looked_at, "extra": ()}
    return judged._replace(**fields).judge(cases, STARTS).verdict


TRUE, NOT_TRUE, NOT_FALSE = (HOLDS, LIMITED), (FAILS,), (HOLDS, LIMITED)
BREAKS = [
    Break("P1", 0, TRUE, NOT_TRUE, 3, {"p": 0.0}),
    Break("P1", 1, TRUE, NOT_TRUE, 3, {"p": 0.0}),
    Break("P2", 0, TRUE, NOT_TRUE, 4, {"p": 0.01}),
    Break("P3", 1, TRUE, NOT_TRUE, 1, LOSSLESS),
    Break("P5", 0, NOT_TRUE, NOT_FALSE, 5, {"m": 0.1}),
    Break("P5", 1, TRUE, NOT_TRUE, 5, {"m": 0.1}),
    Break("P6", 0, TRUE, NOT_TRUE, 7, {"k": 1.0}),
    Break("P6", 1, NOT_TRUE, NOT_FALSE, 7, {"m": 10.0}),
    Break("P7", 0, TRUE, NOT_TRUE, 8, {"c": 0.02}),
    Break("P8", 0, TRUE, NOT_TRUE, 6, {"m_l": 1.0}),
    Break("P8", 1, TRUE, NOT_TRUE, 6, {"m_l": 1.0}),
    Break("P9", 0, TRUE, NOT_TRUE, 9, {"Kp": 5.0}),
    Break("P9", 1, TRUE, NOT_TRUE, 10, {"Kv": 0.5}),
    Break("P10", 0, TRUE, NOT_TRUE, 9, {"Kp": 0.5}),
    Break("P10", 1, NOT_TRUE, NOT_FALSE, 9, {"m": 10.0}),
    Break("P10", 2, TRUE, NOT_TRUE, 9, {"Kv": 50.0}),
    Break("P11", 0, TRUE, NOT_TRUE, 10, {"Kv": 0.05}),
    Break("P11", 1, TRUE, NOT_TRUE, 10, {"Kv": 0.05}),
    Break("P12", 0, TRUE, NOT_TRUE, 11, {"m_o": 0.5}),
    Break("P12", 1, TRUE, NOT_TRUE, 11, {"m_o": 0.5}),
    Break("C1", 0, TRUE, NOT_TRUE, 1, {"p": 30.0}),
    Break("C1", 1, TRUE, NOT_TRUE, 1, {"p": 30.0}),
    Break("C1", 2, TRUE, NOT_TRUE, 1, {"p": 30.0}),
    Break("C2", 0, TRUE, NOT_TRUE, 3, {"p": 0.0}),
    Break("C3", 0, (LIMITED,), NOT_TRUE, 6, {"m_l": 1.0}),
    Break("C3", 3, (LIMITED,), NOT_TRUE, 8, {"m": 10.0}),
    Break("T3", 0, NOT_TRUE, NOT_FALSE, 1, SLACK),
    Break("T5", 0, NOT_TRUE, NOT_FALSE, 2, {"p": 1.0}),
    Break("T5", 0, (LIMITED,), (HOLDS,), 2, {"p": 1.0}, (1, 2)),
    Break("T5", 1, TRUE, NOT_TRUE, 1, LOSSLESS),
    Break("T7", 1, NOT_TRUE, NOT_FALSE, 1, {"c": 0.0, "Kv": 0.0}),
    Break("T8", 0, TRUE, NOT_TRUE, 3, {"Kv": 0.5}),
    Break("T8", 1, TRUE, NOT_TRUE, 3, {"p": 0.0}),
    Break("T10", 0, NOT_TRUE, NOT_FALSE, 1, LOSSLESS),
    Break("T10", 3, NOT_TRUE, NOT_FALSE, 7, {"k": 10.0}),
    Break("T11", 0, TRUE, NOT_TRUE, 1, SLACK),
    Break("T12", 0, TRUE, NOT_TRUE, 2, {"p": 0.5}),
    Break("T12", 1, NOT_TRUE, NOT_FALSE, 2, {"m_o": 1e9, "H": 1e12}),
]
FALLING = [  # that V, V_c or V' does not rise; no number that a scene accepts breaks it
    ("P1", 2, 3), ("P3", 0, 1), ("P4", 0, 5), ("P4", 1, 7), ("P4", 2, 8), ("P4", 3, 11), ("C1", 0, 1), ("C1", 3, 4),
    ("T1", 0, 1),
]
OTHERS = {"T2", "T4", "T6", "T9"}  # each has a test below


def test_every_statement_is_broken() -> None:
    assert {each.key for each in BREAKS} | {key for key, _, _ in FALLING} | OTHERS == set(STATEMENTS)


class Backwards(NamedTuple):
    """A motion that runs backwards in time."""

    t: Array
    state: Array
    energy: Energy


def backwards(scene: Scene) -> Backwards:
    run = simulate(scene)
    level = run.energy
    again = Energy(level.V[::-1], level.V_c[::-1], -level.V_rate[::-1], level.mode[::-1])
    return Backwards(run.t, run.state[::-1], again)


@pytest.mark.parametrize(("key", "part", "case"), FALLING)
def test_a_motion_that_runs_backwards_gains(key: str, part: int, case: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert verdict(key, part, CASES, (case,)) is HOLDS
    monkeypatch.setattr(motion, "run_of", backwards)
    assert verdict(key, part, CASES, (case,)) is FAILS


@pytest.mark.parametrize("each", BREAKS, ids=lambda each: f"{each.key}.{each.part}.{each.case}")
def test_a_verdict_changes_with_the_case(each: Break) -> None:
    looked_at = each.looked_at or (each.case,)
    assert verdict(each.key, each.part, CASES, looked_at) in each.before
    assert verdict(each.key, each.part, put(each.case, each.change, CASES), looked_at) in each.after


def test_the_collision_term_against_none() -> None:
    """T7: without the term in any of its cases there is no difference."""
    assert verdict("T7", 0, CASES, ()) is not FAILS
    without = CASES
    for case in (1, 4, 8, 10):
        without = put(case, {"p": 0.0}, without)
    assert verdict("T7", 0, without, ()) is FAILS


def test_an_object_that_moves_does_not_rest() -> None:
    """T2."""
    assert verdict("T2", 0, CASES, (1,)) is HOLDS
    moving = CASES[1].changed({"object.velocity_m_per_s": 0.1})
    assert verdict("T2", 0, {**CASES, 1: moving}, (1,)) is FAILS


def test_a_grasp_that_does_not_press_is_a_limit() -> None:
    """P3 once held, where T9, the grasp itself, does not."""
    assert verdict("P3", 2, CASES, ()) is LIMITED
    assert verdict("P3", 2, dict.fromkeys(CASES, scenes.load("preload")), ()) is HOLDS


def test_a_ratio_over_nothing_decides_nothing() -> None:
    """P8: equal arms from a symmetric start do not differ at all; 0.9233 against 0 once counted as true."""
    part = STATEMENTS["P8"].parts[0].judge(CASES, STARTS)
    trivial = [check for check in part.checks if check.kind is Kind.TRIVIAL]
    assert trivial
    assert all("against 0: no ratio" in check.value for check in trivial)
    assert not any("inf" in check.value for check in part.checks)


def test_arms_that_overlap_hold_the_object() -> None:
    """T9."""
    assert verdict("T9", 0, CASES, (1,)) is FAILS
    assert verdict("T9", 0, {**CASES, 1: scenes.load("preload")}, (1,)) is not FAILS


@pytest.mark.parametrize(
    ("key", "name", "wrong"),
    [
        ("T4", "largest_deformation", lambda system, state: np.zeros((len(state), 2))),
        ("T6", "hertzian_force", lambda contact, u: -np.maximum(u, 0.0)),
    ],
)
def test_a_law_that_is_wrong_is_seen(
    key: str, name: str, wrong: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert verdict(key, 0, CASES, (1,)) is HOLDS
    monkeypatch.setattr(motion, name, wrong)
    assert verdict(key, 0, CASES, (1,)) is FAILS


def test_a_share_may_not_hide_in_a_crowd() -> None:
    """T5: one case that never settles is a limit, whatever number of others settle."""
    judged: Any = STATEMENTS["T5"].parts[0]
    checks = judged._replace(values=(), cases=(1, 2, 4)).judge(CASES, STARTS).limits
    assert {check.text for check in checks} >= {"No. 2"}
    assert min(check.share for check in checks) == 0.0


def test_an_unequal_pair_lies_between_the_equal_ones() -> None:
    """C3: later than the better pair, sooner than the other."""
    part = STATEMENTS["C3"].parts[0].judge(CASES, STARTS)
    shares = {check.text: check.share for check in part.checks if check.kind.name == "RANDOM"}
    assert list(shares.values()) == [1.0, 0.0]

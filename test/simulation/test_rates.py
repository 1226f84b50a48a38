"""Controllers with rates of their own, and a delay in seconds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.errors import Refused
from grasp_ros.scene import Scene
from grasp_ros.simulation import simulate
from lab.reference.solve import integrate

TIMES = np.linspace(0.0, 2.0, 21)


def slow(left: int, right: int, period_s: float = 0.002, **loop: Any) -> Scene:
    """Case 1 for 2 s, each controller with so many control periods between its answers; 0: no rate of its own."""
    values = {section: dict(numbers) for section, numbers in scenes.load("case_01").values.items()}
    values["time"] = {"duration_s": 2.0, "control_period_s": period_s}
    rates = {f"{side}_rate": {"period_ticks": n} for side, n in (("left", left), ("right", right)) if n}
    return scenes.compose("slow", {**values, "loop": loop, **rates})


@pytest.mark.parametrize("delay_s", [0.0, 0.02])
def test_two_equal_rates_are_a_longer_control_period(delay_s: float) -> None:
    fast, plain = slow(5, 5, delay_s=delay_s), slow(0, 0, 0.01, delay_s=delay_s)
    assert fast.system.delay == 5 * plain.system.delay
    assert simulate(fast, grid=TIMES).state == pytest.approx(simulate(plain, grid=TIMES).state, abs=1e-14)


def test_two_rates_with_a_delay_agree_with_the_reference() -> None:
    scene, times = slow(3, 7, delay_s=0.006), [0.5, 1.0, 2.0]
    reference = np.array(integrate(scene, times).state, dtype=float)
    assert simulate(scene, grid=times).state == pytest.approx(reference, abs=1e-13)


def test_between_its_answers_a_controller_is_not_asked_and_its_last_command_acts() -> None:
    asked: list[int] = []

    def law(tick: int, time: float, x: float, v: float) -> float:
        asked.append(tick)
        return float(len(asked))

    run = simulate(slow(0, 30), grid=np.arange(1000) * 0.002, controllers={"right": law})
    assert asked == list(range(0, 1001, 30))
    assert run.inputs[:, 1].tolist() == [tick // 30 + 1.0 for tick in range(1000)]


def test_derivatives_pass_held_answers() -> None:
    key = "right_feedback.velocity_gain_Ns_per_m"
    scene, gain = slow(0, 20), 0.5
    run = simulate(scene, grid=TIMES, sensitivity=[key])
    after, before = (simulate(scene.changed({key: gain + step}), grid=TIMES) for step in (1e-6, -1e-6))
    assert run.sensitivity.state_rates[..., 0] == pytest.approx((after.state - before.state) / 2e-6, abs=1e-7)


@pytest.mark.parametrize(("loop", "allowed"), [
    ({"delay_s": 0.003}, "a whole number of control periods of 0.002 s, at most 10000"),
    ({"delay_s": 1e-10}, "a whole number of control periods of 0.002 s, at most 10000"),
    ({"delay_s": 20.002}, "a whole number of control periods of 0.002 s, at most 10000"),
    ({"delay_s": 0.004, "delay_ticks": 2}, "one of delay_s and delay_ticks"),
])
def test_a_delay_that_is_no_whole_number_of_periods_is_refused(loop: dict[str, Any], allowed: str) -> None:
    with pytest.raises(Refused, match=f"loop.delay_s: .*; allowed: {allowed}"):
        slow(0, 0, **loop)


@pytest.mark.parametrize(("left", "warning"), [(1, "has no effect"), (1000, "is the whole run of 1000")])
def test_a_rate_that_does_nothing_or_never_answers_again_is_suspicious(left: int, warning: str) -> None:
    assert any(f"left_rate.period_ticks: {left} {warning}" in text for text in slow(left, 0).warnings)


def test_a_rate_too_slow_for_its_gains_is_suspicious() -> None:
    values = slow(50, 0).changed({"left_feedback.velocity_gain_Ns_per_m": 40.0})
    assert any("is too long for left_feedback" in text for text in values.warnings)

"""Crossings of a user's own functions."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from documents import case_of, scene_of

from grasp_ros import scene
from grasp_ros.physics.errors import Refused
from grasp_ros.simulation import simulate

V_O = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]


def brute(run: Any, function: Any, points: int = 400_001) -> np.ndarray:
    """Signs on a dense grid: between which times a function changes its sign."""
    t = np.linspace(0.0, run.scene.duration, points)
    values = function(t, run.at(t))
    return t[:-1][values[:-1] * values[1:] < 0.0]


@pytest.mark.parametrize("name", ["case_01", "case_03", "preload", "sine", "delay"])
def test_a_linear_section_has_every_crossing_and_nothing_else(name: str) -> None:
    run = simulate(scene.load(name))
    found = run.section(V_O)
    seen = brute(run, lambda _, y: y[:, 3])
    assert len(found.t) == len(seen) > 0 or name == "preload"
    assert np.all((found.t >= seen) & (found.t <= seen + run.scene.duration / 400_000))
    assert np.abs(found.state[:, 3]).max(initial=0.0) < 1e-13
    assert found.state.tobytes() == run.at(found.t).tobytes()
    assert found.resolution == 0.0
    assert set(np.diff(found.direction)) <= {-2, 2}


def test_directions_and_levels() -> None:
    run = simulate(case_of(duration=10.0))
    both, up, down = (run.section(V_O, 0.02, direction) for direction in (0, 1, -1))
    assert sorted([*up.t, *down.t]) == both.t.tolist()
    assert np.allclose(both.state[:, 3], 0.02, rtol=0.0, atol=1e-13)
    later = run.at(up.t + 1e-6)[:, 3]
    assert (later > 0.02).all()


def test_any_function_of_time_and_state() -> None:
    run = simulate(case_of(duration=5.0))

    def stretch(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        return (y[:, 4] - y[:, 0]) * np.cos(7.0 * t) - 0.1 * y[:, 3]

    found = run.section(stretch)
    seen = brute(run, stretch)
    assert len(found.t) == len(seen) > 10
    assert np.abs(found.t - seen).max() <= 5.0 / 400_000
    assert found.resolution == 0.0


def test_swings_of_a_motion_that_has_died_down_are_crossings_down_to_what_is_promised() -> None:
    """A damped arm by itself: v = 0 every half period, with swings of 2e-12 of the largest speed at last."""
    case = scene_of("arm_alone", "left_arm.position_m=0.3", "left_arm.stiffness_N_per_m=100", "time.duration_s=60",
                    "left_arm.damping_Ns_per_m=1", without=("left_feedback",))
    mass = case.values["left_arm"]["mass_kg"]
    rate = np.sqrt(100.0 / mass - (0.5 / mass) ** 2)
    zeros = np.arange(1, 60.0 * rate / np.pi) * np.pi / rate
    zeros = zeros[np.exp(-0.5 / mass * zeros) > 2e-12]
    found = simulate(case).section([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert len(zeros) > 100
    assert found.t[: len(zeros)] == pytest.approx(zeros, abs=1e-9)


def test_a_crossing_is_found_on_the_motion_itself_whatever_the_range_of_the_function() -> None:
    run = simulate(case_of(duration=3.0))
    assert run.section(lambda t, _: np.exp(100.0 * (t - 1.0)), 1.0).t == pytest.approx([1.0], abs=1e-15)
    jumps = run.section(lambda _, y: np.sign(y[:, 0] + 0.1))
    assert jumps.t == pytest.approx(run.section([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], -0.1).t, rel=1e-15, abs=1e-15)
    assert len(jumps.t) > 5


def test_a_function_with_a_kink_says_how_far_it_is_resolved() -> None:
    run = simulate(case_of())
    found = run.section(lambda t, y: np.abs(t - 1.1) - 1e-3)
    assert found.t == pytest.approx([1.099, 1.101], abs=1e-12)
    assert 0.0 < found.resolution < 1e-3
    jump = run.section(lambda t, y: np.where(t < 0.7, -1.0, 1.0))
    assert jump.t == pytest.approx([0.7], abs=jump.resolution)


def test_a_graze_that_does_not_cross_is_no_crossing() -> None:
    run = simulate(case_of())
    assert len(run.section(lambda t, y: (t - 1.0) ** 2).t) == 0
    assert len(run.section(lambda t, y: np.zeros_like(t)).t) == 0
    assert run.section(lambda t, y: (t - 1.0) ** 2 - 1e-8).t == pytest.approx([0.9999, 1.0001], abs=1e-10)


@pytest.mark.parametrize(("section", "direction", "sentence"), [
    ([1.0, 2.0], 0, "six weights of the state"), (np.zeros(6), 0, "not all 0"), (V_O, 2, "direction: 2"),
    (None, 0, "six weights of the state"), ("x", 0, "six weights of the state"),
    (lambda t, y: 1j * t, 0, "gives complex numbers; allowed: a finite number for each"),
    (lambda t, y: y, 0, "a finite number for each"),
    (lambda t, y: np.full_like(t, np.nan), 0, "not finite, as the state of a body that is not there"),
    (lambda t, y: None, 0, "a finite number for each"),
])
def test_what_is_no_section_is_refused(section: Any, direction: int, sentence: str) -> None:
    with pytest.raises(Refused, match=sentence):
        simulate(case_of()).section(section, direction=direction)
    with pytest.raises(Refused, match=r"^level: nan is not allowed; allowed: a finite number$"):
        simulate(case_of()).section(V_O, level=math.nan)

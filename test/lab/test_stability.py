"""Limits of the control period, and the growth beyond them."""

from __future__ import annotations

import math

import pytest
from oracles import STANDARD

from grasp_ros.physics import sampled
from grasp_ros.physics.model import Arm
from lab.studies import loop


@pytest.mark.parametrize(
    ("gains", "delay", "limit"),
    [((5.0, 0.5), 0, 0.275056637414546), ((5.0, 0.5), 1, 0.0887780231816513), ((50.0, 5.0), 0, 0.2027695528985455)],
)
def test_limits_of_the_control_period(gains: tuple[float, float], delay: int, limit: float) -> None:
    arm = STANDARD._replace(position_gain=gains[0], velocity_gain=gains[1])
    assert loop.first_limit(arm, delay) == pytest.approx(limit, rel=1e-12)
    assert sampled.spectral_radius(arm, 1.001 * limit, delay) > 1.0 > sampled.spectral_radius(arm, 0.999 * limit, delay)


def test_without_feedback_there_is_no_limit() -> None:
    assert loop.first_limit(Arm(1.0, 10.0, 0.2, 0.0, 0.0), 1) == math.inf
    assert loop.limits(Arm(1.0, 10.0, 0.2, 0.0, 0.0), (0,))[0].checks == ()


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_simulation_grows_as_the_spectral_radius_says(delay: int) -> None:
    limit = loop.first_limit(STANDARD, delay)
    for factor, stable in ((0.9, True), (1.1, False)):
        radius = sampled.spectral_radius(STANDARD, factor * limit, delay)
        growth = loop.simulated_growth(STANDARD, factor * limit, delay, 1600)
        assert (growth < 1.0) is stable
        assert growth == pytest.approx(radius, abs=3e-4)

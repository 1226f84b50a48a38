"""One control period of an arm alone: its matrix and its spectral radius."""

from __future__ import annotations

import math

import numpy as np
import pytest
from oracles import FREE, STANDARD, flight

from grasp_ros.physics import sampled
from grasp_ros.physics.model import Arm

HEAVY = Arm(1.0, 1.0, 9.0, 0.0, 0.0)  # over-damped


def test_stability_returns_in_an_island() -> None:
    radii = [sampled.spectral_radius(STANDARD, h, 0) for h in (1.6, 1.7, 2.0, 2.6, 2.7)]
    assert [radius < 1.0 for radius in radii] == [False, True, True, True, False]


@pytest.mark.parametrize("arm", [STANDARD, FREE, Arm(2.0, 0.0, 3.0, 1.0, 1.0), Arm(1.0, 9.0, 6.0, 1.0, 1.0), HEAVY])
def test_flow_under_a_held_command(arm: Arm) -> None:
    """Against the matrix exponential: under-, over- and critically damped arms, without spring, without anything."""
    flow = sampled.held_flow(arm, np.array([0.3]))[0]
    body = (arm.mass, arm.stiffness, arm.damping)
    for column, (x, v, force) in enumerate(np.eye(3)):
        expected = [float(value) for value in flight((*body, force), x, v, 0.3)]
        assert flow[:, column] == pytest.approx(expected, abs=1e-14)


def test_continuous_feedback_is_the_limit_of_short_periods() -> None:
    """Growth over 1 s tends to exp(-C / 2 m)."""
    for delay in (0, 1):
        assert sampled.spectral_radius(STANDARD, 1e-4, delay) ** 1e4 == pytest.approx(math.exp(-0.35), rel=2e-3)

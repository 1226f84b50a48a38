"""V by parts, as a quadratic form, and the deformation: (11) to (16), (21), (28) to (37)."""

from __future__ import annotations

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.energy import energy
from grasp_ros.physics.lyapunov import deformation, largest_deformation, parts, reach
from grasp_ros.simulation import simulate
from lab.paper import by_hand

SCENE = scenes.load("case_01")
CASE = SCENE.system
RNG = np.random.default_rng(3)
STATES = 10.0 ** RNG.uniform(-4.0, 0.0, (2000, 1)) * RNG.normal(size=(2000, 6))


def test_the_form_the_parts_and_V_are_one() -> None:
    V = energy(CASE, STATES).V
    P = np.array([by_hand.matrix(SCENE, y) for y in STATES])
    assert np.einsum("ni,nij,nj->n", STATES, P, STATES) == pytest.approx(V, rel=1e-13)
    assert sum(parts(CASE, STATES)) == pytest.approx(V, rel=1e-14)
    assert set(energy(CASE, STATES).mode) == {0, 1, 2, 3}


def test_the_matrix_by_hand() -> None:
    """u_l = 0.04, at rest: Delta k = 0.8 * 1e4 * 0.2 = 1600 N/m."""
    P = by_hand.matrix(SCENE, np.array([0.04, 0.0, 0.0, 0.0, 1.0, 0.0]))
    expected = np.diag([15.0 + 1600.0, 1.0, 1600.0, 5.0, 15.0, 1.0])
    expected[0, 2] = expected[2, 0] = -1600.0
    assert pytest.approx(expected, rel=1e-14) == P


def test_parts_of_a_scene_without_an_object() -> None:
    run = simulate(scenes.load("arm_alone"))
    assert run.parts.V_l == pytest.approx(run.energy.V_c, rel=1e-14)
    assert not run.parts.V_o.any()
    assert not run.parts.contact_l.any()


def test_epsilon_is_a_running_maximum_below_its_bound() -> None:
    run = simulate(scenes.load("case_02"))
    assert np.array_equal(run.epsilon[-1], deformation(CASE, run.state).max(axis=0))
    assert (np.diff(run.epsilon, axis=0) >= 0.0).all()
    assert (run.epsilon[-1] <= reach(CASE.closed_loop, CASE.pairs, float(run.energy.V_c[0]))[3:]).all()
    assert largest_deformation(CASE, run.state[:1]).tolist() == [[0.0, 0.0]]


@pytest.mark.parametrize("level", [1e-8, 1e-2, 5.0])
def test_no_state_of_a_level_exceeds_the_bounds(level: float) -> None:
    """States scaled to the level; the arms alone attain theirs."""
    for _ in range(60):  # V_c is not homogeneous: bisection
        direction = RNG.normal(size=6)
        low, high = 0.0, 1e3
        for _ in range(80):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if energy(CASE, middle * direction).V_c <= level else (low, middle)
        state = low * direction
        bounds = reach(CASE.closed_loop, CASE.pairs, level)
        assert (np.abs(state[0::2]) <= np.array(bounds[:3]) * (1.0 + 1e-12)).all()
        assert (deformation(CASE, state) <= bounds[3:]).all()
    stretched = np.array([-np.sqrt(level / 15.0), 0.0, 0.0, 0.0, 0.0, 0.0])
    assert -stretched[0] == pytest.approx(bounds[0])

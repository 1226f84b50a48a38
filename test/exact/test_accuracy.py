"""The integrator beside a second method family: states and events of the paper's cases, and of random scenes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import CASES, Run, done, reference_of, run

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Arm, Contact
from lab.cases.scenes import contacts, grasp
from lab.reference import integrate
from lab.reference.grasp import grasp_of

pytestmark = pytest.mark.slow  # references with 16 digits

LONG = ("case_01", "case_02", "case_03", "case_04", "case_06", "case_09")  # 20 s of reference; 5 s for the others
BOUNDS = {  # one rounding of one start velocity changes case 9 by 1.0e-9
    "case_01": 1e-12, "case_02": 1e-11, "case_03": 1e-9, "case_06": 1e-9, "case_09": 5e-9,
}
TOUCHES = {"case_01": (22, 22), "case_02": (29, 25), "case_03": (27, 21)}


def case(name: str, **options: Any) -> Run:
    """One of the paper's cases on the grid of its reference."""
    scene, horizon = scenes.load(name), horizon_of(name)
    return run(grasp_of(scene), scene.initial_state, horizon, np.linspace(0.0, horizon, 201), **options)


def horizon_of(name: str) -> float:
    """How far the reference of a case goes."""
    return 20.0 if name in LONG else 5.0


@pytest.mark.parametrize("name", CASES)
def test_states_against_the_reference_at_default_accuracy(name: str) -> None:
    result = case(name)
    done(result)
    assert np.abs(result.states - reference_of(name, horizon_of(name)).as_array()).max() < BOUNDS.get(name, 3e-11)


@pytest.mark.parametrize("name", ["case_01", "case_04", "case_10"])
def test_error_follows_the_accuracy(name: str) -> None:
    reference = reference_of(name, horizon_of(name)).as_array()
    errors = [np.abs(case(name, accuracy=a).states - reference).max() for a in (1e-4, 1e-7, 1e-10, 1e-13)]
    assert errors[0] > 1e3 * errors[1] ** (2 / 3) * 1e-4  # it is a setting that does something
    assert all(error < 1e4 * a for error, a in zip(errors, (1e-4, 1e-7, 1e-10, 1e-13), strict=True))
    assert errors == sorted(errors, reverse=True)


@pytest.mark.parametrize("name", CASES)
def test_switches_against_the_reference(name: str) -> None:
    result, reference = case(name), reference_of(name, horizon_of(name))
    for side in (LEFT, RIGHT):
        begins, ends = contacts(result.integrator.events, side)
        for found, expected in ((begins, reference.touches[side]), (ends, reference.releases[side])):
            assert len(found) == len(expected)
            # a slow touch is as uncertain as position / speed; case 9 amplifies most
            assert np.abs(found - np.array([float(t) for t in expected])).max() < (1e-7 if name == "case_09" else 5e-9)
    if name in TOUCHES:
        assert tuple(len(result.times(side, Transition.TOUCH)) for side in (LEFT, RIGHT)) == TOUCHES[name]


@pytest.mark.parametrize("seed", range(12))
def test_random_clamped_scenes_against_the_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm = Arm(float(rng.uniform(0.5, 2)), 10.0, 0.2, float(rng.uniform(5, 80)), float(rng.uniform(0, 6)))
    contact, mass = Contact(10.0 ** rng.uniform(2, 4), float(rng.uniform(5, 30))), float(rng.uniform(0.3, 3))
    start = [-0.3, float(rng.uniform(-1, 1)), 0.0, 0.0, float(rng.uniform(0.1, 0.5)), 0.0]
    grid = np.linspace(0.0, 3.0, 61)
    scene = grasp(start, 3.0, left=arm, contact=contact, mass=mass)
    reference = integrate(scene, grid, digits=16)
    result = run(grasp_of(scene), start, 3.0, grid)
    done(result)
    for side in (LEFT, RIGHT):
        begins, ends = contacts(result.integrator.events, side)
        assert len(begins) == len(reference.touches[side])
        assert len(ends) == len(reference.releases[side])
    assert np.abs(result.states - reference.as_array()).max() < 1e-10

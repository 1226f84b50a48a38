"""What decides the hard cases, on more scenes than their table shows."""

from __future__ import annotations

import pytest
from oracles import ELASTIC, STANDARD

from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.cases.case import Product
from lab.cases.horizons import balances
from lab.cases.scenes import grasp, library
from lab.cases.touches import SYMMETRIC, symmetric
from lab.oracles.metamorphic import reversal

AT_REST = (-0.3, 0.0, 0.0, 0.0, 0.5, 0.0)
CLAMPED = grasp((-0.3, 0.0, 0.0, 0.0, 0.2, 0.0), 5.0, contact=Contact(1e3, 15.0), mass=1.0)


@pytest.mark.parametrize(
    "scene",
    [
        *(library(name, 20.0) for name in ("case_05", "case_06", "case_08", "case_10", "case_11")),
        CLAMPED,
        grasp(AT_REST, 1.0, mass=1e-4),
    ],
)
def test_balances_of_momentum_and_energy(scene: Scene) -> None:
    """O3."""
    assert balances(scene, 16, Product()) <= 1.0


@pytest.mark.parametrize("arm", [STANDARD, ELASTIC, Arm(1.0, 10.0, 0.2, 50.0, 5.0)])
@pytest.mark.parametrize("p", [0.0, 0.1, 10.0])
def test_a_symmetric_scene_keeps_the_object_at_zero_whatever_its_mass(arm: Arm, p: float) -> None:
    """O5; the step size knows the object's mass through its scales only, so the arms move alike to rounding."""
    product = Product()
    for mass in (5.0, 0.5, 512.0):
        assert symmetric(arm, p, mass, product) == 0.0
    first, *others = (run.state for run in product.runs)
    assert abs(first[0] - SYMMETRIC).max() == 0.0
    for other in others:
        assert abs(other - first).max() < 1e-10


def test_a_release_at_rest_runs_backwards() -> None:
    """O8."""
    product = Product()
    assert reversal(grasp(AT_REST, 5.0, left=ELASTIC, contact=Contact(1e4, 0.0)), product) < 1e-9
    assert len(product.runs[0].events) > 5

"""What decides the hard cases, on more scenes than their table shows."""

from __future__ import annotations

import pytest
from oracles import CASES, ELASTIC, STANDARD

from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.cases.case import Product
from lab.cases.horizons import balances
from lab.cases.impacts import impact_error
from lab.cases.modes import STARTS
from lab.cases.scenes import grasp, library
from lab.cases.touches import SYMMETRIC, symmetric
from lab.oracles.metamorphic import mirror, reversal, scaling

AT_REST = (-0.3, 0.0, 0.0, 0.0, 0.5, 0.0)
CLAMPED = grasp((-0.3, 0.0, 0.0, 0.0, 0.2, 0.0), 5.0, contact=Contact(1e3, 15.0), mass=1.0)
UNEQUAL = {"left_contact.hertz_N_per_m1_5": 3e3, "left_contact.dissipation_s_per_m": 0.2}


@pytest.mark.parametrize(
    ("m1", "m2", "hertzian", "loss", "speed"),
    [
        (1.0, 1.0, 1e4, 0.3, 1.0),
        (2.0, 3.0, 1e9, 0.005, 0.01),
        (1.0, 1e-3, 1e5, 30.0, 3.0),
        (1.0, 1.0, 1e4, 1e-8, 1.0),
        (1e-6, 1.0, 1e4, 0.1, 1.0),
        (1e6, 1.0, 1e4, 0.1, 1.0),
        (1.0, 1.0, 1e4, 0.1, 1e8),
        (1.0, 1.0, 1e4, 3e-9, 1e-8),
        (1.0, 1.0, 1e4, 3e-21, 1e-20),
        (1.0, 1.0, 1e-3, 0.1, 1.0),
        *((1.0, 1.0, 1e4, 0.0, 10.0**k) for k in (8, -8, -12, -16, -18, -20, -22, -24, -30)),
    ],
)
def test_impacts_of_other_bodies_and_speeds(m1: float, m2: float, hertzian: float, loss: float, speed: float) -> None:
    """O1 and O2."""
    assert impact_error(m1, m2, hertzian, (loss,), speed, Product()) <= 1e-12


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


@pytest.mark.parametrize("name", CASES)
def test_mirror_images_of_the_papers_cases_with_unequal_sides(name: str) -> None:
    """O6."""
    scene = library(name, 10.0)
    mass = 1.25 * scene.values["left_arm"]["mass_kg"]
    assert mirror(scene.changed({**UNEQUAL, "left_arm.mass_kg": mass}), Product()) == 0.0


@pytest.mark.parametrize("name", STARTS)
def test_mirror_images_of_the_starts(name: str) -> None:
    """O6."""
    assert mirror(grasp(STARTS[name], 1.0, mass=2.0), Product()) == 0.0


@pytest.mark.parametrize("units", [(4.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 8.0), (4.0**-3, 2.0**5, 0.25)])
@pytest.mark.parametrize("scene", [library("case_01", 10.0), library("case_06", 10.0), CLAMPED])
def test_other_units(scene: Scene, units: tuple[float, float, float]) -> None:
    """O7."""
    assert scaling(*units, scene, Product()) == 0.0


def test_a_release_at_rest_runs_backwards() -> None:
    """O8."""
    product = Product()
    assert reversal(grasp(AT_REST, 5.0, left=ELASTIC, contact=Contact(1e4, 0.0)), product) < 1e-9
    assert len(product.runs[0].events) > 5

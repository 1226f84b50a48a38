"""Pairs at u' = -1/p, where their force ends."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exact.bench import bench
from oracles import FREE

from grasp_ros.exact.automaton.clamp_surface import glides, has_glided, surface_side
from grasp_ros.exact.automaton.modes import leave_gliding
from grasp_ros.exact.automaton.resting_pair import impact_beside
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.kinematics import other
from grasp_ros.exact.tolerances import SURFACE
from grasp_ros.physics.layout import LEFT, RIGHT, Body, Pair, Work
from grasp_ros.physics.model import Contact
from lab.reference.grasp import Grasp, system_of

SIDES = pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])


@SIDES
@pytest.mark.parametrize(
    ("options", "expected"),
    [({}, True), ({"beside_mode": Pair.LEAVING}, True), ({"beside_mode": Pair.CLAMPED, "beside": (0.01, -9.0)}, True),
     ({"beside_mode": Pair.CLAMPED, "beside": (0.01, -9.0), "beside_push": 1.0}, False),
     ({"beside_mode": Pair.CONTACT, "beside": (0.01, -2.0)}, True),
     ({"beside_mode": Pair.CONTACT, "beside": (0.01, -2.0), "beside_push": 1.0}, False),
     ({"beside_mode": Pair.CONTACT, "beside": (0.01, -1.0)}, False), ({"push": 1.0}, False),
     ({"push": 1.0, "object_push": 1.0}, True),
     ({"stiffness": 1e-3}, False)],
)
def test_a_pair_glides_where_nothing_moves_it(side: Body, options: dict[str, Any], expected: bool) -> None:
    b = bench(side, 0.01, -2.0, Pair.CONTACT, **options)
    assert glides(b.plant, b.state, side) is expected


@SIDES
@pytest.mark.parametrize(("options", "expected"), [
    ({"push": 1.0}, 1.0), ({"push": -1.0}, -1.0), ({}, 0.0),
    ({"push": 0.003, "stiffness": 0.3}, 0.6),  # k x balances it but for rounding; k u' does not
    ({"push": 0.003 * (1.0 + 1e-15), "stiffness": 0.3}, 0.6),
    ({"push": 0.003 * (1.0 - 1e-15), "stiffness": 0.3}, 0.6),
    ({"beside": (0.01, -2.0), "beside_mode": Pair.CONTACT}, 0.0),  # it glides, too
    ({"beside": (0.01, 0.0), "beside_mode": Pair.CONTACT}, 10.0),  # it pushes the object
])
def test_the_first_derivative_beyond_its_rounding_decides(side: Body, options: dict[str, Any], expected: float) -> None:
    b = bench(side, 0.01, -2.0, Pair.CONTACT, **options)
    assert surface_side(b.plant, b.state, side) == pytest.approx(expected)


@SIDES
def test_beyond_rounding_the_speed_decides(side: Body) -> None:
    assert surface_side(*bench(side, 0.01, -1.9, Pair.CONTACT, push=-5.0)[:2], side) == pytest.approx(0.05)
    assert surface_side(*bench(side, 0.01, -2.1, Pair.CONTACT, push=5.0)[:2], side) == pytest.approx(-0.05)


@SIDES
def test_beyond_the_third_derivative_only_bodies_without_an_impact_beside_are_known(side: Body) -> None:
    """Of the pair and its bodies the second and the third vanish, of the arm alone the fourth does not."""
    k, a, u = 0.3, 0.7, 0.01
    alone: dict[str, Any] = {"stiffness": k, "push": a + k * u, "object_push": a, "object_speed": 2.0}
    b = bench(side, u, -2.0, Pair.CONTACT, **alone)
    assert surface_side(b.plant, b.state, side) == pytest.approx(-k * a)
    beside = {"beside": (u, 0.0), "beside_mode": Pair.CONTACT, "beside_push": a - 20.0}
    pressed = {**alone, **beside, "push": a + k * u - 10.0}
    b = bench(side, u, -2.0, Pair.CONTACT, **pressed)
    push, pace = impact_beside(b.plant, b.state, side)
    assert (abs(push), pace) == (pytest.approx(10.0), pytest.approx(0.0, abs=1e-9))
    assert surface_side(b.plant, b.state, side) == 0.0
    glides_beside = {**alone, "beside": (u, -2.0), "beside_mode": Pair.CONTACT, "beside_push": 5.0}
    b = bench(side, u, -2.0, Pair.CONTACT, **glides_beside)
    push, pace = impact_beside(b.plant, b.state, side)
    assert push == 0.0
    b = bench(side, u, -2.0, Pair.CONTACT, **{**glides_beside, "object_speed": 2.0 + pace / k})
    assert surface_side(b.plant, b.state, side) == 0.0


@SIDES
@pytest.mark.parametrize(("d", "options", "expected"), [
    (-2.0, {}, True), (-1.0, {}, False), (-2.0, {"push": 1.0}, False)])
def test_a_pair_has_glided_at_the_surface_alone(side: Body, d: float, options: dict[str, Any], expected: bool) -> None:
    b = bench(side, 0.01, d, Pair.CONTACT, **options)
    assert bool(has_glided(b.plant, b.state, side, SURFACE)) is expected


@SIDES
@pytest.mark.parametrize(("d", "options", "expected"), [
    (-2.0, {}, Pair.LEAVING), (-1.0, {}, Pair.CONTACT), (-2.0, {"push": 1.0}, Pair.CONTACT)])
def test_a_pair_in_contact_leaves_where_nothing_moves_it(side: Body, d: float, options: dict[str, Any], expected: Pair
                                                         ) -> None:
    b = bench(side, 0.01, d, Pair.CONTACT, **options)
    leave_gliding(b.plant, b.state)
    assert (b.mode(side), b.mode(other(side)), b.events) == (expected, Pair.OPEN, [])


@SIDES
@pytest.mark.parametrize("mode", [mode for mode in Pair if mode not in (Pair.CONTACT, Pair.LEAVING)])
def test_only_a_pair_in_contact_leaves(side: Body, mode: Pair) -> None:
    b = bench(side, 0.01, -2.0, mode)
    leave_gliding(b.plant, b.state)
    assert b.mode(side) is mode


@pytest.mark.parametrize(("p", "masses", "state"), [
    ((1.5, 0.75), (1.0, 0.1, 1.0), (1.0, -2.0 / 3.0, 0.0, 0.0, -1.0, 4.0 / 3.0)),  # both glide
    ((0.1, 0.31), (1.0, 0.5, 1.68), (0.1, -19.679, 0.0, 0.321, -0.05, 0.321 + 1.0 / 0.31)),  # beside a clamped one
])
def test_pairs_that_nothing_moves_glide_without_events(p: Any, masses: Any, state: Any) -> None:
    m_l, m_o, m_r = masses
    grasp = Grasp(FREE._replace(mass=m_l), FREE._replace(mass=m_r), Contact(1e5, p[0]), Contact(1e5, p[1]), m_o)
    for gravity in (0.0, 9.81):
        integrator = Integrator(system_of(grasp, np.array(state)), continuous=False)
        integrator.set_input(gravity * np.array([m_l, m_r, m_o]))
        integrator.advance(0.004)
        assert integrator.status is Status.DONE
        assert integrator.work[Work.CONTACT_STEPS] < 10
        assert integrator.events == []

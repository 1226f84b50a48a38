"""Contacts that rounding has taken: which of them begin anew."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exact.bench import Bench, bench, bits

from grasp_ros.exact.anew import begin_anew
from grasp_ros.exact.kinematics import other, velocity_lane
from grasp_ros.physics.layout import DISSIPATION, HERTZIAN, LEFT, RIGHT, U_L, X_O, Body, Pair

SIDES = pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
PUSHES = {"beside": (0.01, 0.0), "beside_mode": Pair.CONTACT, "beside_p": 0.0}  # at an instant
BEGINS_TO_PUSH = {"beside": (0.01, -2.0), "beside_mode": Pair.CONTACT}  # u' = -1/p


def falling(side: Body, u: float, options: dict[str, Any]) -> Bench:
    """Arm and object that fall side by side, 1 m away from 0."""
    how = {"d": 0.0, "mode": Pair.CONTACT, "push": 1.0, "object_push": 1.0, **options}
    hertzian, loss = how.pop("hertzian", 1e4), how.pop("beside_p", 0.5)
    b = bench(side, u, **how)
    b.plant.pairs[side, HERTZIAN], b.plant.pairs[other(side), DISSIPATION] = hertzian, loss
    b.state.y[[velocity_lane(side) - 1, X_O]] = 1.0 + u, 1.0
    return b


def place(b: Bench, side: Body) -> tuple[float, float]:
    """Where an arm is, and its u."""
    return float(b.state.y[velocity_lane(side) - 1]), float(b.state.y[U_L + side])


@SIDES
@pytest.mark.parametrize(("u", "options", "anew"), [
    (1e-17, {}, True), (1e-15, {}, False), (0.0, {}, False), (1e-17, {"d": 1e-18}, False),
    (1e-17, {"mode": Pair.CLAMPED}, False), (1e-17, {"push": 1.001}, False), (1e-17, {"push": 0.999}, False),
    (1e-17, {"hertzian": 1e15}, False), (1e-17, PUSHES, False), (1e-17, BEGINS_TO_PUSH, False)])
def test_a_contact_of_which_only_rounding_is_left_begins_anew(side: Body, u: float, options: dict[str, Any],
                                                              anew: bool) -> None:
    """With u below or above the rounding of its place."""
    b = falling(side, u, options)
    begin_anew(b.plant, b.state)
    assert place(b, side) == ((1.0, 0.0) if anew else (1.0 + u, u))


@SIDES
@pytest.mark.parametrize(("u", "anew"), [(1e-17, True), (1e-15, False)])
def test_a_push_of_a_pair_that_is_lost_too_is_rounding(side: Body, u: float, anew: bool) -> None:
    """Both begin anew; one that is beside a pair with digits does not."""
    b = falling(side, 1e-17, {"beside": (u, 0.0), "beside_mode": Pair.CONTACT, "beside_push": 1.0})
    b.state.y[velocity_lane(other(side)) - 1] = 1.0 - u
    begin_anew(b.plant, b.state)
    assert [place(b, one)[1] for one in (side, other(side))] == ([0.0, 0.0] if anew else [1e-17, u])


@pytest.mark.parametrize("u", [1e-17, 1e-15])
def test_neither_side_is_asked_first(u: float) -> None:
    images = []
    for side in (LEFT, RIGHT):
        b = falling(side, 1e-17, {"beside": (u, 0.0), "beside_mode": Pair.CONTACT, "beside_push": 1.0})
        begin_anew(b.plant, b.state)
        images.append(np.array([place(b, side), place(b, other(side))]))
    assert bits(np.abs(images[0])) == bits(np.abs(images[1]))

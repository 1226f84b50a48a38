"""Positions as pairs of doubles: what roundings leave out does not add up, and u has digits of its own."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from exact.bench import SIDES, bench

from grasp_ros.exact.compensated import add, meet, move_arm_in_contact, move_in_flight, two_sum, write_penetrations
from grasp_ros.exact.records import Flown, State
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Body, Pair, U, V, X

STEPS, WAY = 1000, 200.4 * EPS  # each sum leaves out 0.4 of its rounding, in the same direction
LANE: dict[int, int] = {LEFT: X.L, OBJECT: X.O, RIGHT: X.R}


def state_at(side: Body, x_o: float, u: float) -> State:
    """An arm and the object, with u between them."""
    state = bench(side, u, 0.0, Pair.CONTACT).state
    state.y[LANE[side]], state.y[X.O] = x_o + (u if side == LEFT else -u), x_o
    return state


def position(state: State, body: Body) -> Fraction:
    """Where a body is."""
    return Fraction(float(state.y[LANE[body]])) + Fraction(float(state.low[LANE[body]]))


def test_a_sum_of_two_leaves_nothing_out() -> None:
    rng = np.random.default_rng(1)
    for a, b in rng.normal(size=(100, 2)) * 10.0 ** rng.uniform(-20, 20, (100, 2)):
        total, rest = two_sum(float(a), float(b))
        assert total == a + b
        assert Fraction(total) + Fraction(rest) == Fraction(float(a)) + Fraction(float(b))
        assert two_sum(-float(a), -float(b)) == (-total, -rest)


@pytest.mark.parametrize("body", [LEFT, OBJECT, RIGHT], ids=["left", "object", "right"])
def test_a_body_goes_as_far_as_many_equal_steps(body: Body) -> None:
    state = bench(LEFT, -1.0, 0.0).state
    state.y[LANE[body]] = 1.0
    for _ in range(STEPS):
        move_in_flight(state, body, Flown(math.nan, math.nan, WAY, 0.0))
    assert abs(position(state, body) - 1 - STEPS * Fraction(WAY)) <= Fraction(EPS) ** 2
    assert abs(state.low[LANE[body]]) <= 0.5 * EPS * state.y[LANE[body]]


def test_a_way_that_is_not_known_puts_a_body_to_its_end() -> None:
    state = bench(LEFT, -1.0, 0.0).state
    state.low[[X.O, V.O]] = 1e-17
    move_in_flight(state, OBJECT, Flown(2.0, 3.0, math.nan, math.nan))
    assert (state.y[X.O], state.y[V.O], state.low[X.O], state.low[V.O]) == (2.0, 3.0, 0.0, 0.0)


@SIDES
@pytest.mark.parametrize("way_w", [-0.3, -1e-3, 1e-3, 0.2])
def test_an_arm_in_contact_is_where_object_and_depth_are(side: Body, way_w: float) -> None:
    """u = w^2, by its way where that is short and by its end otherwise; the object moves first."""
    w, way_o, sign = 0.4, 0.125, 1 if side == LEFT else -1
    state = state_at(side, 0.0, (w - way_w) ** 2)
    write_penetrations(state)
    begun = position(state, side) - position(state, OBJECT)
    add(state, X.O, way_o)
    move_arm_in_contact(state, side, way_o, w, way_w)
    write_penetrations(state)
    u = sign * (position(state, side) - position(state, OBJECT))
    assert abs(float(u) - w * w) <= 4.0 * EPS * max(w * w, abs(float(begun)))
    assert state.y[U.L + side] == pytest.approx(float(u), rel=EPS, abs=0.0)


@SIDES
def test_a_shallow_depth_keeps_its_digits(side: Body) -> None:
    """Far from 0 and far below a rounding of the position."""
    state = state_at(side, 0.7, 0.0)
    move_arm_in_contact(state, side, 0.0, 1e-9, 1e-9)
    write_penetrations(state)
    assert state.y[U.L + side] == pytest.approx(1e-18, rel=1e-13, abs=0.0)
    assert state.y[LANE[side]] == 0.7


@SIDES
def test_an_arm_that_meets_the_object_is_where_that_is(side: Body) -> None:
    state = state_at(side, 3.0, 1e-3)
    state.low[X.O], state.low[LANE[side]] = 1e-17, 3e-17
    meet(state, side)
    assert state.y[U.L + side] == 0.0
    assert (state.y[LANE[side]], state.low[LANE[side]]) == (3.0, 1e-17)
    write_penetrations(state)
    assert state.y[U.L + side] == 0.0

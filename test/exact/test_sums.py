"""Places that many short steps move on: what roundings leave out does not add up."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from exact.bench import bench

from grasp_ros.exact.records import State
from grasp_ros.exact.sums import add_ways, forget
from grasp_ros.physics.layout import EPS, LANES, LEFT, RIGHT, U_L, U_R, X_O, Body, Pair

STEPS, WAY = 1000, 200.4 * EPS  # each sum leaves out 0.4 of its rounding, in the same direction


def state_of(u_l: float, u_r: float, x_o: float) -> State:
    """Where both pairs touch."""
    state = bench(LEFT, u_l, 0.0, Pair.CONTACT, beside=(u_r, 0.0), beside_mode=Pair.CONTACT).state
    state.y[X_O] = x_o
    return state


def lanes(state: State, ways: dict[int, float]) -> np.ndarray:
    """Values of the lanes after these ways, and the ways: those of u are of w = sqrt(u)."""
    at = np.zeros(2 * LANES)
    for lane, way in ways.items():
        begin = state.y[lane] if lane == X_O else np.sqrt(state.y[lane])
        at[lane], at[LANES + lane] = begin + way, way
    return at


def test_an_object_goes_as_far_as_many_equal_steps() -> None:
    state = state_of(1.0, 1.0, 1.0)
    for _ in range(STEPS):
        add_ways(state, lanes(state, {X_O: WAY, U_L: 0.0, U_R: 0.0}), True, True)
    exact = Fraction(1.0) + STEPS * Fraction(WAY)
    assert abs(float(Fraction(state.y[X_O]) - exact)) <= 0.5 * EPS * 1.001


@pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
def test_a_depth_goes_as_far_as_many_equal_steps(side: Body) -> None:
    """Its lane is the root, whose ways are half as long."""
    state, u = state_of(1.0, 1.0, 0.0), U_L + side
    for _ in range(STEPS):
        add_ways(state, lanes(state, {X_O: 0.0, U_L: 0.0, U_R: 0.0, u: -0.5 * WAY}), True, True)
    assert abs(float(Fraction(state.y[u]) - (1 - Fraction(WAY) / 2 * STEPS) ** 2)) <= EPS


def test_a_pair_that_does_not_touch_is_where_its_lane_says() -> None:
    state = state_of(0.5, 0.5, 0.0)
    state.carry[U_L] = state.carry[U_R] = 1e-18
    at = lanes(state, {X_O: 0.0, U_R: 0.0})
    at[U_L], at[LANES + U_L] = -0.1, 1e-17
    add_ways(state, at, False, True)
    assert (state.y[U_L], state.carry[U_L]) == (-0.1, 0.0)
    assert state.carry[U_R] == 1e-18


def test_a_long_way_begins_a_sum_anew() -> None:
    state = state_of(1.0, 1.0, 1.0)
    state.carry[X_O] = 1e-17
    add_ways(state, lanes(state, {X_O: -0.9, U_L: 0.0, U_R: 0.0}), True, True)
    assert (state.y[X_O], state.carry[X_O]) == (1.0 - 0.9, 0.0)


def test_nothing_is_left_once_it_is_forgotten() -> None:
    state = state_of(1.0, 1.0, 1.0)
    state.carry[:] = 1e-17
    forget(state)
    assert not state.carry.any()

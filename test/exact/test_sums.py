"""Places that many short steps move on: what roundings leave out does not add up."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from exact.bench import bench

from grasp_ros.exact.records import State
from grasp_ros.exact.sums import add, add_ways, forget, meet
from grasp_ros.physics.layout import EPS, LANES, LEFT, RIGHT, U_L, U_R, X_L, X_O, X_R, Body, Pair, Work
from grasp_ros.scene import compose
from grasp_ros.simulation import Trajectory, simulate

LOSS = 257.665  # s/m
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


@pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
def test_a_gap_goes_as_far_as_many_equal_steps(side: Body) -> None:
    """Its lane is u itself; the arm, which is where object and gap say, does not drift."""
    state, u = state_of(1.0, 1.0, 1.0), U_L + side
    state.y[u] = -1.0
    for _ in range(STEPS):
        at = lanes(state, {X_O: WAY, U_L + 1 - side: 0.0})
        at[u], at[LANES + u] = state.y[u] - WAY, -WAY
        add_ways(state, at, side != LEFT, side != RIGHT)
    assert state.y[X_O] + state.y[u] == 0.0
    assert abs(float(Fraction(state.y[u]) + 1 + STEPS * Fraction(WAY))) <= 0.5 * EPS * 1.001


def test_a_depth_goes_as_far_as_a_long_way_of_its_root() -> None:
    """The square of the way counts, on either side of what is added up."""
    for way in (0.05, -0.05, 0.3):
        state = state_of(1.0, 1.0, 0.0)
        add_ways(state, lanes(state, {X_O: 0.0, U_L: way, U_R: 0.0}), True, True)
        assert state.y[U_L] == pytest.approx((1.0 + way) ** 2, rel=EPS, abs=0.0)


def test_a_way_that_is_not_known_begins_a_sum_anew() -> None:
    state = state_of(1.0, 1.0, 1.0)
    state.carry[X_O] = 1e-17
    add(state, X_O, math.nan, 2.0)
    assert (state.y[X_O], state.carry[X_O]) == (2.0, 0.0)


@pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
def test_an_arm_that_meets_the_object_is_where_that_is(side: Body) -> None:
    state, x = state_of(1.0, 1.0, 3.0), X_L if side == LEFT else X_R
    state.carry[X_O], state.carry[U_L + side], state.carry[x] = 1e-17, 2e-17, 3e-17
    meet(state, side)
    assert (state.y[U_L + side], state.carry[U_L + side]) == (0.0, 0.0)
    assert (state.y[x], state.carry[x]) == (3.0, 1e-17)


def flutters(horizon: float) -> Trajectory:
    """An arm that glides at u' = -1/p and clamps and re-enters by turns; the other one, 0.3 m away, rests."""
    wall = {"mass_kg": 412912.0, "stiffness_N_per_m": 0.0, "damping_Ns_per_m": 22.2187, "position_m": 0.7005545,
            "velocity_m_per_s": -0.00013211976}
    scene = compose("flutter", {
        "object": {"mass_kg": 0.0045215, "position_m": 0.7, "velocity_m_per_s": 0.0}, "left_arm": wall,
        "right_arm": {"mass_kg": 1.0, "stiffness_N_per_m": 0.0, "damping_Ns_per_m": 0.0, "position_m": 1.0,
                      "velocity_m_per_s": 0.0},
        "left_contact": {"hertz_N_per_m1_5": 4.657e12, "dissipation_s_per_m": LOSS},
        "right_contact": {"hertz_N_per_m1_5": 4.657e12, "dissipation_s_per_m": LOSS},
        "time": {"duration_s": horizon, "control_period_s": 1e-9},
    })
    return simulate(scene, grid=[0.0, horizon])


def test_thousands_of_flights_and_contacts_by_turns_leave_no_place_behind() -> None:
    """u' is -1/p but for a relaxation at the begin, which lasts for mu / (p H u^1.5)."""
    horizon = 9e-9
    run = flutters(horizon)
    relaxed = horizon - 0.0045215 / (LOSS * 4.657e12 * 0.0005545**1.5)
    assert run.work[Work.FLIGHTS] > 10_000
    assert run.state[-1, X_O] - 0.7 == pytest.approx((1.0 / LOSS - 0.00013211976) * relaxed, abs=4.0 * EPS)
    assert (run.state[-1, X_R], run.state[-1, X_R + 1]) == (1.0, 0.0)


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

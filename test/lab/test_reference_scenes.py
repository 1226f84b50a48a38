"""The high-precision oracle on scenes: friction, held and sampled forces, corners."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gmpy2
import numpy as np
import pytest
from documents import body, made
from gmpy2 import mpfr
from scipy.integrate import solve_ivp

from grasp_ros.physics.model import Contact, impact_force, penetration
from lab.cases.regression import load
from lab.oracles.closed_forms import impact
from lab.reference import integrate

FLAT = {"stiffness_N_per_m": 0.0, "damping_Ns_per_m": 0.0}
CONTACT = {"hertz_N_per_m1_5": 1e4, "dissipation_s_per_m": 0.0}


@pytest.fixture(autouse=True)
def _precision() -> Iterator[None]:
    with gmpy2.context(precision=200):
        yield


def close(found: Any, expected: Any, tolerance: str = "1e-24") -> bool:
    return bool(abs(mpfr(found) - mpfr(expected)) <= mpfr(tolerance))


def kinds(found: Any) -> list[tuple[int, str]]:
    return [(event.body, event.kind) for event in found.events]


def test_a_sliding_object_stops_where_the_closed_form_says() -> None:
    m, c, force, v = mpfr(2), mpfr(0.5), mpfr(0.25), mpfr(1.5)
    scene = made(20.0, object=body(2.0, 0.0, 1.5), object_friction={"viscous_Ns_per_m": 0.5, "coulomb_N": 0.25})
    found = integrate(scene, [0.0, 1.0, 20.0])
    decay = gmpy2.exp(-c / m)
    assert close(found.state[1][3], (v + force / c) * decay - force / c)
    assert [event.kind for event in found.events] == ["stop"]
    assert close(found.events[0].t, m / c * gmpy2.log1p(c * v / force))
    assert close(found.state[2][2], m / c * (v - force / c * gmpy2.log1p(c * v / force)))
    assert found.state[2][3] == 0


def test_an_object_that_a_force_pushes_back_turns_around() -> None:
    scene = made(
        2.0, object=body(1.0, 0.0, 1.0), object_friction={"coulomb_N": 1.0},
        object_table={"time_s": [0.0], "force_N": [-3.0]},
    )
    found = integrate(scene, [2.0])  # -4 m/s^2 to the right, -2 m/s^2 to the left
    assert kinds(found) == [(2, "stop")]
    assert close(found.state[0][3], mpfr(-2) * mpfr("1.75"))
    assert close(found.state[0][2], mpfr("0.125") - mpfr("1.75") ** 2)


def test_a_stuck_object_is_a_wall_until_it_slips() -> None:
    """O1 beside a wall."""
    scene = made(1.0, left_arm=body(1.0, -0.5, 1.0), object=body(3.0), left_contact=CONTACT,
                    object_friction={"coulomb_N": 1000.0})
    found = integrate(scene, [1.0])
    assert kinds(found) == [(0, "touch"), (0, "release")]
    assert close(found.releases[0][0] - found.touches[0][0], str(impact(1, 1e4, 0, 1).duration))
    assert close(found.state[0][1], -1)
    weak = integrate(scene.changed({"object_friction.coulomb_N": 0.5}), [1.0])
    assert (2, "slip") in kinds(weak)
    assert weak.state[0][3] > 0


def test_a_stuck_object_slips_when_it_is_pushed_at_a_tick() -> None:
    """F = 1 N: 5 N for 0.375 s give 8 m/s^2, then friction takes 2 m/s^2."""
    pulse = {"force_N": 5.0, "start_s": 0.25, "length_s": 0.375}
    scene = made(1.0, 0.125, left_arm=body(1.0, -1.0), object=body(0.5), left_contact=CONTACT,
                    object_friction={"coulomb_N": 1.0}, object_pulse=pulse)
    found = integrate(scene, [0.25, 0.625, 1.0])
    assert [[float(number) for number in row[2:4]] for row in found.state] == [
        [0.0, 0.0], pytest.approx([0.5625, 3.0]), pytest.approx([1.546875, 2.25])]
    assert [(event.body, event.kind) for event in found.events] == [(2, "slip")]


def test_forces_change_at_ticks() -> None:
    scene = made(1.0, 0.25, left_arm=body(2.0), left_arm_pulse={"force_N": 8.0, "start_s": 0.25, "length_s": 0.5})
    found = integrate(scene, [0.25, 0.5, 1.0])
    assert [row[:2] for row in found.state] == [(0, 0), (mpfr("0.125"), 1), (1, 2)]


def test_ticks_are_whole_nanoseconds() -> None:
    """As a float 5.02 s is less by 4e-16 s, and the speed would be by 3e-14 m/s."""
    scene = made(6.0, 0.01, object=body(0.5), object_pulse={"force_N": 30.0, "start_s": 5.0, "length_s": 0.02})
    found = integrate(scene, [5.0, 6.0])
    assert found.state[0][3] == 0
    assert close(found.state[1][3], "1.2")


@pytest.mark.parametrize("delay", [0, 2])
def test_a_sampled_arm_follows_its_recursion(delay: int) -> None:
    gains = {"position_gain_N_per_m": 5.0, "velocity_gain_Ns_per_m": 2.0, "set_point_m": 0.5}
    scene = made(2.0, 0.125, left_arm=body(4.0, 1.0, -0.5), left_feedback=gains, loop={"delay_ticks": delay})
    x, v, h = mpfr(1), mpfr("-0.5"), mpfr("0.125")
    waiting = [mpfr(0)] * delay
    for _ in range(scene.ticks):
        waiting.append(-5 * (x - mpfr("0.5")) - 2 * v)
        a = waiting.pop(0) / 4
        x, v = x + v * h + a * h * h / 2, v + a * h
    found = integrate(scene, [2.0])
    assert close(found.state[0][0], x)
    assert close(found.state[0][1], v)


def test_what_falls_together_never_meets() -> None:
    scene = made(10.0, left_arm=body(1.0), object=body(0.5), left_contact=CONTACT,
                    tilt={"angle_rad": -0.5, "gravity_m_per_s2": 9.81})
    found = integrate(scene, [5.0, 10.0])
    assert found.events == []
    assert found.state[1][0] == found.state[1][2] > 100


@pytest.mark.parametrize(("push", "together"), [(1.0, True), (-1.0, False)])
def test_the_first_derivative_that_differs_decides(push: float, together: bool) -> None:
    feedback = {"position_gain_N_per_m": 0.0, "velocity_gain_Ns_per_m": 0.0, "feed_forward_N": push}
    scene = made(0.5, left_arm=body(1.0, **FLAT), object=body(1.0), left_contact=CONTACT, left_feedback=feedback)
    found = integrate(scene, [0.5])
    x, v, x_o, v_o = found.state[0][:4]
    assert close(v + v_o, mpfr(push) / 2)
    assert close(x + x_o, mpfr(push) / 8)
    assert (x_o > 0) == together
    assert bool(found.touches[0]) == together


@pytest.mark.slow
@pytest.mark.parametrize("name", ["through_the_finger", "together", "rest_on_a_slope", "touching_chain",
                                  "a_finger_rests", "tiny_gap_pulse_1", "pressed_for_a_moment"])
@pytest.mark.thorough
def test_more_digits_change_nothing(name: str) -> None:
    scene = load(name)
    times = [scene.duration / 3, scene.duration]
    few, many = integrate(scene, times, digits=25), integrate(scene, times, digits=35)
    assert all(
        close(a, b, "1e-22") for left, right in zip(few.state, many.state, strict=True)
        for a, b in zip(left, right, strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["together", "rest_on_a_slope", "touching_chain"])
def test_a_general_integrator_agrees(name: str) -> None:
    """The equations of motion as the model writes them, without modes and events."""
    scene = load(name)
    bodies, pairs = scene.system.closed_loop, [Contact(*row) for row in scene.system.pairs]

    def slope(_: float, y: Any) -> Any:
        u_l, d_l, u_r, d_r = penetration(y)
        left, right = impact_force(pairs[0], u_l, d_l), impact_force(pairs[1], u_r, d_r)
        total = [
            force - stiffness * x - damping * v + impact
            for (_, stiffness, damping, force), x, v, impact in zip(
                bodies[[0, 2, 1]], y[::2], y[1::2], (-left, left - right, right), strict=True
            )
        ]
        return np.ravel(np.column_stack([y[1::2], np.array(total) / bodies[[0, 2, 1], 0]]))

    general = solve_ivp(slope, (0.0, scene.duration), scene.initial_state, "LSODA", rtol=1e-12, atol=1e-15)
    found = integrate(scene, [scene.duration]).as_array()[0]
    assert np.abs(general.y[:, -1] - found).max() < 1e-7 * np.abs(found).max()


def test_a_budget_ends_a_run_where_it_is() -> None:
    scene = load("touching_chain")
    found = integrate(scene, [0.0, 1e-6, scene.duration], budget=100)
    assert len(found.state) == len(found.t) < 3

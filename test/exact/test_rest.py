"""Motions that come to rest: when, that nothing is lost by it, and what never rests."""

from __future__ import annotations

import math

import numpy as np
import pytest
from documents import body, horizon, made

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.tolerances import REST
from grasp_ros.physics.layout import Transition
from grasp_ros.simulation import simulate

NEAR_CRITICAL = {
    f"{side}_{key}": value for side, kp, kv in (("left", 50.0, 14.142), ("right", 100.0, 42.426)) for key, value in (
        ("arm.stiffness_N_per_m", 0.0), ("arm.damping_Ns_per_m", 0.0), ("feedback.position_gain_N_per_m", kp),
        ("feedback.velocity_gain_Ns_per_m", kv))
}


@pytest.mark.parametrize("name", ["preload", "preload_feed_forward", "tilt_hold", "arm_alone", "friction"])
def test_what_rests_is_where_its_forces_balance_and_costs_nothing_more(name: str) -> None:
    short, long = simulate(horizon(name, 200.0)), simulate(horizon(name, 1e6))
    assert short.at_rest is not None
    assert long.at_rest == short.at_rest < 200.0
    assert long.work.tolist() == short.work.tolist()
    assert (long.state[-1] == short.state[-1]).all() or np.isnan(long.state[-1]).any()
    before = simulate(horizon(name, 200.0), grid=[short.at_rest, 200.0]).state
    assert np.nanmax(np.abs(before[0] - before[1])) <= 8.0 * REST


@pytest.mark.parametrize("place", [0.0, 1e-12, 0.001])
def test_a_motion_that_begins_with_little_energy_comes_to_rest(place: float) -> None:
    run = simulate(made(100.0, 0.1, tilt={"angle_rad": 0.2, "gravity_m_per_s2": 9.81},
                        left_arm=body(x=place, stiffness_N_per_m=100.0, damping_Ns_per_m=10.0)))
    assert run.at_rest is not None
    assert 4.0 < run.at_rest < 20.0
    assert run.state[-1, 0] == pytest.approx(-9.81 * math.sin(0.2) / 100.0, rel=1e-15)


def test_what_creeps_does_not_rest() -> None:
    """A damper that balances a spring is no rest."""
    scene = made(1e5, 100.0, loop={}, left_arm=body(1e-12, 1.0, stiffness_N_per_m=100.0, damping_Ns_per_m=1e10),
                 left_feedback={"position_gain_N_per_m": 0.0, "velocity_gain_Ns_per_m": 0.0})
    assert simulate(scene, grid=[1e5]).state[-1, 0] == pytest.approx(math.exp(-1e-3), rel=1e-13)


@pytest.mark.parametrize("horizon", [50.0, 200.0, 1e4])
def test_a_decayed_motion_near_critical_damping_rests(horizon: float) -> None:
    """Also where gaps are 1e-310 m."""
    run = simulate(scenes.load("case_01").changed({"time.duration_s": horizon, **NEAR_CRITICAL}))
    assert run.status.name == "DONE"
    assert run.at_rest is not None
    assert run.events == []
    assert np.abs(run.state[-1]).max() < 1e-15


@pytest.mark.parametrize(("name", "seconds", "settings"), [
    *((name, 20.0, ()) for name in ("case_01", "case_02", "hammer", "no_contact")),
    ("hammer", 1e6, ()),  # however slowly it drifts: over the horizon it comes farther than a rounding
    ("arm_alone", 1e5, ("left_arm.damping_Ns_per_m=0", "left_feedback.velocity_gain_Ns_per_m=0")),
])
def test_what_still_moves_does_not_rest(name: str, seconds: float, settings: tuple[str, ...]) -> None:
    assert simulate(horizon(name, seconds, *settings)).at_rest is None


def test_a_pulse_wakes_what_rests() -> None:
    """Only rest behind the last change of an input is for good."""
    run = simulate(horizon("pulse", 300.0))
    last = max(event.time for event in run.events if event.kind is Transition.TOUCH)
    assert run.at_rest is None or run.at_rest > last


def test_held_commands_rest_if_they_repeat() -> None:
    still = simulate(horizon("preload", 10.0), sampled=True)
    assert still.at_rest is not None
    assert np.ptp(still.state[still.t > still.at_rest], axis=0).max() == 0.0
    begin = round(still.at_rest / still.scene.time_of(1))
    for ticks, rests in ((begin, False), (begin + 1, True)):
        seconds = still.scene.time_of(ticks)
        assert (simulate(horizon("preload", seconds), sampled=True).at_rest == still.at_rest) == rests


def test_held_commands_that_may_change_do_not_rest() -> None:
    late = horizon("preload", 10.0, "loop.delay_ticks=5")
    change = {"left_feedback.set_point_m": 0.03}
    assert simulate(late).at_rest is not None
    assert simulate(late, changes={9996: change}).at_rest is None  # it arrives after the end
    assert simulate(horizon("preload", 10.0, "loop={}", "left_rate.period_ticks=9000")).at_rest is None
    for key, rests in (("position_noise_m=1e-30", False), ("position_step_m=1e-6", True)):
        measured = horizon("preload", 10.0, "loop={}", "left_sensor.noise_seed=1", f"left_sensor.{key}")
        assert (simulate(measured).at_rest is not None) == rests
    user = {"left": lambda tick, time, x, v: 0.0}
    assert simulate(horizon("preload", 100.0), controllers=user).at_rest is None


@pytest.mark.parametrize("hertzian", [1e-3, 1e6])
def test_an_arm_that_dies_out_in_contact_beside_one_that_swings_rests(hertzian: float) -> None:
    """Its swing falls to 1e-222 m in 30 ms: squares of it leave the range of numbers."""
    run = simulate(made(
        0.26, 0.01, object=body(0.35), object_friction={"coulomb_N": 7e4},
        left_arm=body(1e9, x=-1.0, stiffness_N_per_m=1e12),
        right_arm=body(500.0, x=1e-4, v=1.5, stiffness_N_per_m=1e12, damping_Ns_per_m=1.6e7),
        right_contact={"hertz_N_per_m1_5": hertzian, "dissipation_s_per_m": 0.016}))
    assert run.status is Status.DONE
    assert run.state[-1, 4:].tolist() == [0.0, 0.0]
    assert run.at_rest is None


def test_another_input_wakes_what_rests() -> None:
    integrator = Integrator(scenes.load("preload").system, continuous=True)
    integrator.advance(100.0)
    rested = integrator.at_rest
    assert rested is not None
    integrator.advance(100.0, start=100.0)
    assert integrator.at_rest == rested  # nothing has moved
    integrator.set_input(np.array([1.0, 0.0, 0.0]))
    integrator.advance(1.0, start=200.0)
    assert integrator.at_rest is None
    integrator.advance(100.0, start=201.0)
    assert integrator.at_rest is not None
    assert integrator.at_rest > 201.0

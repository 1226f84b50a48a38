"""The sampled loop: held commands, delay, limits, noise, numbers that change, and its stability."""

from __future__ import annotations

import itertools
from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from documents import STEPS, case_of, scene_of

from grasp_ros import scene as scenes
from grasp_ros.exact.driver import intervals as compiled
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics import control
from grasp_ros.physics.control import NO_NOISE
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import SampledPlant, simulate
from grasp_ros.simulation.sampled_plant import tick_of, tick_times
from lab.reference.grasp import feedback


def written_out(scene: Scene, delay: int = 0) -> tuple[Array, Array]:
    """States and commands at the ticks: commands wait in a list, around a plant that knows of no delay."""
    left, right = (scene.system.arm(side) for side in (LEFT, RIGHT))
    plant = SampledPlant(replace(scene.system, delay=0), scene.period_ns)
    waiting: deque[Array] = deque([np.zeros(3)] * delay)
    states, forces = [plant.state], []
    for _ in range(scene.ticks):
        x_l, v_l, _, _, x_r, v_r = plant.state
        forces.append((feedback(left, x_l, v_l), feedback(right, x_r, v_r)))
        waiting.append(np.array([*forces[-1], 0.0]))
        plant.step(waiting.popleft())
        assert plant.status is Status.DONE
        states.append(plant.state)
    return np.array(states), np.array(forces)


@pytest.mark.parametrize("name", ["case_01", "case_02", "case_05", "case_10"])
@pytest.mark.parametrize("period", [0.001, 0.01, 0.05])
def test_sampled_is_a_plain_loop_bit_for_bit(name: str, period: float) -> None:
    scene = case_of(name, 2.0, period)
    states, forces = written_out(scene)
    result = simulate(scene, sampled=True)
    assert np.array_equal(result.state, states)
    assert np.array_equal(result.command[:-1], forces)
    assert np.array_equal(result.t, tick_times(scene))
    assert result.sampled
    assert len(result.times(Transition.TOUCH, LEFT)) >= 1


@pytest.mark.parametrize("period", [0.001, 0.0123, 3e-9, 0.000976562, 0.1])
def test_the_tick_of_a_time_is_the_last_one_that_has_come(period: float) -> None:
    """Also one rounding before and after a tick; and without a table of all ticks, which may be too many."""
    scene = case_of("case_01", round(1000 * period, 9), period)
    ticks, times = np.arange(scene.ticks + 1), tick_times(scene)
    assert np.array_equal(tick_of(scene, times), ticks)
    assert np.array_equal(tick_of(scene, np.nextafter(times, np.inf)), ticks)
    assert np.array_equal(tick_of(scene, np.nextafter(times[1:], 0.0)), ticks[:-1])
    many = case_of("no_contact", 1e9, 1e-3)
    assert tick_of(many, np.array([0.0, 1.0, 1e9])).tolist() == [0, 1000, 10**12]


def test_sampled_between_ticks() -> None:
    scene = case_of(duration=1.0, period=0.01)
    ticks = simulate(scene, sampled=True)
    fine = simulate(scene, sampled=True, grid=np.sort(np.concatenate([ticks.t, np.linspace(0.0, 1.0, 1234)])))
    index = np.searchsorted(fine.t, ticks.t, side="left")
    assert np.array_equal(fine.t[index], ticks.t)
    assert np.abs(fine.state[index] - ticks.state).max() < 1e-14
    assert [e[1:3] for e in fine.events] == [e[1:3] for e in ticks.events]
    assert np.abs(np.diff(fine.state[:, 0])).max() < 0.01  # no jump between ticks


def test_sampled_approaches_continuous() -> None:
    errors = []
    for period in (0.004, 0.002, 0.001, 0.0005):
        scene = case_of(duration=1.0, period=period)
        grid = np.linspace(0.0, 1.0, 101)
        errors.append(
            np.abs(simulate(scene, sampled=True, grid=grid).state - simulate(scene, grid=grid).state)[:, 0].max()
        )
    ratios = [a / b for a, b in itertools.pairwise(errors)]
    assert all(1.6 < ratio < 2.5 for ratio in ratios)  # first order in the period
    assert errors[-1] > 1e-6


@pytest.mark.parametrize("delay", [0, 1, 2, 7])
def test_delay_is_a_list_of_waiting_commands(delay: int) -> None:
    scene = scene_of("delay", f"loop.delay_ticks={delay}", "time.duration_s=5.0")
    assert simulate(scene).state.tobytes() == written_out(scene, delay)[0].tobytes()


def test_saturation_limits_what_the_law_asks_for() -> None:
    motion = simulate(scenes.load("saturation"))
    asked = np.stack([-5.0 * motion.state[:, i] - 0.5 * motion.state[:, i + 1] for i in (0, 4)], axis=1)
    assert np.array_equal(motion.command, np.clip(asked, -1.0, 1.0))
    assert (np.abs(asked) > 1.0).any()


@pytest.mark.slow
def test_noise_is_seeded_and_as_large_as_it_says() -> None:
    smooth = scene_of("noise", "time.duration_s=60.0", without=STEPS)
    motion = simulate(smooth)
    assert simulate(smooth).state.tobytes() == motion.state.tobytes()
    other = simulate(smooth.changed({"left_sensor.noise_seed": 3}))
    assert other.state.tobytes() != motion.state.tobytes()
    noise = motion.command[:, 0] + 5.0 * motion.state[:, 0] + 0.5 * motion.state[:, 1]
    expected = np.hypot(5.0 * 0.002, 0.5 * 0.01)
    assert noise.std() == pytest.approx(expected, rel=0.02)
    assert abs(noise.mean()) < 5 * expected / np.sqrt(len(noise))
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.03
    right = motion.command[:, 1] + 5.0 * motion.state[:, 4] + 0.5 * motion.state[:, 5]
    assert abs(np.corrcoef(noise, right)[0, 1]) < 0.03


def test_a_sensor_leaves_a_number_as_it_is_whose_own_rounding_is_wider_than_its_step() -> None:
    scene = scene_of("arm_alone", "loop={}", "left_sensor.noise_seed=0", "left_sensor.position_step_m=1e-12",
                     "left_sensor.velocity_step_m_per_s=0.001")
    law = scene.system.laws[LEFT]
    for sense, row in ((control.measured, law.row.tolist()), (compiled.measured, law.row)):
        for x in (2.0**53 * 1e-12 * 1.01, 1e300, -1e300, np.inf, -np.inf):
            assert sense(row, NO_NOISE, x, 0.0) == (x, 0.0)
        assert np.isnan(sense(row, NO_NOISE, np.nan, np.nan)).all()
        below = 2.0**53 * 1e-12 * 0.99
        assert sense(row, NO_NOISE, below, -0.0016) == (1e-12 * round(below / 1e-12), 0.001 * round(-1.6))


def test_a_loop_that_grows_without_bound_ends_with_a_status() -> None:
    """Also where a sensor rounds what overflows; and nothing is printed on the way."""
    scene = scene_of("arm_alone", "time.duration_s=900", "time.control_period_s=0.5", "loop={}",
                     "left_feedback.velocity_gain_Ns_per_m=50", "left_sensor.noise_seed=1",
                     "left_sensor.velocity_step_m_per_s=1e-12")
    run = simulate(scene)
    assert run.status is Status.OUTSIDE
    assert "farther away or faster" in run.stop
    assert 1e9 < np.abs(run.state[:, :2]).max() <= 1e12


def test_changes_act_from_their_tick_on() -> None:
    scene = scenes.load("case_01", ["time.duration_s=2.0"])
    plain = simulate(scene, sampled=True)
    changed = simulate(scene, sampled=True, changes={700: {"left_feedback.position_gain_N_per_m": 50.0}})
    assert changed.state[:701].tobytes() == plain.state[:701].tobytes()
    assert changed.state[701, 1] != plain.state[701, 1]
    assert changed.command[700, 0] == -50.0 * plain.state[700, 0] - 0.5 * plain.state[700, 1]


@pytest.mark.parametrize(("changes", "sampled", "words"), [
    ({5: {"left_feedback.position_gain_N_per_m": 9.0}}, False, "continuous"),
    ({5: {"object.mass_kg": 9.0}}, True, "object.mass_kg at tick 5"),
    ({5: {"left_sensor.position_noise_m": 0.1}}, True, "left_sensor.position_noise_m at tick 5"),
])
def test_changes_that_no_graph_would_take_are_refused(changes: dict, sampled: bool, words: str) -> None:
    with pytest.raises(Refused, match=words):
        simulate(scenes.load("noise" if sampled else "case_01"), sampled=sampled, changes=changes)


@pytest.mark.parametrize("forces", [1.0, [1.0, 2.0], [1.0, np.nan, 0.0], "abc", np.zeros((3, 1)), None])
def test_forces_are_three_finite_numbers(forces: Any) -> None:
    scene = scenes.load("case_01")
    plant, integrator = SampledPlant(scene.system, scene.period_ns), Integrator(scene.system, continuous=False)
    for door in (plant.step, integrator.set_input):
        with pytest.raises(Refused, match=r"^(commands|forces): "):
            door(forces)
    for offsets in ([-1e-4], [2e-3], [1e-3, 5e-4]):
        with pytest.raises(Refused, match="offsets: "):
            plant.step(np.zeros(3), offsets)  # type: ignore[arg-type]
    assert plant.tick == 0
    assert plant.step((1, 2, np.float32(3)), [0.0, 1e-3]).shape == (2, 6)  # type: ignore[arg-type]

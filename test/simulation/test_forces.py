"""Set-points, constant forces and external ones."""

from __future__ import annotations

import numpy as np
import pytest
from documents import body, made, scene_of
from mpmath import mpf

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import closed_loop, simulate
from grasp_ros.simulation.sampled_plant import tick_times
from lab.oracles.closed_forms import holding_force


def squeeze(scene: Scene) -> tuple[float, float, float]:
    """Finger forces f_l, f_r and object position at rest, both fingers on the object, by Newton's method."""
    loop = scene.system.closed_loop
    (k_l, f_l), (k_r, f_r), pull = loop[LEFT, [1, 3]], loop[RIGHT, [1, 3]], loop[2, 3]
    (h_l, _), (h_r, _) = scene.system.pairs

    def residuals(q: Array) -> Array:
        x_l, x_o, x_r = q
        push_l, push_r = h_l * max(x_l - x_o, 0.0) ** 1.5, h_r * max(x_o - x_r, 0.0) ** 1.5
        return np.array([f_l - k_l * x_l - push_l, pull + push_l - push_r, f_r - k_r * x_r + push_r])

    q = np.array([0.008, 0.0, -0.008])
    for _ in range(60):
        jacobian = np.stack([(residuals(q + 1e-7 * e) - residuals(q - 1e-7 * e)) / 2e-7 for e in np.eye(3)], axis=1)
        q = q - np.linalg.solve(jacobian, residuals(q))
    return h_l * (q[0] - q[1]) ** 1.5, h_r * (q[1] - q[2]) ** 1.5, q[1]


@pytest.mark.parametrize("name", ["preload", "preload_feed_forward", "tilt_hold"])
def test_a_preloaded_grasp_comes_to_rest_in_its_equilibrium(name: str) -> None:
    scene = scene_of(name, "time.duration_s=60.0")
    f_l, f_r, x_o = squeeze(scene)
    motion = simulate(scene)
    forces = [output.value(scene.system, 0, motion.state[-1]) for output in scene.outputs]
    assert forces == pytest.approx([f_l, f_r], rel=1e-9)
    assert motion.state[-1, 2] == pytest.approx(x_o, abs=1e-12)
    assert f_l - f_r == pytest.approx(-scene.system.bodies[2, 3], rel=1e-9)  # the weight of the object
    assert min(f_l, f_r) > 1.0


def test_the_equilibrium_is_the_one_of_the_overlap() -> None:
    """O14."""
    f, same, _ = squeeze(scenes.load("preload"))
    assert f == pytest.approx(same, rel=1e-12)
    overlap = mpf(2 * 500) * mpf("0.025") / 510  # of the rest points that springs and gains have together
    assert f == pytest.approx(float(holding_force((510, 510), (1e4, 1e4), overlap)), rel=1e-12)


def test_a_set_point_is_a_constant_force() -> None:
    there = simulate(scene_of("preload", "left_feedback.set_point_m=0.03125", "right_feedback.set_point_m=-0.03125"))
    force = simulate(scene_of("preload_feed_forward", "left_feedback.feed_forward_N=15.625",
                              "right_feedback.feed_forward_N=-15.625"))
    assert there.state.tobytes() == force.state.tobytes()


@pytest.mark.parametrize(("section", "impulse"), [
    ({"object_pulse": {"force_N": 3.0, "start_s": 0.5, "length_s": 0.25}}, 0.75),
    ({"object_table": {"time_s": [0.1, 0.3, 0.7], "force_N": [1.0, -2.0, 4.0]}}, 0.2 - 0.8 + 1.2),
    ({"object_pulse": {"force_N": 3.0, "start_s": 0.5, "length_s": 0.25},
      "object_table": {"time_s": [0.1], "force_N": [1.0]}}, 0.75 + 0.9),
])
def test_external_forces_give_their_impulse(section: dict[str, dict[str, object]], impulse: float) -> None:
    scene = made(1.0, 0.01, object=body(2.0, 0.0, 1.0), **section)
    for sampled in (False, True):
        motion = simulate(scene, sampled=sampled)
        assert motion.state[-1, 3] == pytest.approx(1.0 + impulse / 2.0, rel=1e-14)
        work = sum(system_force * step for system_force, step in zip(
            [scene.system.external_at(tick)[2] for tick in range(scene.ticks)],
            np.diff(simulate(scene, grid=tick_times(scene)).state[:, 2]), strict=True))
        assert work == pytest.approx(motion.state[-1, 3] ** 2 - 1.0, rel=1e-12)  # twice m / 2 = 1 kg


def test_a_sine_force_is_a_staircase_with_the_values_of_the_sine() -> None:
    scene = made(1.0, 0.001, object=body(),
                 object_sine={"amplitude_N": 2.0, "frequency_Hz": 3.0, "phase_rad": 0.5})
    turn = 2 * np.pi * 3.0
    exact = 2.0 / turn * (np.cos(0.5) - np.cos(turn * tick_times(scene) + 0.5))
    found = simulate(scene, sampled=True).state[:, 3]
    assert np.abs(found - exact).max() < 2.0 / turn * (turn * 0.001) ** 2 / 10  # second order in the period
    assert np.abs(found - simulate(scene, grid=tick_times(scene)).state[:, 3]).max() < 1e-15


def test_intervals_are_the_same_in_blocks_of_any_length(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of("sine", "time.duration_s=0.5", "object_pulse.force_N=3", "object_pulse.start_s=0.1",
                     "object_pulse.length_s=0.05")
    grid = np.sort(np.concatenate([np.linspace(0.0, 0.5, 777), tick_times(scene)[::7], [0.5, 0.5]]))
    runs = []
    for block in (2, 3, 499, 500, 10**6):
        monkeypatch.setattr(closed_loop, "LONGEST", block)
        runs.append([simulate(scene, grid=grid, sampled=sampled).state.tobytes() for sampled in (False, True)])
    assert all(run == runs[0] for run in runs)


def test_a_sine_over_nearly_as_many_ticks_as_are_allowed_begins_at_once() -> None:
    run = simulate(scene_of("sine", "time.duration_s=0.09", "time.control_period_s=1e-9"), max_work=100)
    assert run.status is Status.WORK_BUDGET


def test_a_knocked_object_comes_back() -> None:
    motion = simulate(scenes.load("pulse"), grid=np.array([4.999, 5.02, 10.0]))
    assert abs(motion.state[1, 2]) > 0.005
    assert motion.state[2] == pytest.approx(motion.state[0], abs=1e-6)

"""The plant of the sampled loop by itself, and the inputs that a trajectory records."""

from __future__ import annotations

import numpy as np
import pytest
from documents import case_of

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics.layout import LEFT, RIGHT, Of
from grasp_ros.physics.system import ExternalForce, System
from grasp_ros.simulation import SampledPlant, simulate
from lab.reference.grasp import commands

PERIOD, KILOGRAMS = 0.25, 2.0


def free_arm(delay: int) -> System:
    """An arm of 2 kg without a spring, pushed by 10 N from tick 1 on."""
    system = System(delay=delay, external=[ExternalForce("", LEFT, lambda ticks: 10.0 * (ticks > 0), lambda _: [1])])
    system.bodies[LEFT, Of.MASS] = KILOGRAMS
    return system


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_a_command_waits_is_held_and_acts(delay: int) -> None:
    """x'' = f / m in every period, written out."""
    plant = SampledPlant(free_arm(delay), round(PERIOD * 1e9))
    commands = [1.0, -2.0, 4.0, -8.0]
    assert (plant.tick, plant.time, plant.effort.tolist(), plant.inputs.tolist()) == (0, 0.0, [0.0] * 3, [0.0] * 3)
    x = v = 0.0
    for tick, command in enumerate(commands):
        rows = plant.step(np.array([command, 0.0, 0.0]), np.array([0.0, 0.5, 1.0]) * PERIOD)
        effort = commands[tick - delay] if tick >= delay else 0.0
        force = effort + (10.0 if tick else 0.0)
        assert plant.effort.tolist() == [effort, 0.0, 0.0]
        assert plant.inputs.tolist() == [force, 0.0, 0.0]
        parts = [0.0, 0.5 * PERIOD, PERIOD]
        a = force / KILOGRAMS
        assert rows[:, 0].tolist() == pytest.approx([x + v * t + a * t * t / 2.0 for t in parts], abs=1e-15)
        assert rows[:, 1].tolist() == pytest.approx([v + a * t for t in parts], abs=1e-15)
        x, v = plant.state[:2]
        assert rows[-1].tolist() == pytest.approx(plant.state.tolist(), abs=1e-15)
        assert (plant.tick, plant.time) == (tick + 1, (tick + 1) * PERIOD)
    assert v == pytest.approx((sum(commands[: max(4 - delay, 0)]) + 30.0) * PERIOD / KILOGRAMS, abs=1e-14)


def test_output_times_within_a_period_change_nothing() -> None:
    scene = case_of(period=0.05)
    plants = [SampledPlant(scene.system, scene.period_ns) for _ in range(2)]
    for tick in range(scene.ticks):
        answers = commands(scene.system, tick, plants[0].state)
        assert plants[0].step(answers).shape == (0, 6)
        assert plants[1].step(answers, np.linspace(0.0, 0.05, 7)).shape == (7, 6)
        assert plants[0].state.tobytes() == plants[1].state.tobytes()


def test_a_plant_that_stops_says_so_and_stays() -> None:
    scene = case_of(period=0.5)
    plant = SampledPlant(scene.system, scene.period_ns, Integrator(scene.system, continuous=False, max_work=3))
    assert (plant.status, plant.stop) == (Status.DONE, "")
    while plant.status is Status.DONE:
        before = plant.tick
        rows = plant.step(np.zeros(3), np.linspace(0.0, 0.5, 11))
    assert plant.status is Status.WORK_BUDGET
    assert plant.stop.startswith(f"{plant.status.value}: t = ")
    assert plant.tick == before
    assert len(rows) < 11


def test_inputs_are_the_commands_that_arrived_and_the_external_forces() -> None:
    """Delay, limits and a pulse at once, at the ticks and between them."""
    scene = scenes.load("everything", ["time.duration_s=0.5", "object_pulse.start_s=0.3", "loop.delay_ticks=3",
                                       "left_actuator.limit_N=30"])
    ticks = simulate(scene)
    assert np.abs(ticks.inputs[:-1, LEFT]).max() == 30.0 < np.abs(ticks.inputs[:-1, RIGHT]).max()
    assert ticks.inputs[:3, :2].tolist() == [[0.0, 0.0]] * 3
    assert ticks.inputs[3:-1, :2].tobytes() == ticks.command[:-4].tobytes()
    assert ticks.inputs[:-1, 2].tolist() == [0.0] * 300 + [30.0] * 20 + [0.0] * 180
    assert np.isnan(ticks.inputs[-1]).all()
    between = simulate(scene, grid=np.sort(np.concatenate([ticks.t, ticks.t[:-1] + 0.0004])))
    assert np.array_equal(between.inputs[::2], ticks.inputs, equal_nan=True)
    assert np.array_equal(between.inputs[1::2], ticks.inputs[:-1])


def test_inputs_under_continuous_feedback_are_its_force_and_the_external_ones() -> None:
    scene = scenes.load("pulse")
    start, length, force = (scene.values["object_pulse"][key] for key in ("start_s", "length_s", "force_N"))
    motion = simulate(scene, grid=np.array([0.0, start - 1e-9, start, start + length, scene.duration]))
    assert not motion.sampled
    assert np.array_equal(motion.inputs[:-1, [LEFT, RIGHT]], motion.command[:-1])
    assert motion.inputs[:-1, 2].tolist() == [0.0, 0.0, force, 0.0]
    assert np.isnan(motion.inputs[-1]).all()


def test_inputs_end_where_a_run_stops() -> None:
    motion = simulate(case_of(), sampled=True, max_work=1000)
    assert motion.status is Status.WORK_BUDGET
    assert motion.inputs.shape == (len(motion.t), 3)
    assert np.isfinite(motion.inputs).all()
    assert np.array_equal(motion.inputs[:, :2], motion.command)

"""Runs of the integrator: any accuracy, pieces and output times; energy; budgets; what is refused."""

from __future__ import annotations

import gc
import math
import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
from documents import body, made
from numba.core.registry import CPUDispatcher
from oracles import AT_REST, CASES, Run, done, energy, kinds, make_grasp, run

from grasp_ros import scene as scenes
from grasp_ros.exact.driver.advance import advance
from grasp_ros.exact.driver.callback import SIGNATURE
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.observe.observer import observe, watch
from grasp_ros.observe.record import Wanted
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import Work
from grasp_ros.simulation import ensemble, simulate
from grasp_ros.simulation.chunk import Setup
from lab.cases import regression
from lab.cases.modes import STARTS
from lab.reference.grasp import grasp_of, system_of

GRID = np.linspace(0.0, 20.0, 201)


@pytest.mark.parametrize("accuracy", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-16])
@pytest.mark.parametrize("name", CASES)
def test_every_accuracy_gets_through_every_case(name: str, accuracy: float) -> None:
    scene = scenes.load(name)
    result = run(grasp_of(scene), scene.initial_state, 20.0, GRID, accuracy=accuracy)
    done(result)
    assert len(result.states) == len(GRID)


@pytest.mark.parametrize("name", [name for name in CASES if name not in ("case_01", "case_09", "case_10")])
def test_the_decaying_tail_ends_properly(name: str) -> None:
    result = run(grasp_of(scenes.load(name)), scenes.load(name).initial_state, 1000.0, [500.0, 1000.0])
    level = energy(grasp_of(scenes.load(name)), result.states)
    assert done(result).work[Work.ROOT_ITERATIONS] < 3_000_000
    # amplitudes of 1e-30 m and less are what rounding leaves of a motion that began with 0.5 m
    assert level.V_c[1] <= level.V_c[0] * (1 + 1e-10) + 1e-60


@pytest.mark.parametrize("start", [*STARTS.values(), AT_REST])
def test_the_first_output_is_the_start(start: Any) -> None:
    assert np.array_equal(run(make_grasp(), start, 0.1, [0.0, 0.1]).states[0], start)


def test_the_last_output_is_the_end() -> None:
    scene = scenes.load("case_03")
    dense = run(grasp_of(scene), scene.initial_state, 20.0, np.linspace(0.0, 20.0, 9001))
    assert np.array_equal(dense.states[-1], dense.integrator.state)


@pytest.mark.parametrize("name", ["case_01", "case_05", "case_09"])
@pytest.mark.parametrize("pieces", [7, 250, 5000])
def test_splitting_one_horizon_changes_nothing(name: str, pieces: int) -> None:
    scene = scenes.load(name)
    whole = run(grasp_of(scene), scene.initial_state, 5.0)
    parts = Integrator(scene.system, continuous=True)
    for i in range(pieces):
        parts.advance(5.0 / pieces, start=5.0 * i / pieces)
    assert parts.status is Status.DONE
    assert sorted(kinds(Run(parts, whole.states))) == sorted(kinds(whole))
    assert np.abs(parts.state - whole.integrator.state).max() < 2e-11
    for a, b in zip(parts.events, whole.integrator.events, strict=True):
        assert a.time == pytest.approx(b.time, abs=2e-11)


def test_advance_by_nothing_changes_nothing() -> None:
    scene = scenes.load("case_01")
    integrator = Integrator(scene.system, continuous=True)
    assert np.array_equal(integrator.advance(0.0, np.array([0.0])), scene.initial_state[None])
    assert np.array_equal(integrator.state, scene.initial_state)


def test_an_end_a_million_times_smaller_than_the_start_is_no_alarm() -> None:
    """Place and penetration carry roundings of 1 m; put where the object is, at 1e-7 m, the arm gains 1e-14 J."""
    scene = regression.load("back_to_a_touching_rest")
    state = [1.0828702308157199, -11.681888328878939, 1.0867219014744656, -11.724981898004899, 1.0828779126122041,
             -11.682171110205237]  # the end of the run, with velocities turned round
    integrator = Integrator(replace(scene.system, state=np.array(state)), continuous=True)
    integrator.advance(scene.duration)
    assert integrator.status is Status.DONE


READ_ONLY = np.linspace(0.0, 1.0, 21)[::2]
READ_ONLY.setflags(write=False)


def compiled() -> dict[str, int]:
    """How often each function that Python calls has been compiled."""
    doors = [item for item in gc.get_objects() if type(item) is CPUDispatcher]
    return {f"{door.py_func.__module__}.{door.__name__}": len(door.signatures) for door in doors}


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("grid", [READ_ONLY, np.arange(2), np.float32([0.0, 0.5]), [0, 1]], ids=range(4))
def test_whatever_numbers_and_arrays_are_given_run_on_the_same_machine_code(grid: Any) -> None:
    scene = scenes.load("case_01", ["time.duration_s=1"])
    integrator = Integrator(scene.system, continuous=True)
    watch(integrator, Wanted.LOSSES, 0.02)
    ensemble(scene, {"object.mass_kg": [1.0]}, ("energy",))
    for name in ("exact", "rk4", "paper", "discrete_gradient"):
        simulate(scene, method=name, grid=np.zeros(1))
    known = compiled()
    for one in (1, np.float32(1.0), np.int64(1)):
        integrator = Integrator(scene.system, continuous=True, accuracy=np.float32(1e-6), max_work=1e8, max_events=1e6)
        watch(integrator, Wanted.LOSSES, np.float32(0.5))
        integrator.advance(one, grid, start=0)
    table = ensemble(scene, {"object.mass_kg": [1, 2]}, setup=Setup(accuracy=np.float32(1e-6), max_work=1e8))
    assert table.done.all()
    for name, setting in (("exact", np.float32(1e-6)), ("rk4", 1), ("paper", 1), ("discrete_gradient", np.float32(1))):
        simulate(scene, method=name, setting=setting, grid=grid)
    simulate(scene, sampled=True, setting=np.float32(1e-6), max_work=np.int32(10**8), grid=grid)
    assert compiled() == known
    assert len(advance.signatures) == 1
    assert observe.nopython_signatures == [SIGNATURE]  # as it is on disk, whoever calls it first


def test_event_budget_beyond_the_kernel_rows() -> None:
    scene = scenes.load("case_02")
    result = run(grasp_of(scene), scene.initial_state, 5000.0, np.linspace(0, 5000, 501), max_events=2000)
    assert result.integrator.status is Status.EVENT_BUDGET
    assert 2000 <= len(result.integrator.events) < 4000
    assert 0 < len(result.states) < 501
    again = result.integrator.advance(1.0, np.array([0.5]))
    assert again.shape == (0, 6)


@pytest.mark.parametrize(("state", "options", "duration", "words"), [
    *((AT_REST, {}, bad, "duration") for bad in (math.nan, math.inf, -1.0)),
    *((AT_REST, {"accuracy": bad}, 1.0, "accuracy") for bad in (0.0, -1.0, 9e-17, 2e-3, math.nan)),
    *((bad, {}, 1.0, "six finite")
      for bad in (AT_REST[:5], [math.nan, *AT_REST[1:]], [math.inf, *AT_REST[1:]], [AT_REST])),
])
def test_what_is_outside_is_refused(state: Any, options: dict[str, float], duration: float, words: str) -> None:
    with pytest.raises(Refused, match=words):
        Integrator(system_of(make_grasp(), np.array(state)), continuous=True, **options).advance(duration)


EVERYTHING = """
import numba
import numpy as np
from grasp_ros import scene as scenes
from grasp_ros.simulation import ensemble, simulate
from grasp_ros.simulation.losses import losses
for name in ("case_01", "case_05"):
    run = simulate(scenes.load(name, ["time.duration_s=1"]), grid=np.linspace(0.0, 1.0, 11))
    print(*run.state.ravel().tolist(), *(event.time for event in run.events))
scene = scenes.load("case_01", ["time.duration_s=0.02", "left_arm.position_m=-0.01", "left_arm.velocity_m_per_s=2"])
nothing = ("stiffness_N_per_m", "damping_Ns_per_m", "position_gain_N_per_m", "velocity_gain_Ns_per_m", "position_m")
free = {f"{section}.{key}": 0.0 for section, keys in scene.values.items() for key in keys if key in nothing}
chain = simulate(scene.changed({**free, "right_arm.velocity_m_per_s": 0.0}), grid=np.linspace(0.0, 0.02, 5))
print(*chain.state.ravel().tolist(), *(event.time for event in chain.events))
@numba.cfunc("float64(int64, float64, float64, float64)")
def pulls(tick, time, x, v):
    return -2.0 * x
own = {"controllers": {"left": lambda tick, time, x, v: -x, "right": pulls}, "grid": None}
for settings in ({}, {"sampled": True}, own, {"method": "paper"}, {"method": "discrete_gradient"}):
    run = simulate(scene, **{"grid": np.linspace(0.0, 0.02, 5), **settings})
    print(*run.state.ravel().tolist(), *map(float, losses(run)))
print(*np.concatenate([*ensemble(scene, {}, ("energy", "settling_time", "touches")).columns.values()]).tolist())
"""


@pytest.mark.slow
@pytest.mark.thorough
def test_everything_runs_uncompiled() -> None:
    outputs = []
    for disabled in ("0", "1"):
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled}
        finished = subprocess.run([sys.executable, "-W", "ignore", "-c", EVERYTHING], env=environment,
                                  capture_output=True, text=True, timeout=120, check=True)
        outputs.append([float(word) for word in finished.stdout.split()])
    assert len(outputs[0]) > 250
    assert outputs[0] == pytest.approx(outputs[1], rel=0, abs=1e-12)


@pytest.mark.parametrize("mass", [1.0, 1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("name", ["left_arm", "right_arm"])
def test_outputs_of_an_arm_without_inertia_are_its_creep(mass: float, name: str) -> None:
    """The product of c/m and the time is large."""
    arm = body(mass, -0.3, stiffness_N_per_m=10.0, damping_Ns_per_m=1e3)
    run = simulate(made(1.0, 0.001, **{name: arm}), grid=np.linspace(0.0, 1.0, 9))
    slow = 0.02 / (1.0 + np.sqrt(1.0 - 4e-5 * mass))  # 1/s; the fast part is over
    creep = -0.3 * np.exp(-slow * run.t[1:]) / (1.0 - mass * slow**2 / 10.0)
    assert run.state[1:, 0 if name == "left_arm" else 4] == pytest.approx(creep, rel=1e-14)

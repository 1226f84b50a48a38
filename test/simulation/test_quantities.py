"""Settling times, contacts and the energy lost by cause, beside what they must add up to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from grasp_ros import scene as scenes
from grasp_ros.physics.control import ControlLaw
from grasp_ros.physics.energy import PLANT_ALONE, energy
from grasp_ros.physics.errors import Refused
from grasp_ros.physics.layout import LEFT, RIGHT, Of, Transition
from grasp_ros.physics.system import COLUMN, NAMES
from grasp_ros.simulation import simulate
from grasp_ros.simulation.chunk import Setup
from grasp_ros.simulation.ensemble import ensemble
from grasp_ros.simulation.losses import losses, power_lost
from grasp_ros.simulation.quantities import HORIZONS, MOTION, contact_intervals, last_outside, settling_times, summary
from grasp_ros.simulation.sampled_plant import tick_times
from lab.paper.figures import running_losses


def test_last_time_outside_of_known_motions() -> None:
    t = np.linspace(0.0, 4.0, 4001)
    x = np.column_stack([np.exp(-t), 0.001 * np.ones_like(t), np.ones_like(t)])
    found = last_outside(t, x, 0.1)
    assert found[0] == pytest.approx(np.log(10.0), abs=1e-6)
    assert found[1] == 0.0
    assert found[2] == np.inf


def test_losses_of_a_run_without_output_times_are_refused() -> None:
    with pytest.raises(Refused, match="the run has no output times; allowed: one or more"):
        losses(simulate(scenes.load("case_01"), sampled=True, grid=np.zeros(0)))


@pytest.mark.parametrize("name", ["case_01", "friction"])
def test_rates_of_losses_are_that_of_v_c(name: str) -> None:
    run = simulate(scenes.load(name))
    rate = power_lost(run.scene.system, run.state).total
    assert rate.max() > 1.0
    assert -2.0 * rate == pytest.approx(run.energy.V_rate, abs=1e-13)


@pytest.mark.parametrize("gains", [
    {"damping_Ns_per_m": 0.2, "velocity_gain_Ns_per_m": -0.2},
    {"damping_Ns_per_m": 0.2, "velocity_gain_Ns_per_m": -0.19999999999999996},
    {"damping_Ns_per_m": 1.0, "velocity_gain_Ns_per_m": -1.0 + 1e-13},
    {"damping_Ns_per_m": 1.0, "velocity_gain_Ns_per_m": -0.9999999999, "stiffness_N_per_m": 1e4},
    {"damping_Ns_per_m": 0.2, "velocity_gain_Ns_per_m": -0.2, "stiffness_N_per_m": 0.30000000000000004,
     "position_gain_N_per_m": -0.3, "feed_forward_N": 1.0},
    {"damping_Ns_per_m": 0.2, "velocity_gain_Ns_per_m": -0.199, "stiffness_N_per_m": 20.0},
])
def test_losses_of_a_feedback_that_gives_what_the_dampers_take(gains: dict[str, float]) -> None:
    """The energy that both take together is next to nothing, and says nothing of either."""
    keys = {f"left_{'arm' if key.startswith(('damping', 'stiff')) else 'feedback'}.{key}": number
            for key, number in gains.items()}
    scene = scenes.load("case_01", ["time.duration_s=2", *(f"{key}={number!r}" for key, number in keys.items())])
    run = simulate(scene, grid=np.linspace(0.0, 2.0, 400_001))
    squares = np.trapezoid(run.state[:, [COLUMN[LEFT] + 1, COLUMN[RIGHT] + 1]] ** 2, run.t, axis=0)
    damping = run.scene.system.bodies[[LEFT, RIGHT], Of.DAMPING]
    assert float(losses(run).dampers) == pytest.approx(float(squares @ damping), rel=1e-8)


@pytest.mark.parametrize("settings", [(), ("left_contact.dissipation_s_per_m=1e7", "left_arm.velocity_m_per_s=1")])
def test_running_sums_follow_V_c(settings: tuple[str, ...]) -> None:
    scene = scenes.load("case_03", settings)
    t, lost = running_losses(simulate(scene))
    stored = 0.5 * simulate(scene, grid=t).energy.V_c
    assert lost.total == pytest.approx(stored[0] - stored, abs=1e-12 * stored[0])


def test_running_sums_stand_at_outputs_and_events() -> None:
    run = simulate(scenes.load("case_03"), grid=np.array([1.0, 7.0]))
    t, lost = running_losses(run)
    assert np.array_equal(t, np.union1d([0.0, 1.0, 7.0, run.scene.duration], run.event_table[:, 0]))
    assert all(len(total) == len(t) for total in lost)
    assert float(losses(run).total) == pytest.approx(float(lost.total[-1]), rel=1e-13)


@pytest.mark.parametrize(("options", "rounding"), [({"sampled": True}, 0.0), ({"method": "dop853"}, 1e-6)])
def test_losses_do_not_depend_on_the_output_times(options: dict[str, Any], rounding: float) -> None:
    scene = scenes.load("case_01")
    coarse = simulate(scene, grid=np.linspace(0.0, scene.duration, 11), **options)
    fine = simulate(scene, grid=tick_times(scene), **options)
    assert [*map(float, losses(coarse))] == pytest.approx([*map(float, losses(fine))], rel=rounding, abs=0.0)
    assert summary(coarse)["lost_J"] == pytest.approx(summary(fine)["lost_J"], rel=rounding, abs=0.0)


def test_forces_of_a_run_with_changes_are_its_own() -> None:
    scene, stiff = scenes.load("case_01"), {100: {"left_feedback.position_gain_N_per_m": 200.0}}
    run = simulate(scene, sampled=True, changes=stiff)
    assert summary(run)["largest_N"]["input_left"] == np.abs(run.command[:, 0]).max() > 50.0
    assert run.energy_of == PLANT_ALONE  # nobody knows V_c of gains that change
    assert run.energy.V_c.tolist() == energy(scene.system, run.state, feedback=False).V_c.tolist()
    assert run.energy.V_c[0] == pytest.approx(10.0 * 0.3**2 + 10.0 * 0.5**2)  # the springs of the arms
    early = simulate(scene, sampled=True, changes={3000: stiff[100]}, grid=[0.0, 1.0, 2.0])
    with pytest.raises(Refused, match="its controllers cannot be asked again"):
        losses(early)


def test_losses_of_a_run_that_cannot_be_repeated_are_refused() -> None:
    def rest(tick: int, t: float, x: float, v: float) -> float:
        return 0.0

    run = simulate(scenes.load("case_01"), grid=[0.0, 10.0], controllers={"left": rest})
    with pytest.raises(Refused, match="output times at every control period"):
        losses(run)
    assert not {"lost_J", "last_outside_s"} & summary(run).keys()


SIDES = ("left", "right")
PUSHED = tuple(f"left_arm_pulse.{key}" for key in ("force_N=3", "start_s=1", "length_s=0.5"))


@pytest.mark.parametrize(("name", "settings", "options", "tight"), [
    *((name, (), {}, 1e-12) for name in ("case_01", "case_02", "case_03", "case_07", "friction", "v_jump_symmetric",
                                         "pulse", "everything")),
    *(("case_01", ("left_arm.velocity_m_per_s=1", *(f"{side}_contact.dissipation_s_per_m={p}" for side in SIDES)), {},
       1e-11) for p in (1e2, 1e4, 1e6, 1e7)),  # a relaxation
    *(("case_01", settings, {"sampled": True}, 1e-10) for settings in (
        (), ("time.control_period_s=0.1",), ("loop.delay_ticks=3",))),
    ("case_01", PUSHED, {}, 1e-12), ("case_01", PUSHED, {"sampled": True}, 1e-12),
    ("pulse", (), {"grid": [1.0, 2.0]}, 1e-12), ("pulse", (), {"sampled": True, "grid": [1.0, 6.0]}, 1e-4),
    ("case_01", (), {"grid": [1.0, 2.0], "method": "rk4"}, 1e-4),
])
def test_losses_and_work_are_what_V_c_falls_by(
    name: str, settings: tuple[str, ...], options: dict[str, Any], tight: float
) -> None:
    run = simulate(scenes.load(name, settings), **options)
    found, lost = summary(run), losses(run)
    begin, end = found["V_c_J"]
    fallen = float(lost.total) - found.get("work_external_J", 0.0)
    assert fallen == pytest.approx(0.5 * (begin - end), rel=tight, abs=tight * min(0.5 * begin, 1.0))
    assert [*found["lost_J"].values()] == pytest.approx([*map(float, lost)], rel=1e-13, abs=1e-12)
    assert ("work_external_J" in found) == bool(run.scene.system.external)
    assert (float(lost.friction) > 0.0) == ("object_friction" in run.scene.values)


def test_the_largest_force_of_an_arm_has_the_external_one_in_it_however_a_run_is_made() -> None:
    scene = scenes.load("case_01", [*PUSHED, "time.duration_s=2"])
    law = scene.system.laws[LEFT]
    runs = (simulate(scene, sampled=True),
            simulate(scene, controllers={"left": lambda tick, t, x, v: law.command(tick, x, v)}))
    largest = [summary(run)["largest_N"]["input_left"] for run in runs]
    assert largest[0] > 3.0
    assert largest[1] == largest[0]


def test_a_run_with_another_controller_is_observed_as_one_with_that_of_the_scene_is() -> None:
    """Also impacts between two ticks, such as one of 2 ms."""
    scene = scenes.load("case_01", [*PUSHED, "time.duration_s=4", "time.control_period_s=0.01"])

    def own(law: ControlLaw) -> Callable[[int, float, float, float], float]:
        return lambda tick, t, x, v: law.command(tick, x, v)

    laws = {NAMES[side]: own(law) for side, law in scene.system.laws.items()}
    runs = [summary(simulate(scene, sampled=True)), summary(simulate(scene, controllers=laws))]
    assert runs[0]["largest_N"] == runs[1]["largest_N"]
    assert runs[0]["largest_of"] == runs[1]["largest_of"] == MOTION
    assert runs[0]["last_outside_s"] == runs[1]["last_outside_s"]
    for cause in ("dampers", "impacts", "friction"):
        assert runs[0]["lost_J"][cause] == runs[1]["lost_J"][cause]


def test_the_rate_of_V_has_the_power_of_external_forces() -> None:
    run = simulate(scenes.load("case_01", PUSHED), grid=np.linspace(1.2, 1.3, 1001))
    level, free = run.energy, ~run.impacts.any(axis=1)
    slope = np.gradient(level.V_c, run.t)
    inner = free[:-2] & free[1:-1] & free[2:]
    assert inner.sum() > 100
    assert level.V_rate[1:-1][inner] == pytest.approx(slope[1:-1][inner], abs=1e-4)


@pytest.mark.parametrize("name", ["case_01", "case_03", "case_05", "case_07", "noise", "saturation", "everything"])
def test_they_are_those_of_an_observed_run(name: str) -> None:
    scene = scenes.load(name)
    run = simulate(scene, grid=np.linspace(0.0, scene.duration, 20001))
    observed = ensemble(scene, {}, ["settling_time", "settling_times", "energy"], setup=Setup(horizons=60)).columns
    lost = losses(run)
    settled = settling_times(run, horizons=60)
    np.testing.assert_array_equal(settled.max(), observed["settling_time"][0])
    for body, name in NAMES.items():
        np.testing.assert_array_equal(settled[COLUMN[body] // 2], observed[f"settling_time_{name}"][0])
    for cause in ("dampers", "friction", "impacts", *(() if run.sampled else ("feedback",))):
        assert float(getattr(lost, cause)) == pytest.approx(observed[f"lost_{cause}"][0], rel=1e-9, abs=1e-9)
    if not run.sampled:  # from output to output, and from event to event
        assert [sums[-1] for sums in running_losses(run)[1]] == pytest.approx([*map(float, lost)], rel=1e-9, abs=1e-9)


def test_contacts_of_case_1() -> None:
    run = simulate(scenes.load("case_01"), grid=np.linspace(0.0, 20.0, 20001))
    for side, name in ((LEFT, "left"), (RIGHT, "right")):
        spans = contact_intervals(run, name)
        inside = ((run.t[:, None] > spans[:, 0]) & (run.t[:, None] < spans[:, 1])).any(axis=1)
        assert np.array_equal(run.impacts[:, side] > 0.0, inside)
    begin_of_first = run.times(Transition.TOUCH, LEFT)[0]
    begun = simulate(scenes.load("case_01", ["left_arm.position_m=0.01"]))
    assert contact_intervals(begun, "left")[0, 0] == 0.0
    [cut] = contact_intervals(simulate(scenes.load("case_01", ["time.duration_s=0.45"]), grid=[0.0, 0.1]), "left")
    assert cut.tolist() == [begin_of_first, 0.45]


def test_a_settling_time_is_that_of_the_scene_whatever_its_horizon() -> None:
    """Also at 10 s, where the run ends inside the bound."""
    expected = [16.61373, 16.68802, 18.24306]  # s, from outputs every 0.1 ms over 100 s
    for duration in (1.0, 10.0, 16.65, 20.0, 60.0):
        scene = scenes.load("case_01", [f"time.duration_s={duration}"])
        assert settling_times(simulate(scene)) == pytest.approx(expected, abs=1e-5)
        assert ensemble(scene, {}, ["settling_time"]).columns["settling_time"] == pytest.approx(expected[2], abs=1e-5)


def test_what_V_c_does_not_prove_is_not_settled() -> None:
    marginal = scenes.load("case_03", ["time.duration_s=10"])
    assert np.isinf(settling_times(simulate(marginal), horizons=10)).all()
    assert np.isfinite(settling_times(simulate(marginal), horizons=HORIZONS)).all()
    assert np.isinf(settling_times(simulate(scenes.load("case_02")))).all()


def test_a_motion_of_another_method_is_settled_if_its_own_end_proves_it() -> None:
    short, long = (scenes.load("case_01", [f"time.duration_s={duration}"]) for duration in (19.0, 40.0))
    assert np.isinf(settling_times(simulate(short, method="rk4"))).all()
    assert settling_times(simulate(long, method="rk4")) == pytest.approx(settling_times(simulate(long)), abs=0.02)


def test_settled_has_a_meaning_only_where_V_c_proves_something() -> None:
    names = ("case_01", "arm_alone", "friction", "preload", "pulse", "tilt_hold", "wall", "hammer", "no_contact")
    known = {name: not np.isnan(settling_times(simulate(scenes.load(name)))).any() for name in names}
    assert {name for name, proves in known.items() if proves} == {"case_01", "friction"}
    assert np.isnan(settling_times(simulate(scenes.load("case_01"), sampled=True))).all()

"""Methods beside `exact`: one record, touches, invariants, and what each refuses."""

from __future__ import annotations

import signal

import numpy as np
import pytest
from documents import horizon, stalling
from oracles import ELASTIC, STANDARD, impact, make_grasp, reduced_mass

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.methods import library
from grasp_ros.methods.contract import STEP
from grasp_ros.methods.equations import parameters
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.layout import LEFT, RIGHT, Entry, Transition
from grasp_ros.simulation import Trajectory, simulate
from lab.oracles.closed_forms import elastic_period
from lab.reference.grasp import system_of

STEPPING = [name for name in METHODS if name != EXACT]
LOCATING = [name for name in STEPPING if METHODS[name].events]
PRECISE = {STEP: 2e-5, "tolerance": 1e-11}
LESS_PRECISE = {"paper": 2e-5, "discrete_gradient": 2e-5}  # error at that setting, of methods of a low order


@pytest.mark.parametrize("name", STEPPING)
def test_methods_agree_with_exact_for_some_contacts(name: str) -> None:
    method = METHODS[name]
    scene = horizon("case_01", 1.5)
    motion = simulate(scene, method=name, setting=PRECISE[method.knob])
    exact = simulate(scene)
    assert motion.status is Status.DONE
    assert motion.method == name
    assert np.abs(motion.state - exact.state).max() < LESS_PRECISE.get(name, 1e-6)
    assert motion.work[0] > 100
    if name in LOCATING:
        for side in (LEFT, RIGHT):
            for kind in (Transition.TOUCH, Transition.RELEASE):
                assert motion.times(kind, side) == pytest.approx(exact.times(kind, side), abs=1e-6)
    else:
        assert len(motion.event_table) == 0


@pytest.mark.parametrize("name", LOCATING)
def test_condition_10_is_an_event_in_both_directions(name: str) -> None:
    """Both pairs pass u' = -1/p at once, come back through it, and then release."""
    scene = horizon("v_jump_symmetric", 0.4)
    motion = simulate(scene, method=name, setting=PRECISE[METHODS[name].knob])
    tolerance = 1e-4 if name == "paper" else 1e-6
    for side in (LEFT, RIGHT):
        assert motion.times(Transition.CLAMP, side) == pytest.approx([0.315452318447362], abs=tolerance)
        assert motion.times(Transition.REENTRY, side) == pytest.approx([0.363159009501776], abs=tolerance)


def free_impact(name: str, p: str, seconds: float = 0.5) -> Trajectory:
    """The left arm hits the object with 1 m/s after 0.1 s; nothing else acts."""
    settings = [f"{side}_{key}=0" for side in ("left", "right") for key in (
        "arm.stiffness_N_per_m", "arm.damping_Ns_per_m", "feedback.position_gain_N_per_m",
        "feedback.velocity_gain_Ns_per_m")]
    scene = horizon(
        "case_01", seconds, *settings, "left_arm.position_m=-0.1", "left_arm.velocity_m_per_s=1",
        "right_arm.position_m=9", f"left_contact.dissipation_s_per_m={p}",
    )
    return simulate(scene, method=name, setting=PRECISE[METHODS[name].knob])


@pytest.mark.parametrize("name", STEPPING)
def test_restitution_of_one_impact(name: str) -> None:
    """O2: two bodies that are free; the exit speed depends on p v alone."""
    law, motion = impact(reduced_mass(1, 5), 1e4, "0.5", 1), free_impact(name, "0.5")
    assert motion.state[-1, 3] - motion.state[-1, 1] == pytest.approx(float(law.restitution), abs=1e-6)


@pytest.mark.parametrize("name", LOCATING)
def test_a_pair_that_leaves_along_the_clamp_surface_leaves_once(name: str) -> None:
    """u' stays at -1/p to rounding: out of contact and back a hundred times at one instant is no motion."""
    for p in ("30", "100", "300"):
        motion = free_impact(name, p, 1.0)
        assert motion.status is Status.DONE
        assert len(motion.times(Transition.TOUCH, LEFT)) == 1
        assert len(motion.event_table) <= 3  # a touch, perhaps a clamp, a release


def test_jacobian_is_the_derivative_of_the_right_hand_side() -> None:
    q = parameters(system_of(make_grasp(p=0.3, right=STANDARD._replace(mass=2.0)), np.zeros(6)))
    y = np.array([0.01, 0.4, 0.002, -0.1, -0.003, 0.2])
    eps = 1e-7
    numeric = np.array([
        (library.slopes(0.0, y + d, q, True, True) - library.slopes(0.0, y - d, q, True, True)) / (2 * eps)
        for d in eps * np.eye(6)
    ]).T
    assert library.jacobian(0.0, y, q, True, True) == pytest.approx(numeric, rel=1e-6, abs=1e-5)
    frozen = library.jacobian(0.0, y, q, False, True)
    assert frozen[1].tolist() == [-15.0, -0.7, 0.0, 0.0, 0.0, 0.0]


def test_a_coarse_method_misses_contacts_and_does_not_hide_it() -> None:
    """Order 8 with events reports success on case 2 with most of the 54 touches missed."""
    motion = simulate(horizon("case_02", 20.0), method="dop853_events", setting=1e-3)
    found = sum(len(motion.times(Transition.TOUCH, side)) for side in (LEFT, RIGHT))
    assert motion.status is Status.DONE
    assert 0 < found < 54


def test_a_step_that_is_unstable_ends_with_a_status() -> None:
    scene = horizon("case_01", 2000.0, "left_arm.damping_Ns_per_m=1e3")
    unstable = simulate(scene, method="rk4", setting=0.1)
    assert unstable.status is Status.OUTSIDE
    assert np.abs(unstable.state).max() <= 1e12
    assert simulate(scene, method="discrete_gradient", setting=0.1).status is Status.DONE


def test_a_search_of_scipy_that_fails_is_a_status() -> None:
    """Its interpolant of LSODA jumps, so that its search for an event may find no change of sign: a ValueError."""
    scene = scenes.load("v_jump_one_sided", [
        "time.duration_s=2", "left_arm.stiffness_N_per_m=10.56812222328861",
        "left_arm.velocity_m_per_s=0.21371253780294563", "object.mass_kg=1.3671484488976535",
        "right_arm.stiffness_N_per_m=6.270478803320879", "right_arm.damping_Ns_per_m=0.33385105385782143",
        "right_arm.position_m=0.5043234483190907", "left_contact.hertz_N_per_m1_5=345130052.0775655",
        "left_contact.dissipation_s_per_m=28.639568307898337", "right_contact.hertz_N_per_m1_5=1765.508317106146",
        "right_contact.dissipation_s_per_m=10.339979984759909",
        "left_feedback.position_gain_N_per_m=12.268493623565796"])
    motion = simulate(scene, method="lsoda_events", setting=1e-6)
    assert motion.status is Status.STALLED
    assert 0 < len(motion.t) < 2001


@pytest.mark.parametrize("name", STEPPING)
def test_the_first_state_is_the_initial_one(name: str) -> None:
    """LSODA interpolates it."""
    for speed in np.linspace(0.1, 1.0, 20).tolist():
        scene = horizon("case_01", 0.1, f"left_arm.velocity_m_per_s={speed!r}", f"object.velocity_m_per_s={-speed!r}")
        motion = simulate(scene, method=name, setting=1e-3, grid=[0.0, 0.0, 0.1])
        assert motion.state[:2].tolist() == [scene.system.state.tolist()] * 2


def test_an_event_is_not_met_again_in_a_step_that_comes_back_to_it() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        scene = horizon("case_04", 2.0)
        scene = scene.changed({f"{section}.{key}": value * 10.0 ** rng.uniform(-0.4, 0.4)
                               for section, keys in scene.values.items() if section != "time"
                               for key, value in keys.items() if isinstance(value, float)})
        motion = simulate(scene, method="dop853_events")
        assert motion.status is Status.DONE
        for side in (LEFT, RIGHT):
            assert (np.diff(motion.event_table[motion.event_table[:, Entry.BODY] == side, Entry.TIME]) > 0.0).all()


def test_events_at_one_instant_end_a_fixed_step_too() -> None:
    """An unstable step: out of contact and back a million times."""
    scene = scenes.load("case_07", [
        "time.duration_s=5", "left_arm.damping_Ns_per_m=0.1357635166552581",
        "left_arm.velocity_m_per_s=-0.6249738869723416", "right_arm.mass_kg=0.3853191693626619",
        "right_arm.position_m=1.2430264123842492", "left_contact.hertz_N_per_m1_5=896435.4461600222",
        "left_contact.dissipation_s_per_m=0.06126369134057518", "right_contact.hertz_N_per_m1_5=8122.031907769464",
        "right_feedback.position_gain_N_per_m=5.62736875341916"])
    motion = simulate(scene, method="rk4_events", setting=0.3)
    assert motion.status is not Status.DONE
    assert motion.counters["steps"] < 10_000


def test_the_method_of_the_paper_records_the_release_of_a_clamped_pair() -> None:
    paper, exact = (simulate(scenes.load("v_jump_one_sided"), **how).contacts("left")
                    for how in ({"method": "paper", "setting": 1e-4}, {}))
    assert len(paper) == len(exact) == 2
    assert paper["end"] == pytest.approx(exact["end"], abs=1e-3)


def test_exact_is_the_default_and_its_setting_is_the_accuracy() -> None:
    scene = horizon("case_01", 1.0)
    plain, named = simulate(scene), simulate(scene, method=EXACT)
    assert isinstance(plain, Trajectory)
    assert plain.method == EXACT
    assert plain.state.tobytes() == named.state.tobytes()
    coarse = simulate(scene, method=EXACT, setting=1e-6)
    assert coarse.state.tobytes() == simulate(scene, setting=1e-6).state.tobytes()
    assert coarse.state.tobytes() != plain.state.tobytes()


def test_elastic_arm_keeps_its_period() -> None:
    """O12 with located events: 50 periods of 0.8893 s."""
    period = float(elastic_period(1, 15, 10_000, "0.3"))
    scene = horizon("case_02", 50.0, "left_arm.position_m=-0.3", "right_arm.position_m=0.3")
    motion = simulate(scene, method="rk4_events", setting=1e-4)
    assert ELASTIC.damping == 0.0
    touches = motion.times(Transition.TOUCH, LEFT)
    assert np.diff(touches) == pytest.approx(period, abs=1e-6)


def test_events_without_progress_end_with_a_status() -> None:
    """LSODA at u' = -1/p: out of contact and back at the same instant, for ever, because its interpolation jumps."""
    motion = simulate(horizon("v_jump_one_sided", 5.0), method="lsoda_events", setting=stalling())
    assert motion.status is Status.STALLED
    assert motion.t[-1] < 5.0


@pytest.mark.parametrize("method", ["rk4", "discrete_gradient"])
def test_a_signal_ends_a_long_run_with_what_its_handler_raises(method: str) -> None:
    """As Ctrl-C does. The value that a kernel returns must not be made by Python code, where the handler would run."""
    class LateError(Exception):
        pass

    def late(*_: object) -> None:
        raise LateError

    simulate(scenes.load("case_01"), method=method, setting=1e-3)  # which loads its machine code
    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    try:
        with pytest.raises(LateError):
            simulate(scenes.load("case_01"), method=method, setting=2e-6)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)

"""Methods beside `exact`: orders, hand-computed steps, invariants, touches, refusals."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from oracles import ELASTIC, FREE, STANDARD, energy, flight_array, impact, make_grasp, reduced_mass

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Status
from grasp_ros.methods import discrete_gradient, fixed_step, library
from grasp_ros.methods.contract import STEP, Problem, Solution
from grasp_ros.methods.equations import parameters
from grasp_ros.methods.registry import EXACT, METHODS
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array, Grasp, acceleration
from grasp_ros.physics.system import System
from grasp_ros.simulation import Trajectory, load, simulate

SEVERAL = 10_000
STEPPING = [name for name in METHODS if name != EXACT]
LOCATING = [name for name in STEPPING if METHODS[name].events]
PRECISE = {STEP: 2e-5, "tolerance": 1e-11}


def horizon(name: str, seconds: float, *settings: str) -> scenes.Scene:
    return scenes.load(name, [f"time.duration_s={seconds}", *settings])


def fixed(rule: int, grasp: Grasp, state: Any, grid: Any, step: float) -> Solution:
    return fixed_step.solve(rule, problem_of(grasp, state, grid, step))


def problem_of(grasp: Grasp, state: Any, grid: Any, step: float) -> Problem:
    """Up to the last output time."""
    times = np.asarray(grid, dtype=float)
    return Problem(System.of(grasp, state), float(times[-1]), times, step, SEVERAL)


def slope(steps: Any, errors: Any) -> float:
    """Order from errors over steps, both on logarithmic scales."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def python_rk4(grasp: Grasp, y: Array, h: float, push: bool) -> Array:
    """One classical step with the model's own right-hand side; `push` False: nothing touches."""
    without = grasp._replace(
        left_contact=grasp.left_contact._replace(hertzian=0.0), right_contact=grasp.right_contact._replace(hertzian=0.0)
    )

    def f(y: Array) -> Array:
        a_l, a_o, a_r = acceleration(grasp if push else without, y)
        return np.array([y[1], a_l, y[3], a_o, y[5], a_r])

    k1 = f(y)
    k2 = f(y + 0.5 * h * k1)
    k3 = f(y + 0.5 * h * k2)
    k4 = f(y + h * k3)
    return y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


# Order on smooth motion: arms that swing and touch nothing.

SWING = make_grasp(right=FREE)
AWAY = np.array([-0.3, 0.2, 9.0, 0.0, 50.0, 0.0])


def swing_error(solution: Solution, times: Array) -> float:
    exact = flight_array((1.0, 15.0, 0.7, 0.0), -0.3, 0.2, times)
    return float(np.abs(solution.state[:, :2] - np.array(exact).T).max())


@pytest.mark.parametrize("rule", [fixed_step.PLAIN, fixed_step.PAPER, fixed_step.LOCATED])
def test_runge_kutta_is_of_order_4_where_nothing_touches(rule: int) -> None:
    times = np.linspace(0.0, 0.5, 34)  # most outputs fall between steps: the interpolant is tested as well
    steps = [0.5 / n for n in (8, 16, 32, 64)]
    errors = [swing_error(fixed(rule, SWING, AWAY, times, h), times) for h in steps]
    assert slope(steps, errors) == pytest.approx(4.0, abs=0.15)
    assert errors[-1] < 1e-7


def test_discrete_gradient_is_of_order_2() -> None:
    times = np.linspace(0.0, 0.5, 34)
    steps = [0.5 / n for n in (16, 32, 64, 128)]
    errors = [
        swing_error(discrete_gradient.solve(problem_of(SWING, AWAY, times, h)), times) for h in steps
    ]
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


# The paper's method.


def test_paper_touch_step_by_hand() -> None:
    """Free bodies: the gap of 0.6 mm closes with 1 m/s, so the touch lies at 0.6 of a step of 1 ms."""
    grasp, h = make_grasp(FREE, object_mass=2.0), 1e-3
    start = np.array([-0.6e-3, 1.0, 0.0, 0.0, 1.0, 0.0])
    result = fixed(fixed_step.PAPER, grasp, start, [h, 2 * h], h)
    at_touch = np.array([0.0, 1.0, 0.0, 0.0, 1.0, 0.0])
    after = python_rk4(grasp, at_touch, 0.4 * h, push=True)
    assert result.state[0] == pytest.approx(after, abs=1e-15)
    assert result.state[1] == pytest.approx(python_rk4(grasp, after, h, push=True), abs=1e-15)
    assert result.event_table == pytest.approx(np.array([[0.6 * h, LEFT, Transition.TOUCH, 0.0, 1.0]]), abs=1e-15)


def test_paper_release_step_by_hand() -> None:
    """A step in contact overshoots the release; the state there is a chord, not a motion."""
    grasp, h = make_grasp(FREE, object_mass=2.0, p=0.0), 1e-3
    start = np.array([4e-4, -1.0, 0.0, 0.0, 1.0, 0.0])  # in contact, separating
    overshoot = python_rk4(grasp, start, h, push=True)
    part = start[0] / (start[0] - (overshoot[0] - overshoot[2]))
    chord = start + part * (overshoot - start)
    result = fixed(fixed_step.PAPER, grasp, start, [0.1 * h, h], h)
    assert 0.3 < part < 0.5
    assert result.state[0] == pytest.approx(start + 0.1 * (overshoot - start), abs=1e-15)
    assert result.state[1] == pytest.approx(python_rk4(grasp, chord, (1.0 - part) * h, push=False), abs=1e-15)
    assert result.event_table[0, :3] == pytest.approx([part * h, LEFT, Transition.RELEASE], abs=1e-15)


def test_paper_takes_both_sides_in_one_step_in_their_order() -> None:
    """The right side touches at 0.3, the left one at about 0.8 of the step: one contact, then both."""
    grasp, h = make_grasp(FREE, object_mass=2.0), 1e-3
    start = np.array([-0.8e-3, 1.0, 0.0, 0.0, 0.3e-3, -1.0])
    result = fixed(fixed_step.PAPER, grasp, start, [h], h)
    first = start + 0.3 * (python_rk4(grasp, start, h, push=False) - start)
    only_right = grasp._replace(left_contact=grasp.left_contact._replace(hertzian=0.0))
    rest = python_rk4(only_right, first, 0.7 * h, push=True)
    gap, gap_end = first[0] - first[2], rest[0] - rest[2]
    part = gap / (gap - gap_end)
    second = first + part * (rest - first)
    last = python_rk4(grasp, second, (1.0 - part) * 0.7 * h, push=True)
    assert result.event_table[:, 1].tolist() == [RIGHT, LEFT]
    assert result.event_table[:, 0] == pytest.approx([0.3 * h, (0.3 + part * 0.7) * h], abs=1e-15)
    assert result.state[0] == pytest.approx(last, abs=1e-15)


def test_paper_is_of_order_2_through_a_touch() -> None:
    """Steps that meet the first touch of case 1 at their middle; elsewhere the motion is smooth."""
    grasp, start = make_grasp(STANDARD), [-0.3, 0.0, 0.0, 0.0, 9.0, 0.0]
    touch = simulate(horizon("case_01", 0.5, "right_arm.position_m=9")).times(Transition.TOUCH, LEFT)[0]
    exact = simulate(horizon("case_01", 0.44, "right_arm.position_m=9")).state[-1, :4]
    counts = (3200, 6400, 12800, 25600)
    steps = [touch / (n + 0.5) for n in counts]
    errors = [
        np.abs(fixed(fixed_step.PAPER, grasp, start, [0.44], h).state[-1, :4] - exact).max() for h in steps
    ]
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


# Energy.


def test_discrete_gradient_conserves_energy_through_contacts() -> None:
    scene = horizon("case_02", 20.0)
    for step in (1e-2, 1e-3):
        motion = simulate(scene, method="discrete_gradient", setting=step)
        level = energy(scene.grasp, motion.state).V_c
        assert (energy(scene.grasp, motion.state).mode > 0).sum() > 100
        assert np.abs(level / level[0] - 1.0).max() < 1e-12


def test_discrete_gradient_loses_what_the_damping_terms_say() -> None:
    """V_c falls in every step of case 1, and its balance closes to rounding: one mean force, one mean rate."""
    scene = horizon("case_01", 2.0)
    step = 1e-3
    motion = simulate(scene, method="discrete_gradient", setting=step, grid=np.arange(2001) * step)
    level = energy(scene.grasp, motion.state).V_c
    y = motion.state
    mean = (y[1:, 1::2] + y[:-1, 1::2]) / 2.0
    lost = 2.0 * step * 0.7 * (mean[:, 0] ** 2 + mean[:, 2] ** 2)
    for front, back in ((0, 2), (2, 4)):
        u = np.maximum(y[:, front] - y[:, back], 0.0)
        span = (y[1:, front] - y[1:, back]) - (y[:-1, front] - y[:-1, back])
        stored = 0.4e4 * (u[1:] ** 2.5 - u[:-1] ** 2.5)
        lost += 2.0 * 0.1 * stored * span / step
    assert (np.diff(level) < 0.0).all()
    assert np.abs(np.diff(level) + lost).max() < 1e-14 * level[0]


# All methods: one record, the right touches, and the right motion for a while.


@pytest.mark.parametrize("name", STEPPING)
def test_methods_agree_with_exact_for_some_contacts(name: str) -> None:
    method = METHODS[name]
    scene = horizon("case_01", 1.5)
    motion = simulate(scene, method=name, setting=PRECISE[method.knob])
    exact = simulate(scene)
    assert motion.status is Status.DONE
    assert motion.method == name
    assert np.abs(motion.state - exact.state).max() < (2e-5 if "discrete" in name or name == "paper" else 1e-6)
    assert motion.work[0] > 100
    if name in LOCATING:
        for side in (LEFT, RIGHT):
            for kind in (Transition.TOUCH, Transition.RELEASE):
                assert motion.times(kind, side) == pytest.approx(exact.times(kind, side), abs=1e-6)
    else:
        assert len(motion.event_table) == 0


@pytest.mark.parametrize("name", LOCATING)
def test_condition_10_is_an_event_in_both_directions(name: str) -> None:
    """Oracles' scene (a): both pairs pass u' = -1/p at once, come back through it, and then release."""
    settings = [
        f"{key}={value}"
        for side in ("left", "right")
        for key, value in (
            (f"{side}_feedback.position_gain_N_per_m", 50), (f"{side}_feedback.velocity_gain_Ns_per_m", 5),
            (f"{side}_contact.dissipation_s_per_m", 10),
        )
    ]
    scene = horizon("case_01", 0.4, "object.mass_kg=1", "right_arm.position_m=0.3", *settings)
    motion = simulate(scene, method=name, setting=PRECISE[METHODS[name].knob])
    tolerance = 1e-4 if name == "paper" else 1e-6
    for side in (LEFT, RIGHT):
        assert motion.times(Transition.CLAMP, side) == pytest.approx([0.315452318447362], abs=tolerance)
        assert motion.times(Transition.REENTRY, side) == pytest.approx([0.363159009501776], abs=tolerance)


@pytest.mark.parametrize("name", STEPPING)
def test_restitution_of_one_impact(name: str) -> None:
    """O2: two bodies that are free; the exit speed depends on p v alone."""
    law = impact(reduced_mass(1, 5), 1e4, "0.5", 1)
    settings = [
        f"{section}.{key}=0"
        for side in ("left", "right")
        for section, key in (
            (f"{side}_arm", "stiffness_N_per_m"), (f"{side}_arm", "damping_Ns_per_m"),
            (f"{side}_feedback", "position_gain_N_per_m"), (f"{side}_feedback", "velocity_gain_Ns_per_m"),
        )
    ]
    scene = horizon(
        "case_01", 0.5, *settings, "left_arm.position_m=-0.1", "left_arm.velocity_m_per_s=1", "right_arm.position_m=9",
        "left_contact.dissipation_s_per_m=0.5",
    )
    motion = simulate(scene, method=name, setting=PRECISE[METHODS[name].knob])
    assert motion.state[-1, 3] - motion.state[-1, 1] == pytest.approx(float(law.restitution), abs=1e-6)


def test_jacobian_is_the_derivative_of_the_right_hand_side() -> None:
    q = parameters(System.of(make_grasp(p=0.3, right=STANDARD._replace(mass=2.0)), np.zeros(6)))
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
    """design.md: order 8 with events reports success on case 2 with most of the 54 touches missed."""
    motion = simulate(horizon("case_02", 20.0), method="dop853_events", setting=1e-5)
    found = sum(len(motion.times(Transition.TOUCH, side)) for side in (LEFT, RIGHT))
    assert motion.status is Status.DONE
    assert 0 < found < 54


def test_a_step_that_is_unstable_ends_with_a_status() -> None:
    scene = horizon("case_01", 2000.0, "left_arm.damping_Ns_per_m=1e3")
    assert simulate(scene, method="rk4", setting=0.1).status is Status.NOT_FINITE
    assert simulate(scene, method="discrete_gradient", setting=0.1).status is Status.DONE


def test_saved_with_method_setting_and_its_own_counters(tmp_path: Any) -> None:
    motion = simulate(horizon("case_01", 1.0), method="rk4_events", setting=1e-3)
    motion.save(tmp_path / "a.npz")
    again = load(tmp_path / "a.npz")
    assert (again.method, again.setting, again.counters) == ("rk4_events", 1e-3, motion.counters)
    assert motion.counters["right hand sides"] >= 4000
    assert np.array_equal(again.event_table, motion.event_table)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"method": "euler"}, "method 'euler' is not allowed; allowed: exact, paper, rk4"),
        ({"method": "rk4", "setting": 0.0}, "rk4: step 0.0 is not allowed; allowed: 2e-09 to 2"),
        ({"method": "rk4", "setting": 3.0}, "rk4: step 3.0 is not allowed"),
        ({"method": "paper", "setting": math.nan}, "paper: step nan is not allowed"),
        ({"method": "dop853", "setting": 1e-15}, "dop853: tolerance 1e-15 is not allowed; allowed: 2.3e-14 to 0.01"),
        ({"method": "paper", "sampled": True}, "paper: only continuous feedback"),
        ({"method": "exact", "setting": 1e-20}, "exact: accuracy 1e-20 is not allowed; allowed: 1e-16 to 0.001"),
        ({"method": "rk4", "max_work": 100}, "rk4: has no budget of work; allowed with one: exact"),
    ],
)
def test_what_a_method_cannot_do_is_refused(options: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint.replace("(", r"\(")):
        simulate(horizon("case_01", 2.0), **options)


def test_scenes_with_more_than_the_basic_grasp_are_refused() -> None:
    basic = scenes.load("case_01")
    more = dataclasses.replace(basic, values={**basic.values, "line": {"tilt_rad": 0.1}})
    with pytest.raises(ValueError, match="case_01: line: rk4 knows two arms, an object and their contacts"):
        simulate(more, method="rk4")
    less = dataclasses.replace(basic, values={key: value for key, value in basic.values.items() if key != "object"})
    with pytest.raises(ValueError, match="case_01: object: rk4"):
        simulate(less, method="rk4")


def test_exact_is_the_default_and_its_setting_is_the_accuracy() -> None:
    scene = horizon("case_01", 1.0)
    plain, named = simulate(scene), simulate(scene, method=EXACT)
    assert isinstance(plain, Trajectory)
    assert plain.method == EXACT
    assert plain.state.tobytes() == named.state.tobytes()
    coarse = simulate(scene, method=EXACT, setting=1e-6)
    assert coarse.state.tobytes() == simulate(scene, accuracy=1e-6).state.tobytes()
    assert coarse.state.tobytes() != plain.state.tobytes()


def test_elastic_arm_keeps_its_period() -> None:
    """O12 with located events: 50 periods of 0.8893 s."""
    period = 0.88931643572931156661
    scene = horizon(
        "case_02", 50.0, "left_arm.position_m=-0.3", "right_arm.position_m=0.3",
    )
    motion = simulate(scene, method="rk4_events", setting=1e-4)
    assert ELASTIC.damping == 0.0
    touches = motion.times(Transition.TOUCH, LEFT)
    assert np.diff(touches) == pytest.approx(period, abs=1e-6)


def test_events_without_progress_end_with_a_status() -> None:
    """scipy at 1e-4 on case 2: a touch and a release at the same instant, for ever."""
    motion = simulate(horizon("case_02", 20.0), method="dop853_events", setting=1e-4)
    assert motion.status is Status.STALLED
    assert motion.t[-1] < 20.0

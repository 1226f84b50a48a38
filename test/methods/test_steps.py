"""Steps of fixed size: orders, steps computed by hand, and the energy of the discrete gradient."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from documents import case_of, horizon
from oracles import FREE, STANDARD, energy, flight_array, make_grasp

from grasp_ros.methods import discrete_gradient, fixed_step
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Array
from grasp_ros.simulation import simulate
from lab.reference.grasp import Grasp, acceleration, grasp_of, system_of

SEVERAL = 10_000


def fixed(rule: int, grasp: Grasp, state: Any, grid: Any, step: float) -> Solution:
    return fixed_step.solve(rule, problem_of(grasp, state, grid, step))


def problem_of(grasp: Grasp, state: Any, grid: Any, step: float) -> Problem:
    """Up to the last output time."""
    times = np.asarray(grid, dtype=float)
    return Problem(system_of(grasp, state), float(times[-1]), times, step, SEVERAL)


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


SWING = make_grasp(right=FREE)
AWAY = np.array([-0.3, 0.2, 9.0, 0.0, 50.0, 0.0])


def swing_error(solution: Solution, times: Array) -> float:
    exact = flight_array((1.0, 15.0, 0.7, 0.0), -0.3, 0.2, times)
    return float(np.abs(solution.state[:, :2] - np.array(exact).T).max())


@pytest.mark.parametrize(("solve", "order", "least", "within"), [
    *((partial(fixed_step.solve, rule), 4.0, 8, 0.15)
      for rule in (fixed_step.PLAIN, fixed_step.PAPER, fixed_step.LOCATED)),
    (discrete_gradient.solve, 2.0, 16, 0.1),
], ids=["plain", "paper", "located", "discrete_gradient"])
def test_the_order_where_nothing_touches(solve: Any, order: float, least: int, within: float) -> None:
    times = np.linspace(0.0, 0.5, 34)  # most outputs fall between steps: the interpolant is tested as well
    steps = [0.5 / n for n in (least, 2 * least, 4 * least, 8 * least)]
    errors = [swing_error(solve(problem_of(SWING, AWAY, times, h)), times) for h in steps]
    assert slope(steps, errors) == pytest.approx(order, abs=within)
    assert errors[-1] < (1e-7 if order == 4.0 else 1e-3)


@pytest.mark.parametrize("method", ["paper", "rk4", "rk4_events", "discrete_gradient"])
def test_pieces_change_no_bit(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    whole = simulate(case_of(), method=method, setting=1e-3)
    monkeypatch.setattr("grasp_ros.methods.equations.PIECE", 7)
    parts = simulate(case_of(), method=method, setting=1e-3)
    for one, other in ((whole.state, parts.state), (whole.event_table, parts.event_table), (whole.work, parts.work)):
        assert np.array_equal(one, other)


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
    errors = [np.abs(fixed(fixed_step.PAPER, grasp, start, [0.44], h).state[-1, :4] - exact).max() for h in steps]
    assert slope(steps, errors) == pytest.approx(2.0, abs=0.1)


def test_discrete_gradient_conserves_energy_through_contacts() -> None:
    scene = horizon("case_02", 20.0)
    for step in (1e-2, 1e-3):
        motion = simulate(scene, method="discrete_gradient", setting=step)
        level = energy(grasp_of(scene), motion.state).V_c
        assert (energy(grasp_of(scene), motion.state).mode > 0).sum() > 100
        assert np.abs(level / level[0] - 1.0).max() < 1e-12


def test_discrete_gradient_loses_what_the_damping_terms_say() -> None:
    """V_c falls in every step of case 1, and its balance closes to rounding: one mean force, one mean rate."""
    scene = horizon("case_01", 2.0)
    step = 1e-3
    motion = simulate(scene, method="discrete_gradient", setting=step, grid=np.arange(2001) * step)
    level = energy(grasp_of(scene), motion.state).V_c
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

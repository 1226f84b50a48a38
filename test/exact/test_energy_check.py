"""The guard behind every segment: what it stops, and what it must not stop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from documents import body, made
from exact.bench import SIDES, bench

from grasp_ros import scene
from grasp_ros.exact.driver.energy_check import check_segment, energy_level
from grasp_ros.exact.integrator import Status
from grasp_ros.exact.records import Level
from grasp_ros.physics.impact_law import stored_energy
from grasp_ros.physics.layout import EPS, LEFT, RIGHT, Body, Law, Of, Outcome, Pair, U, X
from grasp_ros.physics.system import COLUMN
from grasp_ros.simulation import simulate

OPEN = (Pair.OPEN, Pair.OPEN)
GRAZE = {"before": 0.6**2, "t": 0.01}  # J, s: of a body that comes with 0.6 m/s and just reaches the other one


def outcome(side: Body, u: float, mode: Pair, before: float = 0.0, t: float = 0.01, u_before: float = -1.0) -> Outcome:
    """What the guard says of a pair at u after t s; `before`: J of V that the segment began with, at `u_before`."""
    b = bench(side, u, 0.0, mode)
    after = energy_level(b.plant, b.state, t)
    begin = Level(after.value, max(after.size, before), u_before, u_before)
    return Outcome(check_segment(b.plant, b.state, b.settings, begin, after, t, 0, OPEN))


@SIDES
@pytest.mark.parametrize(("u", "mode", "options", "expected"), [
    (1e-3, Pair.OPEN, {}, Outcome.PENETRATES), (1e-12, Pair.OPEN, {}, Outcome.PENETRATES),
    (-1e-3, Pair.OPEN, {}, Outcome.GO_ON), (1e-3, Pair.CONTACT, {}, Outcome.GO_ON),
    (0.0, Pair.OPEN, {}, Outcome.GO_ON),
    (1e-18, Pair.OPEN, GRAZE, Outcome.GO_ON), (1e-12, Pair.OPEN, GRAZE, Outcome.PENETRATES),  # roundings of the way
    (1.68e-17, Pair.OPEN, {"t": 1e-17}, Outcome.PENETRATES),
    (1.68e-17, Pair.OPEN, {"t": 1e-17, "u_before": 1.68e-17}, Outcome.GO_ON),  # a longer way has left it
])
def test_an_open_pair_that_is_closed_is_a_touch_that_was_missed(
    side: Body, u: float, mode: Pair, options: dict[str, float], expected: Outcome
) -> None:
    assert outcome(side, u, mode, **options) is expected


@SIDES
@pytest.mark.parametrize(("u", "expected"), [(1e-149, Outcome.PENETRATES), (1e-151, Outcome.GO_ON)])
def test_what_has_died_out_is_no_missed_touch(side: Body, u: float, expected: Outcome) -> None:
    b = bench(side, u, 0.0, Pair.OPEN, beside=(-u, 0.0))  # nothing else is there, or moves
    begin = Level(0.0, 0.0, -u, -u)
    assert check_segment(b.plant, b.state, b.settings, begin, begin, 1e-9, 0, OPEN) == expected


@SIDES
@pytest.mark.parametrize(("accuracy", "change", "expected"), [
    (1e-16, 1e-9, Outcome.ENERGY_RISES), (1e-16, -1e-9, Outcome.ENERGY_FALLS), (1e-16, 4e-16, Outcome.GO_ON),
    (1e-16, -4e-16, Outcome.GO_ON), (1e-6, 0.9e-4, Outcome.GO_ON), (1e-6, 1.1e-4, Outcome.ENERGY_RISES),
    (1e-3, 0.09, Outcome.GO_ON), (1e-3, 0.11, Outcome.ENERGY_RISES), (1e-3, -0.11, Outcome.ENERGY_FALLS)])
def test_energy_comes_from_nowhere_and_an_accuracy_explains_a_hundred_times_itself(
    side: Body, accuracy: float, change: float, expected: Outcome
) -> None:
    b = bench(side, -0.1, 0.5, p=0.0)
    settings, after = b.settings._replace(tolerance=accuracy), energy_level(b.plant, b.state, 0.01)
    begin = Level(after.value - change * after.size, after.size, -0.1, -0.1)
    assert check_segment(b.plant, b.state, settings, begin, after, 0.01, 0, OPEN) == expected


@pytest.mark.parametrize("accuracy", [1e-3, 1e-4, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("angle", [-0.1, 0.5])
def test_bodies_that_touch_and_are_set_moving_have_missed_no_touch(accuracy: float, angle: float) -> None:
    case = scene.load("case_01", [
        "left_arm.position_m=0", "right_arm.position_m=0", f"tilt.angle_rad={angle}", "tilt.gravity_m_per_s2=9.81"])
    grid = np.array([0.5])
    run, truth = simulate(case, setting=accuracy, grid=grid), simulate(case, grid=grid)
    assert run.status is Status.DONE
    assert run.state == pytest.approx(truth.state, rel=100.0 * accuracy, abs=100.0 * accuracy)


@SIDES
@pytest.mark.parametrize(("loss", "t", "mode", "options", "expected"), [
    (0.01, 0.25, Pair.OPEN, {"stiffness": 10.0}, Outcome.ENERGY_FALLS),  # a spring keeps what it takes
    (0.01, 0.1, Pair.OPEN, {"p": 0.5}, Outcome.ENERGY_FALLS),  # nothing is dissipated 0.1 m apart
    (0.01, 0.1, Pair.RESTING, {"p": 0.5}, Outcome.ENERGY_FALLS),
    (0.01, 0.1, Pair.CONTACT, {"p": 0.5}, Outcome.GO_ON),
    (0.01, 0.1, Pair.CONTACT, {"p": 0.0}, Outcome.ENERGY_FALLS),
    (0.5, 0.1, Pair.OPEN, {"coulomb": 10.0}, Outcome.GO_ON),
    (0.5, 0.1, Pair.OPEN, {"coulomb": 1e-3}, Outcome.ENERGY_FALLS),
])
def test_energy_falls_by_no_more_than_what_can_take_it(
    side: Body, loss: float, t: float, mode: Pair, options: dict[str, float], expected: Outcome
) -> None:
    b = bench(side, -0.1, 0.5, mode, **{"p": 0.0, **options})  # type: ignore[arg-type]
    after = energy_level(b.plant, b.state, t)
    begin = Level(after.value + loss, after.size + loss, -0.1, -0.1)
    modes = (Pair(int(b.state.mode[LEFT])), Pair(int(b.state.mode[RIGHT])))
    assert check_segment(b.plant, b.state, b.settings, begin, after, t, 0, modes) == expected


@SIDES
@pytest.mark.parametrize(("part", "expected"), [(0.9, Outcome.GO_ON), (2.1, Outcome.ENERGY_FALLS)])
def test_a_damper_takes_no_more_than_its_rate(side: Body, part: float, expected: Outcome) -> None:
    t, rate = 0.01, 3.0
    b = bench(side, -0.1, 0.5, p=0.0)
    b.plant.given[side, Of.DAMPING] = b.plant.bodies[side, Of.DAMPING] = rate
    after = energy_level(b.plant, b.state, t)
    before = after.value / (1.0 - 2.0 * part * rate * t)
    begin = Level(before, before, -0.1, -0.1)
    assert check_segment(b.plant, b.state, b.settings, begin, after, t, 0, OPEN) == expected


@SIDES
@pytest.mark.parametrize("mode", [Pair.CLAMPED, Pair.LEAVING])
def test_a_pair_without_force_loses_what_it_stored_and_no_more(side: Body, mode: Pair) -> None:
    b = bench(side, 0.01, -3.0, mode)
    after, stored = energy_level(b.plant, b.state, 0.01), 2.0 * stored_energy(1e4, 0.02)
    modes = (mode, Pair.OPEN) if side == LEFT else (Pair.OPEN, mode)
    u = (0.02, -1.0) if side == LEFT else (-1.0, 0.02)
    for lost, expected in ((0.9 * stored, Outcome.GO_ON), (1.1 * stored, Outcome.ENERGY_FALLS)):
        begin = Level(after.value + lost, after.size + lost, *u)
        assert check_segment(b.plant, b.state, b.settings, begin, after, 0.01, 0, modes) == expected


@SIDES
@pytest.mark.parametrize(("x", "v", "expected"), [
    (9e11, 0.0, Outcome.GO_ON), (2e12, 0.0, Outcome.OUTSIDE), (0.0, 9e11, Outcome.GO_ON),
    (0.0, -2e12, Outcome.OUTSIDE),
])
def test_a_motion_that_leaves_the_domain_is_stopped(side: Body, x: float, v: float, expected: Outcome) -> None:
    b = bench(side, -0.1, 0.0)
    b.state.y[[COLUMN[side], COLUMN[side] + 1]] = x, v
    level = energy_level(b.plant, b.state, 0.0)
    assert check_segment(b.plant, b.state, b.settings, level, level, 0.01, 0, OPEN) == expected


@SIDES
def test_an_arm_at_zero_has_the_roundings_of_the_object_that_it_touches(side: Body) -> None:
    """What they are under its spring may come in a segment, and no more."""
    depth, sign = 1e-3, 1.0 if side == LEFT else -1.0
    b = bench(side, depth, 0.0, Pair.CONTACT, stiffness=1e12)
    b.state.y[COLUMN[side]], b.state.y[X.O] = 0.0, -sign * depth
    b.plant.pairs[:, Law.HERTZIAN] = 1e-9
    after, modes = energy_level(b.plant, b.state, 0.01), (Pair(int(b.state.mode[LEFT])), Pair(int(b.state.mode[RIGHT])))
    for roundings, expected in ((1.0, Outcome.GO_ON), (100.0, Outcome.ENERGY_RISES)):
        came = 1e12 * (roundings * EPS * depth) ** 2
        begin = after._replace(value=after.value - came)
        assert check_segment(b.plant, b.state, b.settings, begin, after, 0.01, 0, modes) == expected


@SIDES
def test_an_arm_that_has_swung_a_million_times_touches_two_roundings_of_time_late(side: Body) -> None:
    """Its spring has what it moves meanwhile, and no more; the speed that is believed of it does not grow with that."""
    x, v, t, stiffness = 0.8, 600.0, 1e6 / 1e3, 1e6
    b = bench(side, 0.0, 0.0, stiffness=stiffness)
    b.state.y[[COLUMN[side], COLUMN[side] + 1]], b.state.y[X.O] = (x, v), x
    after = energy_level(b.plant, b.state, t)
    for roundings, expected in ((1.9, Outcome.GO_ON), (2.2, Outcome.ENERGY_RISES)):
        begin = after._replace(value=after.value - 2.0 * stiffness * x * v * t * EPS * roundings)
        assert check_segment(b.plant, b.state, b.settings, begin, after, t, 0, OPEN) == expected
    assert after.size < 3.0 * after.value


@SIDES
def test_a_touch_takes_an_arm_out_of_the_object_that_roundings_left_in_it(side: Body) -> None:
    x, u, stiffness = 0.8, 1e-9, 1e6
    b = bench(side, 0.0, 0.0, stiffness=stiffness)
    b.state.y[COLUMN[side]], b.state.y[X.O] = x, x
    after = energy_level(b.plant, b.state, 0.01)
    for mode, depth, expected in ((Pair.OPEN, 0.9 * u, Outcome.GO_ON), (Pair.OPEN, 1.1 * u, Outcome.ENERGY_RISES),
                                  (Pair.CONTACT, 0.9 * u, Outcome.ENERGY_RISES)):
        begin = Level(after.value - 2.0 * stiffness * x * depth, after.size, u, u)
        assert check_segment(b.plant, b.state, b.settings, begin, after, 0.01, 0, (mode, mode)) == expected


@SIDES
def test_touches_behind_ten_million_swings_of_an_arm_raise_no_alarm(side: Body) -> None:
    """A slow object comes into its reach."""
    (sign, name), (speed, seconds) = ((-1.0, "left") if side == LEFT else (1.0, "right")), (1e-4, 1e4)
    for x in np.linspace(1.0, 1.02, 12).tolist():
        run = simulate(made(1.2 * seconds, 1.0, **{
            f"{name}_arm": body(x=sign, stiffness_N_per_m=1e6, damping_Ns_per_m=0.0),
            f"{name}_contact": {"hertz_N_per_m1_5": 1e6, "dissipation_s_per_m": 0.0},
            "object": body(x=-sign * (x + speed * seconds), v=sign * speed)}), grid=[0.0], max_events=6)
        assert run.status is Status.EVENT_BUDGET
    run = simulate(made(3234.0, 1.0, **{  # whose touch is farther off than one rounding of its time
        f"{name}_arm": body(x=sign, stiffness_N_per_m=656532184.2025075, damping_Ns_per_m=0.0),
        f"{name}_contact": {"hertz_N_per_m1_5": 97397932.4743645, "dissipation_s_per_m": 0.0},
        "object": body(0.24853643640478007, -sign * 1.7554618657443566, sign * 0.0002706277314684382),
        }), grid=[0.0], max_events=6, setting=1.3084066102919687e-16)
    assert run.status is Status.EVENT_BUDGET


@SIDES
def test_a_segment_without_an_end_or_with_a_number_that_is_none_is_stopped(side: Body) -> None:
    b = bench(side, -0.1, 0.5)
    level = energy_level(b.plant, b.state, 0.0)
    assert check_segment(b.plant, b.state, b.settings, level, level, 0.0, 10_000, OPEN) == Outcome.STALLED
    b.state.y[U.L + side] = math.nan
    assert check_segment(b.plant, b.state, b.settings, level, level, 0.01, 0, OPEN) == Outcome.NOT_FINITE

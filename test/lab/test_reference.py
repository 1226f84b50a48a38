"""The high-precision oracle against closed forms, quadrature and printed digits."""

from __future__ import annotations

from typing import Any

import gmpy2
import numpy as np
import pytest
from documents import body, made
from gmpy2 import mpfr
from mpmath import mpf

from grasp_ros import scene as scenes
from grasp_ros.physics.model import Arm, Contact
from lab.cases.scenes import ELASTIC, FREE, grasp
from lab.oracles.closed_forms import elastic_period, first_peak, first_touch_from_rest, graze, impact, reduced_mass
from lab.reference import Reference, integrate

pytestmark = pytest.mark.slow  # 20 s in 30 digits

PRINTED = {  # touches within 20 s, and the state then, by the name of the scene
    "case_01": ((22, 22), (
        "-0.008512122262300968", "-0.01108793106509753", "-0.005641499599319561",
        "0.003432506812203915", "-0.000836308954716825", "0.003317426128557128",
    )),
    "case_02": ((29, 25), (
        "-0.175510327111734835", "-1.058273923313224168", "0.242668174453789460",
        "0.253091130418953650", "0.241799019116783920", "-1.523332834172496000",
    )),
    "case_03": ((27, 21), (
        "-0.034795622945329670", "0.192391895809465640", "0.139780629076549980",
        "0.119623231343507430", "0.129516542645941870", "0.203114606289420240",
    )),
}


@pytest.fixture(autouse=True)
def _precision() -> Any:
    with gmpy2.context(precision=160):
        yield


def close(actual: Any, expected: Any, tolerance: str) -> bool:
    """Numbers of mpmath, too."""
    return bool(abs(mpfr(str(actual)) - mpfr(str(expected))) <= mpfr(tolerance))


@pytest.mark.parametrize("name", PRINTED)
@pytest.mark.thorough
def test_printed_states_of_the_marginal_and_standard_cases(name: str) -> None:
    touches, printed = PRINTED[name]
    result = integrate(scenes.load(name), [0.0, 20.0], digits=30, decimal=True)
    assert all(close(a, b, "2e-17") for a, b in zip(result.state[-1], printed, strict=True))
    assert tuple(map(len, result.touches)) == touches
    assert result.touches[0][0] == result.touches[1][0]


def test_the_elastic_case_keeps_its_energy() -> None:
    result = integrate(scenes.load("case_02"), np.linspace(0.0, 4.0, 41), decimal=True)
    pressed = set()
    for x_l, v_l, x_o, v_o, x_r, v_r in result.state:
        depths = max(x_l - x_o, 0), max(x_o - x_r, 0)
        stored = 8000 * sum(gmpy2.sqrt(depth) ** 5 for depth in depths)  # (4/5) H u^(5/2)
        assert close(15 * (x_l**2 + x_r**2) + v_l**2 + 5 * v_o**2 + v_r**2 + stored, "5.1", "1e-22")
        pressed.add(stored > 0)  # 5.1 J are 15 (0.3^2 + 0.5^2)
    assert pressed == {False, True}


def test_first_contact_of_the_standard_case() -> None:
    """O4."""
    result = integrate(scenes.load("case_01"), [0.0, 0.6], decimal=True)
    assert close(result.touches[0][0], first_touch_from_rest(1, 15, "0.7"), "1e-25")
    assert close(result.releases[0][0], "0.513325334884", "6e-13")
    assert close(result.releases[1][0], "0.503118325389", "6e-13")


def test_more_digits_and_a_finer_grid_change_nothing() -> None:
    scene = scenes.load("case_03")
    coarse, fine = integrate(scene, [0.0, 2.0], digits=20), integrate(scene, np.linspace(0.0, 2.0, 101), digits=30)
    assert all(close(a, b, "1e-15") for a, b in zip(coarse.state[-1], fine.state[-1], strict=True))
    assert all(
        close(a, b, "1e-15")
        for name in ("touches", "releases")
        for left, right in zip(getattr(coarse, name), getattr(fine, name), strict=True)
        for a, b in zip(left, right, strict=True)
    )
    assert fine.as_array().shape == (101, 6)


def two_bodies(m1: float, m2: float, hertzian: float, p: float, speed: float) -> Reference:
    """An impact of free bodies in their centre-of-mass frame's shape: the left arm meets a resting object."""
    scene = grasp([-speed, speed, 0.0, 0.0, 50.0, 0.0], 2.0, left=FREE._replace(mass=m1), right=FREE,
                  contact=Contact(hertzian, p), mass=m2)
    return integrate(scene, [0.0, 2.0], digits=30, decimal=True)


def test_hertz_impact_lasts_as_long_as_the_beta_function_says() -> None:
    """O1."""
    result = two_bodies(1.0, 1.0, 1e4, 0.0, 1.0)
    assert close(result.touches[0][0], 1, "1e-28")
    assert close(result.releases[0][0] - result.touches[0][0], impact("0.5", 1e4, 0, 1).duration, "1e-27")
    _, v_l, _, v_o, *_ = result.state[-1]
    assert close(v_o - v_l, 1, "1e-27")
    assert close(v_o + v_l, 1, "1e-27")


@pytest.mark.parametrize(
    ("m1", "m2", "hertzian", "p", "speed"),
    [(1.0, 1.0, 1e4, 0.3, 1.0), (2.0, 3.0, 1e9, 0.5, 0.01), (1.0, 1e-3, 1e5, 10.0, 3.0)],
)
def test_damped_impact_has_the_restitution_of_its_first_integral(
    m1: float, m2: float, hertzian: float, p: float, speed: float
) -> None:
    """O2."""
    result = two_bodies(m1, m2, hertzian, p, speed)
    law = impact(reduced_mass(repr(m1), repr(m2)), hertzian, repr(p), repr(speed))
    _, v_l, _, v_o, *_ = result.state[-1]
    assert close((v_o - v_l) / mpfr(repr(speed)), law.restitution, "1e-25")


def test_an_elastic_symmetric_scene_is_periodic() -> None:
    """O12."""
    period = mpfr(str(elastic_period(1, 15, 10_000, "0.3")))
    scene = grasp([-0.3, 0.0, 0.0, 0.0, 0.3, 0.0], 3.0, left=ELASTIC, contact=Contact(1e4, 0.0), mass=3.0)
    first, second = integrate(scene, [0.0, 2.0, 2.0 + period], digits=30, decimal=True).state[1:]
    assert all(close(a, b, "2e-18") for a, b in zip(first, second, strict=True))
    assert first[2] == first[3] == 0
    assert first[0] + first[4] == 0


def test_clamped_pairs_leave_and_come_back() -> None:
    scene = grasp([-0.3, 0.0, 0.0, 0.0, 0.3, 0.0], 0.4, left=Arm(1.0, 10.0, 0.2, 50.0, 5.0),
                  contact=Contact(1e4, 10.0), mass=1.0)
    times = [0.0, "0.315452318447362", "0.363159009501776", 0.4]
    result = integrate(scene, times, digits=30, decimal=True)
    assert result.touches[0] == result.touches[1]
    assert close(result.releases[0][0], "0.315452318447362", "1e-15")
    assert close(result.touches[0][1], "0.363159009501776", "1e-15")
    assert close(result.state[1][0], "0.01117960563511", "1e-14")
    assert close(result.state[2][0], "0.006353953744931", "1e-15")


def test_an_asymmetric_pair_comes_back_into_contact() -> None:
    scene = grasp([-0.3, 0.0, 0.0, 0.0, 0.2, 0.0], 0.6, contact=Contact(1e3, 15.0), mass=1.0)
    assert close(integrate(scene, [0.0, 0.6], digits=30, decimal=True).touches[1][1], "0.572927357351903", "1e-15")


@pytest.mark.parametrize(
    ("object_mass", "speeds"),
    [
        (1.0, ("-0.070952353651436871", "0.076403039071206993", "0.994549314580229878")),
        (0.1, ("-0.0475095756030004457", "0.907669860965354066", "0.956742589506465039")),
    ],
)
def test_a_touching_chain(object_mass: float, speeds: tuple[str, ...]) -> None:
    """O11."""
    scene = grasp([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 1.0, left=FREE, contact=Contact(1e4, 0.0), mass=object_mass)
    result = integrate(scene, [0.0, 1.0], digits=20, decimal=True)
    assert all(close(a, b, "2e-18") for a, b in zip(result.state[-1][1::2], speeds, strict=True))


@pytest.mark.parametrize(("overshoot", "touches"), [("1e-6", 1), ("1e-15", 1), ("-1e-15", 0), ("-1e-6", 0)])
def test_grazing_is_neither_missed_nor_invented(overshoot: str, touches: int) -> None:
    """O13."""
    peak = first_peak("-0.3", 1, 15, "0.7")
    start = [-0.3, 0.0, str(peak - mpf(overshoot)), 0.0, 50.0, 0.0]
    scene = grasp([-0.3, 0.0, 0.2, 0.0, 50.0, 0.0], 1.0, right=FREE, contact=Contact(1e4, 0.0), mass=1.0)
    result = integrate(scene, [0.0, 1.0], state=start, decimal=True)
    assert [len(result.touches[0]), len(result.releases[0])] == [touches, touches]
    if touches:
        duration = float(result.releases[0][0] - result.touches[0][0])
        assert duration == pytest.approx(graze(overshoot, 15 * peak, 1e4)[0], rel=1e-3)


@pytest.mark.parametrize("delay", ["1e-3", "1e-8", "1e-16", "1e-22"])
def test_touches_that_are_nearly_simultaneous(delay: str) -> None:
    """O15."""
    scene = grasp([-1.0, 1.0, 0.0, 0.0, 1.0, -1.0], 1.5, left=FREE, contact=Contact(1e4, 0.3), mass=1.0)
    start = [-1.0, 1.0, 0.0, 0.0, 1 + mpfr(delay), -1.0]
    result = integrate(scene, [0.0, 1.5], digits=30, state=start, decimal=True)
    assert abs((result.touches[1][0] - result.touches[0][0]) / mpfr(delay) - 1) < mpfr("1e-4")
    assert abs(result.state[-1][3] / mpfr(delay) + mpfr("5.65648")) < mpfr("1e-5") + 50 * mpfr(delay)


@pytest.mark.parametrize(
    ("damping", "spring"), [(0.0, 0.0), (0.5, 0.0), (0.0, 4.0), (1.0, 4.0), (4.0, 4.0), (5.0, 4.0)]
)
def test_flight_of_an_arm_solves_its_own_equation(damping: float, spring: float) -> None:
    scene = made(3.0, left_arm=body(1.0, 0.2, 1.0, stiffness_N_per_m=spring, damping_Ns_per_m=damping),
                 left_arm_pulse={"force_N": 3.0, "start_s": 0.0, "length_s": 3.0})
    h = mpfr("1e-9")
    result = integrate(scene, [0, 2 - h, 2, 2 + h], digits=40)
    x, v = zip(*(row[:2] for row in result.state), strict=True)
    assert close((x[3] - x[1]) / (2 * h), v[2], "1e-16")
    assert close((v[3] - v[1]) / (2 * h), 3 - damping * v[2] - spring * x[2], "1e-16")
    assert (x[0], v[0]) == (0.2, 1)


def test_start_in_contact_agrees_with_passing_through() -> None:
    scene = grasp([-1.0, 1.0, 0.0, 0.0, 50.0, 0.0], 1.5, left=FREE, contact=Contact(1e4, 0.3), mass=2.0)
    whole = integrate(scene, [0.0, 1.02, 1.5])
    rest = integrate(scene, [0, mpfr(1.5) - mpfr(1.02)], state=whole.state[1])
    assert all(close(a, b, "1e-24") for a, b in zip(whole.state[2], rest.state[1], strict=True))
    assert rest.touches == ([], [])

"""The high-precision oracle against closed forms, quadrature and printed digits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gmpy2
import numpy as np
import pytest
from gmpy2 import mpfr

from grasp_ros.physics.model import Arm, Contact
from lab.reference import Reference, integrate
from lab.reference.grasp import Grasp

pytestmark = pytest.mark.slow  # 20 s in 30 digits

FREE = Arm(1.0, 0.0, 0.0, 0.0, 0.0)
NOTHING = Contact(0.0, 0.0)
STANDARD = Arm(1.0, 10.0, 0.2, 5.0, 0.5)
ELASTIC = Arm(1.0, 10.0, 0.0, 5.0, 0.0)
AT_REST = [-0.3, 0.0, 0.0, 0.0, 0.5, 0.0]
START_APART = [-1.0, 1.0, 0.0, 0.0, 50.0, 0.0]  # the left arm needs 1 s to the object, the right one is far away


@pytest.fixture(autouse=True)
def _precision() -> Any:
    with gmpy2.context(precision=160):
        yield


def grasp(arm: Arm, hertzian: float, p: float, object_mass: float) -> Grasp:
    """The same arm and contact on both sides."""
    return Grasp(arm, arm, Contact(hertzian, p), Contact(hertzian, p), object_mass)


def close(actual: Any, expected: Any, tolerance: str) -> bool:
    return bool(abs(mpfr(actual) - mpfr(expected)) <= mpfr(tolerance))


def bisect(function: Callable[[Any], Any], low: Any, high: Any) -> Any:
    """The root of a function that is positive at `low` and negative at `high`."""
    for _ in range(150):
        middle = (low + high) / 2
        low, high = (middle, high) if function(middle) > 0 else (low, middle)
    return low


CASES = {
    1: (
        grasp(STANDARD, 1e4, 0.1, 5.0),
        (
            "-0.008512122262300968",
            "-0.01108793106509753",
            "-0.005641499599319561",
            "0.003432506812203915",
            "-0.000836308954716825",
            "0.003317426128557128",
        ),
        (22, 22),
    ),
    2: (
        grasp(ELASTIC, 1e4, 0.0, 5.0),
        (
            "-0.175510327111734835",
            "-1.058273923313224168",
            "0.242668174453789460",
            "0.253091130418953650",
            "0.241799019116783920",
            "-1.523332834172496000",
        ),
        (29, 25),
    ),
    3: (
        grasp(ELASTIC, 1e4, 0.1, 5.0),
        (
            "-0.034795622945329670",
            "0.192391895809465640",
            "0.139780629076549980",
            "0.119623231343507430",
            "0.129516542645941870",
            "0.203114606289420240",
        ),
        (27, 21),
    ),
}


@pytest.mark.parametrize("number", CASES)
@pytest.mark.thorough
def test_printed_states_of_the_marginal_and_standard_cases(number: int) -> None:
    scene, printed, touches = CASES[number]
    result = integrate(scene, AT_REST, [0.0, 20.0], digits=30, decimal=True)
    assert all(close(a, b, "2e-17") for a, b in zip(result.state[-1], printed, strict=True))
    assert tuple(map(len, result.touches)) == touches
    assert result.touches[0][0] == result.touches[1][0]


def test_the_elastic_case_keeps_its_energy() -> None:
    result = integrate(CASES[2][0], AT_REST, np.linspace(0.0, 4.0, 41).tolist(), digits=25, decimal=True)
    pressed = set()
    for x_l, v_l, x_o, v_o, x_r, v_r in result.state:
        depths = max(x_l - x_o, 0), max(x_o - x_r, 0)
        stored = 8000 * sum(gmpy2.sqrt(depth) ** 5 for depth in depths)  # (4/5) H u^(5/2)
        assert close(15 * (x_l**2 + x_r**2) + v_l**2 + 5 * v_o**2 + v_r**2 + stored, "5.1", "1e-22")
        pressed.add(stored > 0)  # 5.1 J are 15 (0.3^2 + 0.5^2)
    assert pressed == {False, True}


def test_first_contact_of_the_standard_case() -> None:
    """O4."""
    result = integrate(CASES[1][0], AT_REST, [0.0, 0.6], digits=25, decimal=True)
    s, w = mpfr("0.35"), gmpy2.sqrt(15 - mpfr("0.35") ** 2)
    assert close(result.touches[0][0], (gmpy2.const_pi() - gmpy2.atan2(w, s)) / w, "1e-25")
    assert close(result.releases[0][0], "0.513325334884", "6e-13")
    assert close(result.releases[1][0], "0.503118325389", "6e-13")


def test_more_digits_and_a_finer_grid_change_nothing() -> None:
    coarse = integrate(CASES[3][0], AT_REST, [0.0, 2.0], digits=20)
    fine = integrate(CASES[3][0], AT_REST, np.linspace(0.0, 2.0, 101).tolist(), digits=30)
    assert all(close(a, b, "1e-15") for a, b in zip(coarse.state[-1], fine.state[-1], strict=True))
    assert all(
        close(a, b, "1e-15")
        for name in ("touches", "releases")
        for left, right in zip(getattr(coarse, name), getattr(fine, name), strict=True)
        for a, b in zip(left, right, strict=True)
    )
    assert fine.as_array().shape == (101, 6)


def two_bodies(m1: float, m2: float, hertzian: float, p: Any, speed: Any) -> Reference:
    """An impact of free bodies in their centre-of-mass frame's shape: the left arm meets a resting object."""
    scene = Grasp(FREE._replace(mass=m1), FREE, Contact(hertzian, p), NOTHING, m2)
    return integrate(scene, [-speed, speed, 0.0, 0.0, 50.0, 0.0], [0.0, 2.0], digits=30, decimal=True)


def test_hertz_impact_lasts_as_long_as_the_beta_function_says() -> None:
    """O1."""
    result = two_bodies(1.0, 1.0, 1e4, 0.0, 1.0)
    beta = gmpy2.gamma(mpfr("0.4")) * gmpy2.gamma(mpfr("0.5")) / gmpy2.gamma(mpfr("0.9"))
    depth = gmpy2.root((mpfr(5) / 80000) ** 2, 5)  # (5 mu v^2 / 4 H)^(2/5), mu = 1/2
    assert close(result.touches[0][0], 1, "1e-28")
    assert close(result.releases[0][0] - result.touches[0][0], mpfr("0.8") * beta * depth, "1e-27")
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
    z = mpfr(repr(p)) * mpfr(repr(speed))
    # u' + ln(1 - u') for the exit equals its value for the approach: z - ln(1 + z) = -(y + ln(1 - y)), y = p v_o
    y = bisect(lambda y: z - gmpy2.log1p(z) + y + gmpy2.log1p(-y), min(z, 1) / 10**6, 1 - mpfr("1e-30"))
    _, v_l, _, v_o, *_ = result.state[-1]
    assert close((v_o - v_l) / mpfr(repr(speed)), y / z, "1e-25")


def test_an_elastic_symmetric_scene_is_periodic() -> None:
    """O12."""
    period = mpfr("0.88931643572931156661")
    scene = grasp(ELASTIC, 1e4, 0.0, 3.0)
    first, second = integrate(scene, [-0.3, 0.0, 0.0, 0.0, 0.3, 0.0], [0.0, 2.0, 2.0 + period], decimal=True).state[1:]
    assert all(close(a, b, "2e-18") for a, b in zip(first, second, strict=True))
    assert first[2] == first[3] == 0
    assert first[0] + first[4] == 0


def test_clamped_pairs_leave_and_come_back() -> None:
    scene = grasp(Arm(1.0, 10.0, 0.2, 50.0, 5.0), 1e4, 10.0, 1.0)
    times: list[Any] = [0.0, "0.315452318447362", "0.363159009501776"]
    result = integrate(scene, [-0.3, 0.0, 0.0, 0.0, 0.3, 0.0], times, decimal=True)
    assert result.touches[0] == result.touches[1]
    later = integrate(scene, [-0.3, 0.0, 0.0, 0.0, 0.3, 0.0], [0.0, 0.4], decimal=True)
    assert close(later.releases[0][0], "0.315452318447362", "1e-15")
    assert close(later.touches[0][1], "0.363159009501776", "1e-15")
    assert close(result.state[1][0], "0.01117960563511", "1e-14")
    assert close(result.state[2][0], "0.006353953744931", "1e-15")


def test_an_asymmetric_pair_comes_back_into_contact() -> None:
    result = integrate(grasp(STANDARD, 1e3, 15.0, 1.0), [-0.3, 0.0, 0.0, 0.0, 0.2, 0.0], [0.0, 0.6], decimal=True)
    assert close(result.touches[1][1], "0.572927357351903", "1e-15")


@pytest.mark.parametrize(
    ("object_mass", "speeds"),
    [
        (1.0, ("-0.070952353651436871", "0.076403039071206993", "0.994549314580229878")),
        (0.1, ("-0.0475095756030004457", "0.907669860965354066", "0.956742589506465039")),
    ],
)
def test_a_touching_chain(object_mass: float, speeds: tuple[str, ...]) -> None:
    """O11."""
    scene = grasp(FREE, 1e4, 0.0, object_mass)
    result = integrate(scene, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0], digits=20, decimal=True)
    assert all(close(a, b, "2e-18") for a, b in zip(result.state[-1][1::2], speeds, strict=True))


@pytest.mark.parametrize(("overshoot", "touches"), [("1e-6", 1), ("1e-15", 1), ("-1e-15", 0), ("-1e-6", 0)])
def test_grazing_is_neither_missed_nor_invented(overshoot: str, touches: int) -> None:
    """O13."""
    face = mpfr("0.22558827400810285623") - mpfr(overshoot)
    scene = Grasp(STANDARD, FREE, Contact(1e4, 0.0), NOTHING, 1.0)
    result = integrate(scene, [-0.3, 0.0, face, 0.0, 50.0, 0.0], [0.0, 1.0], digits=25, decimal=True)
    assert [len(result.touches[0]), len(result.releases[0])] == [touches, touches]
    if touches:
        duration = result.releases[0][0] - result.touches[0][0]
        estimate = 2 * gmpy2.sqrt(2 * mpfr(overshoot) / (15 * mpfr("0.22558827400810285623")))
        assert abs(duration / estimate - 1) < mpfr("1e-3")


@pytest.mark.parametrize("delay", ["1e-3", "1e-8", "1e-16", "1e-22"])
def test_touches_that_are_nearly_simultaneous(delay: str) -> None:
    """O15."""
    scene = grasp(FREE, 1e4, 0.3, 1.0)
    start = [-1.0, 1.0, 0.0, 0.0, 1 + mpfr(delay), -1.0]
    result = integrate(scene, start, [0.0, 1.5], digits=30, decimal=True)
    assert abs((result.touches[1][0] - result.touches[0][0]) / mpfr(delay) - 1) < mpfr("1e-4")
    assert abs(result.state[-1][3] / mpfr(delay) + mpfr("5.65648")) < mpfr("1e-5") + 50 * mpfr(delay)


@pytest.mark.parametrize(
    ("damping", "spring"), [(0.0, 0.0), (0.5, 0.0), (0.0, 4.0), (1.0, 4.0), (4.0, 4.0), (5.0, 4.0)]
)
def test_flight_of_an_arm_solves_its_own_equation(damping: float, spring: float) -> None:
    arm = Arm(1.0, spring, damping, 7.0, 7.0)
    scene = Grasp(arm, FREE, NOTHING, NOTHING, 1.0)
    x0, v0, f, h = mpfr("0.2"), mpfr(1), mpfr(3), mpfr("1e-9")
    times = [0, 2 - h, 2, 2 + h]
    result = integrate(scene, [x0, v0, 0, 0, 0, 0], times, digits=40, force=(f, 0), feedback=False)
    x, v = zip(*(row[:2] for row in result.state), strict=True)
    assert close((x[3] - x[1]) / (2 * h), v[2], "1e-16")
    assert close((v[3] - v[1]) / (2 * h), f - damping * v[2] - spring * x[2], "1e-16")
    assert (x[0], v[0]) == (x0, v0)


def test_start_in_contact_agrees_with_passing_through() -> None:
    scene = Grasp(FREE, FREE, Contact(1e4, 0.3), NOTHING, 2.0)
    whole = integrate(scene, START_APART, [0.0, 1.02, 1.5], digits=25)
    rest = integrate(scene, whole.state[1], [0, mpfr(1.5) - mpfr(1.02)], digits=25)
    assert all(close(a, b, "1e-24") for a, b in zip(whole.state[2], rest.state[1], strict=True))
    assert rest.touches == ([], [])


@pytest.mark.parametrize(
    ("scene", "state", "times"),
    [
        (grasp(STANDARD, 1e4, -0.1, 5.0), AT_REST, [0.0, 1.0]),
        (grasp(STANDARD, 1e4, 0.1, 0.0), AT_REST, [0.0, 1.0]),
        (grasp(STANDARD, 1e4, float("nan"), 5.0), AT_REST, [0.0, 1.0]),
        (CASES[1][0], AT_REST[:5], [0.0, 1.0]),
        (CASES[1][0], AT_REST, [0.0, 1.0, 1.0]),
        (CASES[1][0], AT_REST, [0.5, 1.0]),
    ],
)
def test_bad_input_is_refused(scene: Grasp, state: list[float], times: list[float]) -> None:
    with pytest.raises(ValueError, match=r"."):
        integrate(scene, state, times)

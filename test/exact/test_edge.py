"""Pairs at rest at u = 0, and at u' = -1/p: which way they go and how long that is certain, against mpmath."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from exact.bench import SIDES, bench
from mpmath import mp, mpf
from oracles import FREE, flight

from grasp_ros.exact.automaton.edge import (
    HIGHEST,
    NEVER,
    UNDECIDED,
    deciding_derivative,
    glides,
    has_glided,
    other_push,
    parting_time,
    separates,
    surface_side,
)
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.kinematics import difference, other
from grasp_ros.exact.records import Deciding, Plant, State
from grasp_ros.exact.tolerances import DERIVATIVE, SURFACE
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Body, Of, Pair, Slide, U, Work, X
from grasp_ros.physics.model import Contact
from lab.reference.grasp import Grasp, system_of

Row = tuple[float, float, float, float]  # m, k, c, f
# An arm and an object whose derivatives below an order agree; their place and velocity.
PARTING: dict[int, tuple[Row, Row, float, float]] = {
    2: ((1.0, 4.0, 0.5, 1.0), (2.0, 0.0, 0.25, 0.0), 0.5, 0.25),
    3: ((1.0, 4.0, 0.0, 2.0), (2.0, 0.0, 0.0, 0.0), 0.5, 0.25),
    4: ((1.0, 2.0, 0.0, 2.0), (2.0, 0.0, 0.0, 2.0), 0.5, 0.0),
}


def pair_at_rest(side: Body, arm: Row, body: Row, x: float, v: float) -> tuple[Plant, State]:
    """A pair at u = u' = 0 at x with the velocity v; its mirror image on the right."""
    sign = 1.0 if side == LEFT else -1.0
    b = bench(side, 0.0, 0.0)
    for row, values in ((side, arm), (OBJECT, body)):
        b.plant.given[row] = *values[:3], sign * values[3]
    b.plant.bodies[:] = b.plant.given
    b.state.y[:6] = sign * np.array([x, v, x, v, x, v])
    b.state.y[U.L + other(side)] = -1.0
    return b.plant, b.state


def derivatives(row: Any, x: Any, v: Any) -> list[Any]:
    """x, x', ... up to the order HIGHEST of a body in flight."""
    m, k, c, f = (mpf(value) for value in row)
    found = [mpf(x), mpf(v), (f - k * mpf(x) - c * mpf(v)) / m]
    for _ in range(HIGHEST - 2):
        found.append(-(c * found[-1] + k * found[-2]) / m)
    return found


def first_difference(plant: Plant, state: State, side: Body) -> tuple[int, Any]:
    """The first derivative of u that is not zero, in 60 digits."""
    sign = 1 if side == LEFT else -1
    with mp.workdps(60):
        arm = derivatives(plant.bodies[side], state.y[4 * side], state.y[4 * side + 1])
        body = derivatives(plant.bodies[OBJECT], state.y[2], state.y[3])
        for order, (a, b) in enumerate(zip(arm, body, strict=True)):
            if a != b:
                return order, sign * (a - b)
    return 0, mpf(0)


@SIDES
@pytest.mark.parametrize("order", PARTING)
@pytest.mark.parametrize("pressed", [False, True])
def test_the_first_derivative_that_differs(side: Body, order: int, pressed: bool) -> None:
    arm, body, x, v = PARTING[order]
    plant, state = pair_at_rest(side, arm, body, x, v)
    found = deciding_derivative(plant, state, side)
    assert (found.order, found.value) == first_difference(plant, state, side)
    if (found.value > 0.0) != pressed:  # the mirror image of the motion, not of the pair
        plant, state = pair_at_rest(side, (*arm[:3], -arm[3]), (*body[:3], -body[3]), -x, -v)
        assert deciding_derivative(plant, state, side) == (found.order, -found.value)


def test_small_integers_part_at_the_orders_two_to_four_or_never() -> None:
    """Two bodies whose derivatives 0 to 4 agree share the root of one exponential, and all others agree, too."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(600):
        arm, body = (tuple(map(float, (2.0 ** rng.integers(2), *rng.integers(3, size=2), rng.integers(-1, 2))))
                     for _ in range(2))
        x, v = map(float, rng.integers(-1, 2, size=2))
        plant, state = pair_at_rest(LEFT, arm, body, x, v)  # type: ignore[arg-type]
        order, value = first_difference(plant, state, LEFT)
        assert deciding_derivative(plant, state, LEFT) == ((order, value) if order else (NEVER, 0.0))
        found.append(order)
    assert set(found) == {0, 2, 3, 4}


@pytest.mark.parametrize("seed", range(40))
def test_no_decision_within_rounding_and_none_against_the_truth(seed: int) -> None:
    """Random bodies; a force on the arm that makes the accelerations equal within a few roundings, or nearly."""
    rng = np.random.default_rng(seed)
    m, m_o = 10.0 ** rng.uniform(-3, 3, 2)
    k, c, c_o = 10.0 ** rng.uniform(-3, 3, 3) * (rng.random(3) < 0.7)
    x, v = rng.normal(size=2) * (rng.random(2) < 0.7)
    f_o = float(rng.normal())
    balance = m * (f_o - c_o * v) / m_o + k * x + c * v
    for off in (0.0, EPS, 40.0 * EPS, 1e-12, -1e-12, 1e-6):
        arm, body = (m, k, c, balance * (1.0 + off)), (m_o, 0.0, c_o, f_o)
        plant, state = pair_at_rest(LEFT, arm, body, float(x), float(v))
        found = deciding_derivative(plant, state, LEFT)
        order, value = first_difference(plant, state, LEFT)
        if found.order == NEVER:
            assert abs(off) <= 1e-12
        elif found.order == order:
            assert found.value == pytest.approx(float(value), rel=1.0 / 16.0)
        else:  # what it skipped is rounding of the force that balances
            assert order == 2 < found.order
            assert abs(value) <= 80 * mpf(EPS) * (abs(balance) + k * abs(x) + c * abs(v) + m * abs(f_o / m_o)) / m


def test_a_difference_that_is_rounding_is_none() -> None:
    for off, decided in ((0.0, False), (16.0 * EPS, False), (300.0 * EPS, True)):
        plant, state = pair_at_rest(LEFT, (1.0, 0.0, 0.0, 1.0 + off), (1.0, 0.0, 0.0, 1.0), 0.0, 0.0)
        found = deciding_derivative(plant, state, LEFT)
        assert found == (Deciding(2.0, off) if decided else Deciding(NEVER, 0.0))
    assert 16.0 * EPS < 2.0 * DERIVATIVE < 300.0 * EPS


@SIDES
def test_bodies_that_are_alike_never_part(side: Body) -> None:
    for row in ((1.0, 0.0, 0.0, 0.0), (3.0, 7.0, 0.3, 1.0), (1.0, 1e6, 1e-3, -2.0)):
        for scale in (1.0, 2.0, 0.7):
            alike = tuple(scale * value for value in row)
            plant, state = pair_at_rest(side, row, alike, 0.37, -1.3)  # type: ignore[arg-type]
            assert deciding_derivative(plant, state, side).order == NEVER


@SIDES
@pytest.mark.parametrize(("u", "d", "p"), [(0.01, 0.2, 0.5), (0.01, -0.2, 0.5), (0.01, 0.3, 0.0), (0.01, -0.3, 0.0),
                                          (0.01, -2.0, 0.5)])
def test_the_force_of_the_other_pair_and_its_rate(side: Body, u: float, d: float, p: float) -> None:
    """(6) and its derivative along the motion, in which the force itself takes part."""
    b = bench(side, 0.0, 0.0, beside=(u, d), beside_mode=Pair.CONTACT, p=p, push=0.4, beside_push=-3.0)
    push, pace = other_push(b.plant, b.state, side)
    with mp.workdps(40):
        hertzian, rate = mpf(1e4), mpf(d)

        def force(depth: Any, speed: Any) -> Any:
            return hertzian * depth ** mpf(1.5) * (1 + mpf(p) * speed)

        now = force(mpf(u), rate)
        bend = 3 - 2 * now  # 3 N on the other arm towards the pair; both masses are 1
        h = mpf(10) ** -15
        ahead, behind = (force(mpf(u) + s * h * rate, rate + s * h * bend) for s in (1, -1))
        assert abs(push - now) <= 1e-14 * now
        assert abs(pace - (ahead - behind) / (2 * h)) <= 1e-11 * (abs(pace) + now)


@SIDES
def test_without_force_nothing_pushes_beside(side: Body) -> None:
    for mode, far in ((Pair.OPEN, (0.01, 0.1)), (Pair.CLAMPED, (0.01, 0.1)), (Pair.CONTACT, (0.0, 0.1))):
        b = bench(side, 0.0, 0.0, beside=far, beside_mode=mode)
        assert other_push(b.plant, b.state, side) == (0.0, 0.0)


PRESSING = {"p": 0.0, "beside_mode": Pair.CONTACT}
PUSHED = {"push": 1.0, "object_push": 1.0, "beside_push": 1.0, "stiffness": 2.0}


@SIDES
@pytest.mark.parametrize(("d", "options", "expected"), [
    (0.0, PRESSING, (2.0, 10.0)), (0.0, {**PRESSING, "push": -12.0}, (2.0, -2.0)),
    (0.2, {**PRESSING, "push": -10.0}, (3.0, 300.0)), (-0.2, {**PRESSING, "push": -10.0}, (3.0, -300.0)),
    (0.0, {**PRESSING, "push": -10.0}, (UNDECIDED, 0.0)),  # the second derivative of the force would decide
    # at u' = -1/p the force is zero; what pushes the other arm off that clamp surface lets it grow, either way
    *((-2.0, {"beside_mode": Pair.CONTACT, "beside_push": push}, (3.0, -5.0 * push)) for push in (-3.0, 3.0)),
    # closed without a force, or with one soon; the fourth derivative is the first of this pair's own
    (0.3, {**PUSHED, "beside_mode": Pair.CLAMPED}, (4.0, -2.0)),
    (0.3, {**PUSHED, "beside_mode": Pair.BEGINNING}, (3.5, math.inf)),
])
def test_the_force_of_the_other_pair_decides_with_its_value_and_its_rate(
    side: Body, d: float, options: dict[str, Any], expected: tuple[float, float]
) -> None:
    b = bench(side, 0.0, 0.0, beside=(0.01, d), **options)
    assert deciding_derivative(b.plant, b.state, side) == pytest.approx(expected)


@SIDES
def test_drag_of_the_object_lessens_what_the_force_of_the_other_pair_does(side: Body) -> None:
    """The force accelerates 2 kg by 5 m/s^2, which the arm balances; its rate gives 150 m/s^3, and 0.8 N s/m take 2."""
    b = bench(side, 0.0, 0.0, beside=(0.01, 0.2), beside_mode=Pair.CONTACT, p=0.0, push=-5.0)
    b.plant.bodies[OBJECT, Of.MASS], b.plant.bodies[OBJECT, Of.DAMPING] = 2.0, 0.8
    assert deciding_derivative(b.plant, b.state, side) == pytest.approx((3.0, 148.0))


@SIDES
def test_a_wall_hands_no_force_on(side: Body) -> None:
    b = bench(side, 0.0, 0.0, beside=(0.01, 0.3), beside_mode=Pair.CONTACT, slide=Slide.STUCK)
    b.plant.bodies[OBJECT, Of.MASS], b.plant.bodies[OBJECT, Of.FORCE] = math.inf, 0.0
    assert deciding_derivative(b.plant, b.state, side).order == NEVER


@SIDES
@pytest.mark.parametrize(("own", "beside", "expected"), [
    ({}, {"d": 0.3}, (3.5, math.inf)),  # its force will press this pair, with t^(3/2)
    ({}, {"push": 1.0}, (5.0, 6.0 * 1e4 * 0.5**1.5)),  # 1e4 (t^2 / 2)^(3/2), differentiated three times
    ({}, {"d": -0.3}, (3.5, math.inf)),
    ({}, {}, (NEVER, 0.0)),
    ({"push": 1.0}, {"d": 0.3}, (2.0, 1.0)),
    ({"push": -1.0}, {"d": 0.3}, (2.0, -1.0)),
    ({"push": 1.0}, {"push": 1.0}, (2.0, 1.0)),
    ({"speed": 0.5, "stiffness": 2.0}, {"d": 0.3}, (3.0, -1.0)),
    ({"speed": 0.5, "stiffness": 2.0}, {"push": 1.0}, (3.0, -1.0)),
    ({"common": 1.0, "stiffness": 2.0}, {"d": 0.3}, (3.5, math.inf)),  # of its own: (4.0, -2.0), which is later
    ({"common": 1.0, "stiffness": 2.0}, {"push": 1.0}, (4.0, -2.0)),
])
def test_beside_a_pair_that_begins_at_zero(
    side: Body, own: dict[str, float], beside: dict[str, float], expected: tuple[float, float]
) -> None:
    common = own.get("common", 0.0)
    b = bench(side, 0.0, 0.0, beside=(0.0, beside.get("d", 0.0)), beside_mode=Pair.CONTACT,
              push=own.get("push", 0.0) + common, object_push=common, beside_push=common - beside.get("push", 0.0),
              stiffness=own.get("stiffness", 0.0), object_speed=own.get("speed", 0.0))
    assert deciding_derivative(b.plant, b.state, side) == pytest.approx(expected, rel=1e-15)


@SIDES
@pytest.mark.parametrize(("common", "expected"), [(0.0, 8.0), (1.0, 6.0), (5.0, -2.0)])
def test_a_force_that_begins_at_the_surface_by_the_third_derivative_adds_to_the_fourth(
    side: Body, common: float, expected: float
) -> None:
    """The jerk of the other arm is 1.6 m/s^3, away from u' = -1/p: 10 N 0.5 1.6; its own is -2 `common`."""
    b = bench(side, 0.0, 0.0, beside=(0.01, -2.0), beside_mode=Pair.CONTACT, p=0.5, push=common, object_push=common,
              beside_push=common, stiffness=2.0)
    far, lane = (RIGHT, X.R) if side == LEFT else (LEFT, X.L)
    b.plant.bodies[far, Of.STIFFNESS] = 0.8
    b.plant.bodies[far, Of.FORCE] += 0.8 * b.state.y[lane]
    assert deciding_derivative(b.plant, b.state, side) == pytest.approx((4.0, expected))


# How long the sign is certain.


def sign_holds(plant: Plant, state: State, side: Body, span: float, sign: float) -> bool:
    """Whether u keeps a sign in (0, span] of a flight, at 30 places in 60 digits, near 0 closer together."""
    to_left = 1 if side == LEFT else -1
    with mp.workdps(60):
        for j in range(1, 31):
            t = mpf(span) * (mpf(j) / 30) ** 3
            x, _ = flight(plant.bodies[side].tolist(), state.y[4 * side], state.y[4 * side + 1], t)
            x_o, _ = flight(plant.bodies[OBJECT].tolist(), state.y[2], state.y[3], t)
            if not to_left * (x - x_o) * sign > 0:
                return False
    return True


def parting(plant: Plant, state: State, side: Body) -> float:
    """How long a pair at rest keeps the sign of u."""
    return float(parting_time(np.zeros(HIGHEST + 1), plant, state, side, np.zeros(len(Work), dtype=np.int64)))


@SIDES
@pytest.mark.parametrize("order", PARTING)
def test_a_certain_time_is_not_too_long_nor_nothing(side: Body, order: int) -> None:
    arm, body, x, v = PARTING[order]
    plant, state = pair_at_rest(side, arm, body, x, v)
    _, value = deciding_derivative(plant, state, side)
    span = parting(plant, state, side)
    assert sign_holds(plant, state, side, span, value)
    assert span > 1e-2


@SIDES
def test_a_later_derivative_may_turn_a_pair_back(side: Body) -> None:
    """1e-6 t^2 / 2 - t^3 / 6 turns back at 3e-6 s."""
    plant, state = pair_at_rest(side, (1.0, 1.0, 0.0, 1e-6), (1.0, 0.0, 0.0, 0.0), 0.0, 1.0)
    order, value = deciding_derivative(plant, state, side)
    span = parting(plant, state, side)
    assert (order, value) == (2.0, 1e-6)
    assert sign_holds(plant, state, side, span, value)
    assert span > 1e-6


@SIDES
@pytest.mark.parametrize("v", [-0.7, -1.4, -2.3])
def test_a_derivative_that_is_rounding_hides_no_later_one(side: Body, v: float) -> None:
    """-1e-6 t^2 / 2 alone is certain for some 1e-5 s; the third derivative is rounding, the fourth has its sign."""
    k, c = 0.7, 0.3
    a = -k * v / c  # c a + k v = 0
    plant, state = pair_at_rest(side, (1.0, k, c, a + c * v), (1.0, 0.0, 0.0, a + 1e-6), 0.0, v)
    order, value = deciding_derivative(plant, state, side)
    span = parting(plant, state, side)
    assert (order, value) == (2.0, pytest.approx(-1e-6))
    assert 0.0 < difference(plant, state.y, side, 3)[0] < 1e-15  # rounding, and of the other sign
    assert sign_holds(plant, state, side, span, value)
    assert span > 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(30))
def test_certain_times_of_random_pairs(seed: int) -> None:
    """Between 1e-3 and 1e3 in every parameter, and accelerations that nearly cancel: u turns back early."""
    rng = np.random.default_rng(seed)
    m, k, c, m_o, k_o, c_o = 10.0 ** rng.uniform(-3, 3, 6) * np.array([1, *(rng.random(2) < 0.7), 1, 1, 1])
    x, v, f_o = rng.normal(size=3)
    if rng.random() < 0.5:
        k_o = 0.0
    balance = float(m * (f_o - k_o * x - c_o * v) / m_o + k * x + c * v)
    off = float(rng.choice([0.0, 1e-9, -1e-9, 1e-3, -1e-3, 1.0]))
    arm, body = (m, k, c, balance + off * abs(balance)), (m_o, k_o, c_o, float(f_o))
    plant, state = pair_at_rest(LEFT, arm, body, float(x), float(v))
    order, value = deciding_derivative(plant, state, LEFT)
    if order == NEVER:
        return
    span = parting(plant, state, LEFT)
    assert span > 0.0
    assert order > 2 or sign_holds(plant, state, LEFT, min(span, 1e3), value)


@SIDES
def test_where_a_pair_parts_the_search_begins_before_it_comes_back(side: Body) -> None:
    """-t^2 / 2 + 10 t^3 comes back at 1/20 s; without anything that brings it back it never does."""
    plant, state = pair_at_rest(side, (1.0, 0.0, 0.0, -1.0), (1.0, 0.0, 0.0, 0.0), 0.0, 0.0)
    assert parting(plant, state, side) == math.inf
    plant, state = pair_at_rest(side, (1.0, 100.0, 0.0, -1.0), (1.0, 0.0, 0.0, 0.0), 0.0, 0.0)
    first = parting(plant, state, side)
    assert 1e-3 < first < 2.0 * math.pi / 10.0
    assert first * math.sqrt(plant.bodies[side, Of.STIFFNESS]) < 0.25  # u has its own digits there
    plant, state = pair_at_rest(side, (1.0, 0.0, 0.0, -1.0), (1.0, 100.0, 0.0, 0.0), 0.0, 0.0)
    assert parting(plant, state, side) < 0.025  # the object by itself may swing as fast
    for row in ((1.0, 0.0, 0.0, 0.0), (1.0, 4.0, 0.0, 0.0)):
        plant, state = pair_at_rest(side, row, row, 0.0, 0.5)
        assert parting(plant, state, side) == math.inf


def test_a_feedback_that_drives_makes_no_time_longer() -> None:
    for damping in (-1.0, -30.0):
        arm, body = (1.0, 100.0, damping, -1.0), (1.0, 0.0, 0.0, 0.0)
        plant, state = pair_at_rest(LEFT, arm, body, 0.0, 0.0)
        assert plant.bodies[LEFT, Of.DAMPING] == damping
        first = parting(plant, state, LEFT)
        assert 0.0 < first < 1.0
        assert sign_holds(plant, state, LEFT, first, -1.0)


@SIDES
@pytest.mark.parametrize(("u", "d", "options", "expected"), [
    (0.01, -1.0, {}, True), (0.0, -1.0, {}, True), (0.01, 1.0, {"push": 9.0}, False), (0.01, 0.0, {}, False),
    (0.01, -1.0, {"push": 4.9}, True), (0.01, -1.0, {"push": 5.1}, False),  # 20 u |u''| beside u'^2
    (0.01, -1.0, {"stiffness": 9e2, "push": 9.0}, True),  # 10 (u / u')^2 k: of u''' alone
    (0.01, -1.0, {"stiffness": 1.1e3, "push": 11.0}, False),
    (0.01, -1.9, {"push": -4.0}, True), (0.01, -1.9, {"push": -5.0}, False),  # 4 u |u''| / u' up to u' = -2 = -1/p
    (0.01, -1.9, {"push": -4.0, "p": 0.52}, False), (0.01, -1.9, {"p": 0.52}, True),
    (0.01, -2.0, {"push": -4.0}, True), (0.01, -2.1, {"push": -4.0}, True),  # there, or beyond
    (0.01, -1.9, {"push": -4.0, "p": 0.0}, True),
])
def test_a_pair_parts_where_nothing_but_its_force_can_turn_it_back(
    side: Body, u: float, d: float, options: dict[str, float], expected: bool
) -> None:
    b = bench(side, u, d, Pair.CONTACT, **options)  # type: ignore[arg-type]
    assert separates(b.plant, b.state.y, side) is expected


# At u' = -1/p.


@SIDES
@pytest.mark.parametrize(
    ("options", "expected"),
    [({}, True), ({"beside_mode": Pair.LEAVING}, True), ({"beside_mode": Pair.CLAMPED, "beside": (0.01, -9.0)}, True),
     ({"beside_mode": Pair.CLAMPED, "beside": (0.01, -9.0), "beside_push": 1.0}, False),
     ({"beside_mode": Pair.CONTACT, "beside": (0.01, -2.0)}, True),
     ({"beside_mode": Pair.BEGINNING, "beside": (0.0, 0.1)}, False),
     ({"beside_mode": Pair.CONTACT, "beside": (0.01, -2.0), "beside_push": 1.0}, False),
     ({"beside_mode": Pair.CONTACT, "beside": (0.01, -1.0)}, False), ({"push": 1.0}, False),
     ({"push": 1.0, "object_push": 1.0}, True),
     ({"stiffness": 1e-3}, False)],
)
def test_a_pair_glides_where_nothing_moves_it(side: Body, options: dict[str, Any], expected: bool) -> None:
    b = bench(side, 0.01, -2.0, Pair.CONTACT, **options)
    assert glides(b.plant, b.state, side) is expected


@SIDES
@pytest.mark.parametrize(("options", "expected"), [
    ({"push": 1.0}, 1.0), ({"push": -1.0}, -1.0), ({}, 0.0),
    ({"push": 0.003, "stiffness": 0.3}, 0.6),  # k x balances it but for rounding; k u' does not
    ({"push": 0.003 * (1.0 + 1e-15), "stiffness": 0.3}, 0.6),
    ({"push": 0.003 * (1.0 - 1e-15), "stiffness": 0.3}, 0.6),
    ({"beside": (0.01, -2.0), "beside_mode": Pair.CONTACT}, 0.0),  # it glides, too
    ({"beside": (0.01, 0.0), "beside_mode": Pair.CONTACT}, 10.0),  # it pushes the object
])
def test_the_first_derivative_beyond_its_rounding_decides(side: Body, options: dict[str, Any], expected: float) -> None:
    b = bench(side, 0.01, -2.0, Pair.CONTACT, **options)
    assert surface_side(b.plant, b.state, side) == pytest.approx(expected)


@SIDES
def test_beyond_rounding_the_speed_decides(side: Body) -> None:
    assert surface_side(*bench(side, 0.01, -1.9, Pair.CONTACT, push=-5.0)[:2], side) == pytest.approx(0.05)
    assert surface_side(*bench(side, 0.01, -2.1, Pair.CONTACT, push=5.0)[:2], side) == pytest.approx(-0.05)


@SIDES
def test_beyond_the_third_derivative_only_bodies_without_an_impact_beside_are_known(side: Body) -> None:
    """Of the pair and its bodies the second and the third vanish, of the arm alone the fourth does not."""
    k, a, u = 0.3, 0.7, 0.01
    alone: dict[str, Any] = {"stiffness": k, "push": a + k * u, "object_push": a, "object_speed": 2.0}
    b = bench(side, u, -2.0, Pair.CONTACT, **alone)
    assert surface_side(b.plant, b.state, side) == pytest.approx(-k * a)
    beside = {"beside": (u, 0.0), "beside_mode": Pair.CONTACT, "beside_push": a - 20.0}
    pressed = {**alone, **beside, "push": a + k * u - 10.0}
    b = bench(side, u, -2.0, Pair.CONTACT, **pressed)
    push, pace = other_push(b.plant, b.state, side)
    assert (abs(push), pace) == (pytest.approx(10.0), pytest.approx(0.0, abs=1e-9))
    assert surface_side(b.plant, b.state, side) == 0.0
    glides_beside = {**alone, "beside": (u, -2.0), "beside_mode": Pair.CONTACT, "beside_push": 5.0}
    b = bench(side, u, -2.0, Pair.CONTACT, **glides_beside)
    push, pace = other_push(b.plant, b.state, side)
    assert push == 0.0
    b = bench(side, u, -2.0, Pair.CONTACT, **{**glides_beside, "object_speed": 2.0 + pace / k})
    assert surface_side(b.plant, b.state, side) == 0.0


@SIDES
@pytest.mark.parametrize(("d", "options", "expected"), [
    (-2.0, {}, True), (-1.0, {}, False), (-2.0, {"push": 1.0}, False)])
def test_a_pair_has_glided_at_the_surface_alone(side: Body, d: float, options: dict[str, Any], expected: bool) -> None:
    b = bench(side, 0.01, d, Pair.CONTACT, **options)
    assert bool(has_glided(b.plant, b.state, side, SURFACE)) is expected


@pytest.mark.parametrize(("p", "masses", "state"), [
    ((1.5, 0.75), (1.0, 0.1, 1.0), (1.0, -2.0 / 3.0, 0.0, 0.0, -1.0, 4.0 / 3.0)),  # both glide
    ((0.1, 0.31), (1.0, 0.5, 1.68), (0.1, -19.679, 0.0, 0.321, -0.05, 0.321 + 1.0 / 0.31)),  # beside a clamped one
])
def test_pairs_that_nothing_moves_glide_without_events(p: Any, masses: Any, state: Any) -> None:
    m_l, m_o, m_r = masses
    grasp = Grasp(FREE._replace(mass=m_l), FREE._replace(mass=m_r), Contact(1e5, p[0]), Contact(1e5, p[1]), m_o)
    for gravity in (0.0, 9.81):
        integrator = Integrator(system_of(grasp, np.array(state)), continuous=False)
        integrator.set_input(gravity * np.array([m_l, m_r, m_o]))
        integrator.advance(0.004)
        assert integrator.status is Status.DONE
        assert integrator.work[Work.CONTACT_STEPS] < 10
        assert integrator.events == []

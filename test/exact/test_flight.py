"""Closed-form flight and its events against mpmath: matrix exponentials and a scan that finds every turning point."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf
from oracles import first_touch_from_rest, flight, flight_array

from grasp_ros.exact.flight.closed_form import fly, launch
from grasp_ros.exact.flight.search import first_root, motion_at, pair_in_flight, relative_bound
from grasp_ros.exact.flight.segment import is_far
from grasp_ros.exact.kinematics import bound_by, rates_of
from grasp_ros.exact.records import Flights, Motion, PairFlight, Plant, Regime
from grasp_ros.exact.tolerances import FAR
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of, Transition, U, Work

Body = tuple[float, float, float, float]  # m, k, c, f
CRITICAL = 2.0 * math.sqrt(15.0)
BODIES: dict[str, tuple[Body, Regime]] = {
    "rest and nothing": ((2.0, 0.0, 0.0, 0.0), Regime.DRIFT),
    "constant force": ((2.0, 0.0, 0.0, 3.0), Regime.DRIFT),
    "under-damped": ((1.0, 15.0, 0.7, 0.0), Regime.UNDER),
    "undamped with force": ((1.0, 15.0, 0.0, 2.0), Regime.UNDER),
    "barely damped": ((1.0, 15.0, 1e-12, 2.0), Regime.UNDER),
    "critical": ((1.0, 4.0, 4.0, 1.0), Regime.NEAR),
    "above critical by 1e-12": ((1.0, 15.0, CRITICAL * (1 + 1e-12), 1.0), Regime.NEAR),
    "below critical by 1e-12": ((1.0, 15.0, CRITICAL * (1 - 1e-12), 1.0), Regime.UNDER),
    "above critical by 1e-6": ((1.0, 15.0, CRITICAL * (1 + 1e-6), 1.0), Regime.NEAR),
    "below critical by 1e-6": ((1.0, 15.0, CRITICAL * (1 - 1e-6), 1.0), Regime.UNDER),
    "above critical by 10 %": ((1.0, 15.0, CRITICAL * 1.1, 1.0), Regime.NEAR),
    "over-damped": ((1.0, 15.0, 40.0, 1.0), Regime.NEAR),
    "hardly a spring": ((1.0, 1e-12, 5.0, 1.0), Regime.OVER),
    "weak spring under force": ((1.0, 1e-30, 0.0, 2.0), Regime.UNDER),
    "weak spring, damped, under force": ((1.0, 1e-30, 0.5, 2.0), Regime.OVER),
    "drag": ((3.0, 0.0, 0.5, 0.0), Regime.OVER),
    "drag under force": ((3.0, 0.0, 0.5, 2.0), Regime.OVER),
    "hardly any drag": ((3.0, 0.0, 1e-14, 2.0), Regime.OVER),
    "stiff and light": ((1e-6, 1e6, 0.1, 0.0), Regime.UNDER),
    "heavy and soft": ((1e6, 1e-3, 1.0, 0.0), Regime.UNDER),
}
TIMES = [1e-12, 1e-3, 0.05, 0.3, 1.0, 7.0, 40.0]
GRAZING_ARM: Body = (1.0, 15.0, 0.7, 0.0)
STILL: Body = (5.0, 0.0, 0.0, 0.0)


def solve(body: Body, x: float, v: float, t: float) -> tuple[float, float]:
    """The kernel's position and velocity."""
    found = fly(launch(np.array(body), x, v), t)
    return found[0], found[1]


def uncompiled(kernel: Any) -> Any:
    """A kernel as Python."""
    return getattr(kernel, "py_func", kernel)  # there is one only where kernels are compiled


def paired(arm: Body, body: Body, at: tuple[float, float, float, float], sign: float, inverse_p: float = 0.0
           ) -> tuple[PairFlight, Motion]:
    """A pair in flight, and its motion at the begin, from x, v of the arm and of the object."""
    x, v, x_o, v_o = at
    side = LEFT if sign > 0.0 else RIGHT
    rows, y = np.zeros((3, 4)), np.zeros(8)
    rows[:, Of.MASS] = 1.0
    rows[side], rows[OBJECT] = arm, body
    pairs = np.full((2, 2), 1.0 / inverse_p if inverse_p > 0.0 else 0.0)
    u = sign * (x - x_o)
    y[U.L + side] = u
    launched = [launch(rows[row], *map(float, at[2 * (row == OBJECT) :][:2])) for row in (LEFT, RIGHT, OBJECT)]
    pair = uncompiled(pair_in_flight)(Plant(rows, rows, pairs, 0.0), y, Flights(*launched), side)
    return pair, Motion(x, v, x_o, v_o, u, sign * (v - v_o), abs(x) + abs(x_o))


def root(
    arm: Body, body: Body, at: tuple[float, float, float, float], span: float, *,
    kind: Transition = Transition.TOUCH, sign: float = 1.0, inverse_p: float = 0.0,
) -> tuple[float, int]:
    """First event of a flight from x, v of the arm and of the object, and the iterations it took."""
    work = np.zeros(len(Work), dtype=np.int64)
    pair, begin = paired(arm, body, at, sign, inverse_p)
    found, known = first_root(kind, pair, 0.0, begin, span, math.inf, work)
    assert known == math.inf
    return found, int(work[Work.ROOT_ITERATIONS])


@pytest.mark.parametrize("t", [0.0, 0.4])
def test_the_oracle_solves_its_equation(t: float) -> None:
    body, x0, v0 = (2.0, 3.0, 0.7, 1.1), mpf("0.2"), mpf("-0.4")
    with mp.workdps(60):
        h = mpf("1e-15")
        (xa, va), (x, v), (xb, vb) = (flight(body, x0, v0, mpf(t) + s * h) for s in (-1, 0, 1))
        assert abs((xb - xa) / (2 * h) - v) < mpf("1e-25")
        assert abs(2 * (vb - va) / (2 * h) + mpf(3.0) * x + mpf(0.7) * v - mpf(1.1)) < mpf("1e-25")
    if t == 0.0:
        assert (x, v) == (x0, v0)
    else:
        assert abs(x - x0) > 0.01
    x_array, v_array = flight_array(body, 0.2, -0.4, np.array([t]))
    assert (x_array[0], v_array[0]) == pytest.approx((float(x), float(v)), abs=1e-15)


def test_the_touch_oracle_solves_its_equation() -> None:
    t1 = first_touch_from_rest(1, 15, mpf("0.7"))
    assert abs(t1 - mpf("0.4307053966231132073")) < mpf("1e-19")
    x, v = flight((1, 15, mpf("0.7"), 0), mpf("-0.3"), 0, t1)
    assert abs(x) < mpf("1e-38")
    assert abs(v - mpf("0.99930564858067212555")) < mpf("1e-20")


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize(("x", "v"), [(-0.3, 0.0), (0.2, 1.5)])
def test_flight_against_the_matrix_exponential(name: str, x: float, v: float) -> None:
    body, regime = BODIES[name]
    m, k, _c, f = body
    assert launch(np.array(body), x, v)[0] == regime
    assert solve(body, x, v, 0.0) == (x, v)
    omega = math.sqrt(k / m)
    for t in TIMES:
        expected = flight(body, x, v, t)
        got = solve(body, x, v, t)
        # an argument omega t rounded to double costs omega t roundings of the amplitude
        size = abs(x) + abs(v) * min(t, 1 / omega if k else t) + abs(f / m) * min(t * t, 1 / (k / m) if k else t * t)
        rounding = 2.3e-16 * (8 + 2 * omega * t)
        assert abs(got[0] - expected[0]) <= rounding * size, t
        assert abs(got[1] - expected[1]) <= rounding * (abs(v) + omega * size + abs(f / m) * t), t


def test_short_and_long_form_meet() -> None:
    far = ((4.0, 30.0, 2.0, 300.0), "a rest position far away")
    for name, (body, _) in {**BODIES, "far": far}.items():
        m, k, c, _ = body
        pace = c / m + math.sqrt(k / m)
        if pace == 0.0:
            continue
        for t in (0.25 / pace, 1.0 / pace):  # where rest is near, and far
            if t > 1e12:
                continue
            (xa, va), (xb, vb) = solve(body, 0.2, 1.5, t * (1 - 1e-15)), solve(body, 0.2, 1.5, t * (1 + 1e-15))
            assert xb == pytest.approx(xa, rel=2e-14), name
            assert vb == pytest.approx(va, rel=2e-14, abs=1e-14 * (1 + math.sqrt(k / m))), name


@pytest.mark.parametrize("part", [0.0, 0.9, 1.02])
@pytest.mark.parametrize("force", [-1e8, -2.2284e7, -1e6])
def test_a_flight_towards_a_far_rest_keeps_the_digits_of_its_place(part: float, force: float) -> None:
    """An arm that a feed-forward pushes, at the end of a control period near a quarter of its time constants."""
    m, k = 41.05, 3.5166e8
    body = (m, k, part * 2.0 * math.sqrt(k * m), force)
    pace = body[2] / m + math.sqrt(k / m)
    for t in np.linspace(0.2, 3.0, 57) / pace:
        expected, _ = flight(body, -7.575e-5, 0.0, float(t))
        place, _ = solve(body, -7.575e-5, 0.0, float(t))
        assert place == pytest.approx(float(expected), rel=8e-15, abs=0.0), t  # 3e-14 by the distance to rest


@pytest.mark.parametrize("name", BODIES)
def test_a_displacement_has_its_own_digits_or_none(name: str) -> None:
    """x + 1e-20 m is x, the gap of a pair that has just parted is not; long flights around a near rest have none."""
    body = BODIES[name][0]
    m, k, c, _ = body
    rate = c / m + math.sqrt(k / m)
    for x, v in ((-0.3, 0.0), (0.2, 1.5)):
        for t in (1e-12 / max(rate, 1.0), 0.2 / max(rate, 1.0)):
            with mp.workdps(60):
                away = flight(body, x, v, t)[0] - mpf(x)
            found = fly(launch(np.array(body), x, v), t)[2]
            push = abs(body[3]) + abs(k * x) + abs(c * v)  # N, whose rounding the acceleration has
            assert abs(found - away) <= 1e-15 * (abs(away) + t * t * push / m), t
        if rate > 0.0:
            near = k > 0.0 and abs(body[3] / k) <= FAR * abs(x)
            long, started = (0.3 if near else 1.1) / rate, launch(np.array(body), x, v)
            found = fly(started, long)[2]
            assert math.isnan(found) == (started.regime != Regime.OVER)
            if started.regime == Regime.OVER:
                with mp.workdps(60):
                    away = flight(body, x, v, long)[0] - mpf(x)
                assert abs(found - away) <= 1e-15 * (abs(v) * long + long * long * abs(started.push))


@pytest.mark.parametrize("ratio", [1.01, 3.0, 1e3, 1e8])
@pytest.mark.parametrize("force", [0.0, 1.0])
@pytest.mark.parametrize("damping", [1.0, -1.0])
def test_an_over_damped_velocity_keeps_its_digits(ratio: float, force: float, damping: float) -> None:
    """What is left of a fast start is the slow creep, ratio^2 times slower; and a feedback may drive the body."""
    body = (1.0, 1.0, 2.0 * ratio * damping, force)
    for t in (0.5 / ratio, 3.0 / ratio, 0.1) if damping < 0.0 else (0.5 / ratio, 3.0 / ratio, 30.0, 3.0 * ratio):
        for x, v in ((0.0, 1.0), (0.7, 0.0), (0.7, -0.4)):
            with mp.workdps(60):
                expected = flight(body, x, v, t)
            if abs(expected[1]) < mpf("1e-280") or abs(expected[1]) > mpf("1e280"):
                continue
            got = solve(body, x, v, t)
            turn = min(abs(force - x) + abs(v), 1.0)  # near a turning point the two decays do cancel
            assert got[1] == pytest.approx(float(expected[1]), rel=1e-13 + 5e-16 * t * ratio, abs=1e-15 * turn / ratio)


@pytest.mark.parametrize("amplitude", [0.3, 0.5, 1e-9, 1e9])
def test_first_touch_from_rest_does_not_depend_on_the_amplitude(amplitude: float) -> None:
    """O4."""
    t, _ = root(GRAZING_ARM, STILL, (-amplitude, 0.0, 0.0, 0.0), 100.0)
    assert t == pytest.approx(float(first_touch_from_rest(1.0, 15.0, 0.7)), rel=1e-15)
    mirrored, _ = root(GRAZING_ARM, STILL, (amplitude, 0.0, 0.0, 0.0), 100.0, sign=-1.0)
    assert mirrored == t


@pytest.mark.parametrize("damping", [CRITICAL * (1 + 1e-12), CRITICAL * 1.1, 40.0])
def test_from_critical_damping_on_an_arm_at_rest_never_touches(damping: float) -> None:
    t, iterations = root((1.0, 15.0, damping, 0.0), STILL, (-0.3, 0.0, 0.0, 0.0), 1e6)
    assert t == math.inf
    assert iterations < 20_000


@cache
def scan(arm: Body, x: float, v: float, x_o: float, v_o: float, span: float) -> float:
    """First rise of u = x - x_o through 0 with the object in uniform motion, by all turning points of u.

    Between turning points u is monotone, so signs there decide; they are bracketed on a grid of 300 points per
    period and refined in mpmath, as is the root.
    """

    def u(t: Any) -> Any:
        return flight(arm, x, v, t)[0] - (mpf(x_o) + mpf(v_o) * t)

    def rate(t: Any) -> Any:
        return flight(arm, x, v, t)[1] - mpf(v_o)

    def zero(function: Any, low: float, high: Any) -> Any:
        return mp.findroot(function, (low, high), solver="anderson", tol=mpf(10) ** -22)

    with mp.workdps(25):
        period = 2 * math.pi / math.sqrt(arm[1] / arm[0])
        t = np.linspace(0.0, span, int(300 * span / period) + 2)
        xs, vs = flight_array(arm, x, v, t)
        us, ds = xs - (x_o + v_o * t), vs - v_o
        turns = np.flatnonzero((ds[1:] > 0.0) != (ds[:-1] > 0.0))
        low = 0.0
        for i in turns:
            if ds[i] <= 0.0:
                low = t[i]
                continue
            if max(us[i], us[i + 1]) < -1e-4:  # u'' < 1e3 here: the maximum between is below zero
                continue
            peak = zero(rate, t[i], t[i + 1])
            if u(peak) > 0:
                return float(zero(u, low, peak))
        return float(zero(u, low, span)) if us[-1] > 0.0 else math.inf


RANDOM = np.random.default_rng(36)
SCENES = [
    ((1.0, RANDOM.uniform(1, 400), float(RANDOM.choice([0.0, 0.05, 0.5])), RANDOM.uniform(-5, 5)),
     (RANDOM.uniform(-1, 0), RANDOM.uniform(-1, 1), RANDOM.uniform(0.2, 1.4), RANDOM.uniform(-0.15, 0.05)))
    for _ in range(40)
]


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_the_first_touch_of_random_scenes(scene: Any) -> None:
    arm, at = scene
    span = 12.0
    expected = scan(arm, *at, span)
    t, iterations = root(arm, STILL, at, span)
    assert iterations < 3000
    if math.isinf(expected):
        assert t == math.inf
    else:
        _, speed = flight(arm, at[0], at[1], expected)
        omega = math.sqrt(arm[1])
        assert t == pytest.approx(expected, rel=0, abs=1e-14 * (1 + omega) / max(abs(float(speed) - at[3]), 1e-3))


@pytest.mark.slow
def test_the_random_scenes_have_all_kinds_of_answers() -> None:
    found = [scan(arm, *at, 12.0) for arm, at in SCENES]
    assert 4 <= sum(map(math.isinf, found)) <= 36
    assert sum(2.0 < t < math.inf for t in found) >= 2


def peak_of(arm: Body, x: float) -> tuple[Any, Any]:
    """Time and height of the first maximum of an arm released at rest."""
    m, k, c, _ = (mpf(value) for value in arm)
    s = c / (2 * m)
    t = mp.pi / mp.sqrt(k / m - s * s)
    return t, flight(arm, x, 0, t)[0]


@pytest.mark.parametrize("eps", [s * 10.0**-k for k in (6, 8, 10, 12) for s in (1, -1)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_grazing_is_neither_missed_nor_invented(eps: float, sign: float) -> None:
    t_peak, peak = peak_of(GRAZING_ARM, -0.3)
    assert abs(t_peak - mpf("0.81448838085023299313")) < mpf("1e-15")  # the damping is a binary 0.7 here
    face = float(peak - mpf(eps))
    true_eps = peak - mpf(face)
    at = (-0.3 * sign, 0.0, face * sign, 0.0)
    t, iterations = root(GRAZING_ARM, STILL, at, 0.9, sign=sign)
    assert iterations < 2000
    if eps < 0.0:
        assert t == math.inf
        return
    a = 15 * peak
    expected = t_peak - mp.sqrt(2 * true_eps / a)
    approach = mp.sqrt(2 * true_eps * a)
    assert abs(t - expected) < true_eps + 4 * mpf(2.3e-16) / approach  # O(eps) is the next term of the estimate
    inside = t + float(mp.sqrt(2 * true_eps / a))
    assert sign * (solve(GRAZING_ARM, -0.3 * sign, 0.0, inside)[0] - face * sign) > 0.0
    # the way out again is the release of the same arc
    y = solve(GRAZING_ARM, -0.3 * sign, 0.0, inside)
    out, _ = root(GRAZING_ARM, STILL, (*y, face * sign, 0.0), 0.5, kind=Transition.RELEASE, sign=sign)
    assert inside + out == pytest.approx(2 * float(t_peak) - t, rel=0, abs=float(true_eps) + 1e-15 / float(approach))


def test_two_crossings_in_a_short_interval() -> None:
    arm: Body = (1.0, 1e6, 0.0, 0.0)  # 1 mm of amplitude, 159 Hz, grazes by 1e-9: a millisecond holds both crossings
    at = (-1e-3, 0.0, 1e-3 - 1e-9, 0.0)
    t, _ = root(arm, STILL, at, 10.0)
    assert t == pytest.approx(float((mp.pi - mp.acos(1 - mpf(1e-9) / mpf(1e-3))) / 1000), rel=1e-10)


@pytest.mark.parametrize(("arm", "at"), [
    (GRAZING_ARM, (-0.3, 0.0, 0.4, 0.0)),
    ((1.0, 15.0, 0.0, 0.0), (-0.3, 0.0, 0.3 + 1e-9, 0.0)),
    ((1.0, 15.0, 0.0, 0.0), (-0.3, 0.0, 0.3 - 1e-3, 0.05)),
    (GRAZING_ARM, (-0.3, 0.0, 0.2, 1e-3)),
    ((1.0, 0.0, 0.0, 0.0), (-0.3, 0.1, 0.0, 0.1)),
    ((1.0, 0.0, 0.0, -1e-3), (-0.3, 0.001, 0.0, 0.0)),
    ((1.0, 0.0, 2.0, 0.0), (-0.3, 0.5, 0.0, 0.0)),
    ((1.0, 15.0, 40.0, 0.0), (-0.3, 0.0, 1e-6, 0.0)),
])
def test_never_touching_costs_nothing_per_second(arm: Body, at: tuple[float, float, float, float]) -> None:
    counts = []
    for span in (1e3, 1e6, 1e9):
        t, iterations = root(arm, STILL, at, span)
        assert t == math.inf or t <= 20.0
        counts.append(iterations)
    assert counts[2] <= counts[1] + 60
    assert counts[2] < 2000


def test_a_touch_after_a_very_long_flight() -> None:
    t, iterations = root(GRAZING_ARM, STILL, (-0.3, 0.0, 1.0, -1e-6), 1e9)
    assert t == pytest.approx(1e6, rel=1e-12)
    assert iterations < 500


def test_an_exact_zero_at_the_start_does_not_count() -> None:
    assert root((1.0, 0.0, 0.0, 2.0), STILL, (0.0, -1.0, 0.0, 0.0), 10.0)[0] == pytest.approx(1.0, rel=1e-15)
    assert root((1.0, 0.0, 0.0, 0.0), STILL, (0.0, -1.0, 0.0, 0.0), 10.0)[0] == math.inf


def test_the_end_of_the_span_belongs_to_it() -> None:
    drift: Body = (1.0, 0.0, 0.0, 0.0)
    assert root(drift, STILL, (-1.0, 1.0, 0.0, 0.0), 1.0)[0] == 1.0
    assert root(drift, STILL, (-1.0, 1.0, 0.0, 0.0), math.nextafter(1.0, 0.0))[0] == math.inf


def test_reentry_of_a_separating_pair() -> None:
    arm: Body = (1.0, 10.0, 0.2, 3.0)
    inverse_p = 0.5
    t, _ = root(arm, STILL, (-0.1, -1.5, -0.2, 0.0), 10.0, kind=Transition.REENTRY, inverse_p=inverse_p)
    with mp.workdps(25):
        expected = mp.findroot(lambda s: flight(arm, -0.1, -1.5, s)[1] + mpf("0.5"), 0.3)
    assert 0.0 < t == pytest.approx(float(expected), rel=1e-14)


@pytest.mark.parametrize("body", [(1.0, 15.0, 0.7, 0.0), (2.0, 3.0, 30.0, 0.0), (1.0, 0.0, 2.0, 0.0), STILL])
def test_the_bound_holds_and_is_not_idle(body: Body) -> None:
    for q, q_rate in ((1.0, 0.0), (0.2, 3.0), (-0.5, 2.0), (0.0, -1.0)):
        for span in (0.1, 3.0):
            largest = max(abs(flight(body, q, q_rate, span * j / 60)[0]) for j in range(61))
            limit = bound_by(rates_of(np.array(body)), q, q_rate, span)
            assert largest <= limit * (1 + 1e-14)
            assert limit <= 30.0 * largest


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["left", "right"])
def test_the_gap_follows_both_bodies(sign: float) -> None:
    """Of a short flight by the ways of both, of a long one by their places."""
    arm, body = (1.0, 15.0, 0.7, 0.0), (5.0, 2.0, 0.1, 1.0)
    pair, _ = paired(arm, body, (0.3, 2.0, 0.4, -1.5), sign)
    for t in (1e-3, 3.0):
        x, x_o = (solve(own, *start, t)[0] for own, start in ((arm, (0.3, 2.0)), (body, (0.4, -1.5))))
        assert uncompiled(motion_at)(pair, t).u == pytest.approx(sign * (x - x_o), rel=1e-13)


@pytest.mark.parametrize(("body", "at"), [
    ((2.0, 3.0, 0.5, 0.0), (0.3, 2.0, 0.301, 1.998)),  # alike: far below the bound of each
    ((2.0, 3.0, 0.6, 0.0), (0.3, 2.0, -0.3, -2.0)),
])
def test_the_difference_of_two_motions_is_bounded(body: Body, at: tuple[float, float, float, float]) -> None:
    arm: Body = (2.0, 3.0, 0.5, 0.0)
    pair, _ = paired(arm, body, at, 1.0)
    times, both = [3.0 * j / 60 for j in range(61)], ((arm, at[:2]), (body, at[2:]))
    moved = [[flight(own, *start, t)[0] for t in times] for own, start in both]
    largest = max(abs(x - x_o) for x, x_o in zip(*moved, strict=True))
    assert largest <= uncompiled(relative_bound)(pair, *at, 3.0) <= 30.0 * largest


@pytest.mark.parametrize("size", [2.0**-540, 2.0**-700, 2.0**-900, 2.0**600])
def test_the_bound_of_a_swing_knows_no_size(size: float) -> None:
    """Its squares leave the range of numbers."""
    rates = rates_of(np.array([2.0, 3.0, 0.5, 0.0]))
    expected = size * bound_by(rates, 1.0, 3.0, 10.0)
    assert bound_by(rates, size, 3.0 * size, 10.0) == pytest.approx(expected, rel=1e-14, abs=0.0)


def test_where_a_bound_says_far_the_search_needs_one_step_and_finds_nothing() -> None:
    """Random flights, half of them near the edge of the bound; sides, signs and sizes of all kinds."""
    draw = np.random.default_rng(12)
    far = 0
    for _ in range(2000):
        rows = np.zeros((3, 4))
        rows[:, Of.MASS] = 10.0 ** draw.uniform(-3.0, 3.0, 3)
        rows[:, 1:3] = 10.0 ** draw.uniform(-3.0, 4.0, (3, 2)) * (draw.random((3, 2)) < 0.7)
        rows[:, 3] = draw.normal(0.0, 10.0, 3) * (draw.random(3) < 0.5)
        sign = draw.choice((-1.0, 1.0))
        side = LEFT if sign > 0.0 else RIGHT
        x_o, (v, v_o), span = draw.normal(), draw.normal(0.0, 3.0, 2), 10.0 ** draw.uniform(-6.0, 0.0)
        y = np.zeros(8)
        gap = span * abs(v - v_o) * draw.uniform(1.0, 1.2) if draw.random() < 0.5 else 10.0 ** draw.uniform(-9.0, 1.0)
        lane = 0 if side == LEFT else 4
        y[lane], y[lane + 1], y[2], y[3] = x_o - sign * gap, v, x_o, v_o
        y[U.L + side] = sign * (y[lane] - x_o)
        if not is_far(Plant(rows, rows, np.zeros((2, 2)), 0.0), y, side, span):
            continue
        far += 1
        assert root(tuple(rows[side]), tuple(rows[OBJECT]), (y[lane], v, x_o, v_o), span, sign=sign) == (math.inf, 1)
    assert 200 < far < 1800

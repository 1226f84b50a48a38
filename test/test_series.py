"""Taylor contacts against Picard iteration in mpmath, which shares no recurrence with them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mpmath import mp, mpf

from grasp_ros.physics.layout import DISSIPATION, HERTZ, LEFT, RIGHT, U_L, U_R, V_L, V_O, V_R, X_O, Work
from grasp_ros.physics.polynomial import evaluate, evaluate_rate, first_rise, invert_time
from grasp_ros.physics.series import (
    E_L,
    E_R,
    TIME,
    W_L,
    W_R,
    G,
    Tables,
    expand_both,
    expand_one,
    new_tables,
    series_order,
    state_at,
    step_size,
)
from grasp_ros.physics.switching import impact_scales

BODIES = np.array([[1.0, 15.0, 0.7, 0.4], [2.0, 12.0, 1.1, -0.3], [5.0, 0.0, 0.0, 0.0]])
PAIRS = np.array([[1e2, 0.3], [3e2, 0.7]])
# x_o, v_l, v_o, v_r, u_l, u_r
START = {
    "left": (0.02, 0.9, -0.1, 0.2, 0.01, -0.3),
    "right": (0.02, 0.9, 0.1, -0.2, -0.4, 0.02),
    "both": (0.02, 0.9, 0.1, -0.2, 0.01, 0.02),
    "left at its touch": (0.02, 0.9, -0.1, 0.2, 0.0, -0.3),
    "right at its touch": (0.02, 0.9, 0.1, -0.2, -0.4, 0.0),
    "both, left at its touch": (0.02, 0.9, 0.1, -0.2, 0.0, 0.02),
    "both, right at its touch": (0.02, 0.9, 0.1, -0.2, 0.01, 0.0),
}
ROWS = (X_O, V_L, V_O, V_R, U_L, U_R)


def expand(name: str, n: int, pairs: Any = PAIRS, bodies: Any = BODIES) -> Tables:
    """The kernel's table."""
    tables = new_tables(n)
    tables.f[:] = np.nan  # the workspace of another step
    tables.c[list(ROWS), 0] = START[name]
    left, right = sides(name)
    if left:
        tables.c[W_L, 0] = math.sqrt(START[name][4])
    if right:
        tables.c[W_R, 0] = math.sqrt(START[name][5])
    if left and right:
        expand_both(tables.c, tables.f, bodies, pairs, 1.0, n)
    else:
        expand_one(tables.c, tables.f, bodies, pairs, LEFT if left else RIGHT, 1.0, n)
    return tables


def sides(name: str) -> tuple[bool, bool]:
    """Which pairs are in contact."""
    return name.startswith(("left", "both")), name.startswith(("right", "both"))


def picard(name: str, n: int) -> dict[int, list[Any]]:
    """Taylor polynomials in s to order n: z <- z0 + int f(z) ds, right to one more order each time.

    The force is H w^3 (1 + p u') as it stands, with u' from the velocities; u is not made of w.
    """

    def times(*factors: list[Any]) -> list[Any]:
        total = factors[0]
        for factor in factors[1:]:
            total = [sum((total[i] * factor[k - i] for i in range(k + 1)), mpf(0)) for k in range(n + 1)]
        return total

    def linear(offset: Any, *terms: tuple[Any, list[Any]]) -> list[Any]:
        total = [sum((factor * row[k] for factor, row in terms), mpf(0)) for k in range(n + 1)]
        return [total[0] + offset, *total[1:]]

    left, right = sides(name)
    bodies, pairs = (np.vectorize(mpf, otypes=[object])(table) for table in (BODIES, PAIRS))
    start = dict(zip(ROWS, (mpf(value) for value in START[name]), strict=True))
    start[TIME] = mpf(0)
    start[W_L] = mpf(math.sqrt(START[name][4])) if left else mpf(0)
    start[W_R] = mpf(math.sqrt(START[name][5])) if right else mpf(0)
    z = {row: [value] + [mpf(0)] * n for row, value in start.items()}
    one, zero = [mpf(1)] + [mpf(0)] * n, [mpf(0)] * (n + 1)
    for _ in range(n + 1):
        d_l, d_r = linear(0, (1, z[V_L]), (-1, z[V_O])), linear(0, (1, z[V_O]), (-1, z[V_R]))
        clock = times(z[W_L] if left else one, z[W_R] if right else one)
        force = [zero, zero]
        for side, w, d, touching in ((LEFT, z[W_L], d_l, left), (RIGHT, z[W_R], d_r, right)):
            if touching:
                damped = linear(1, (pairs[side, DISSIPATION], d))
                force[side] = linear(0, (pairs[side, HERTZ], times(w, w, w, damped)))
        m_l, k_l, c_l, f_l = bodies[0]
        m_r, k_r, c_r, f_r = bodies[1]
        x_l, x_r = linear(0, (1, z[X_O]), (1, z[U_L])), linear(0, (1, z[X_O]), (-1, z[U_R]))
        rates = {
            TIME: one,
            X_O: z[V_O],
            U_L: d_l,
            U_R: d_r,
            V_L: linear(f_l / m_l, (-k_l / m_l, x_l), (-c_l / m_l, z[V_L]), (-1 / m_l, force[0])),
            V_O: linear(0, (1 / bodies[2, 0], force[0]), (-1 / bodies[2, 0], force[1])),
            V_R: linear(f_r / m_r, (-k_r / m_r, x_r), (-c_r / m_r, z[V_R]), (1 / m_r, force[1])),
        }
        rates = {row: [2 * value for value in times(clock, rate)] for row, rate in rates.items()}
        if left:
            rates[W_L] = times(d_l, z[W_R]) if right else d_l
        if right:
            rates[W_R] = times(d_r, z[W_L]) if left else d_r
        for row, rate in rates.items():
            z[row] = [start[row], *(rate[k] / (k + 1) for k in range(n))]
    return z


@pytest.mark.parametrize("name", START)
def test_coefficients_against_picard_iteration(name: str) -> None:
    n = 12
    table, expected = expand(name, n).c, picard(name, n)
    for row, series in expected.items():
        for k in range(n + 1):
            scale = max(abs(other[k]) for other in expected.values())
            assert abs(table[row, k] - series[k]) <= mpf("1e-13") * scale + mpf("1e-15") * abs(series[k]), (row, k)
    assert any(abs(series[n]) > 0 for series in expected.values())


@pytest.mark.parametrize("name", START)
def test_the_table_solves_its_equation(name: str) -> None:
    n, s = 30, 0.05
    left, right = sides(name)
    c = expand(name, n).c
    value = {row: evaluate(c[row], n, s) for row in (TIME, *ROWS, W_L, W_R)}
    rate = {row: evaluate_rate(c[row], n, s) for row in (TIME, *ROWS, W_L, W_R)}
    clock = 2.0 * (value[W_L] if left else 1.0) * (value[W_R] if right else 1.0)
    assert value[TIME] > 0.0
    assert rate[TIME] == pytest.approx(clock, rel=1e-12)
    assert evaluate(c[G if left and right else (W_L if left else W_R)], n - 1, s) == pytest.approx(clock / 2, rel=1e-12)
    force = [0.0, 0.0]
    for side, w, u, d, e, touching in (
        (LEFT, W_L, U_L, value[V_L] - value[V_O], E_L, left),
        (RIGHT, W_R, U_R, value[V_O] - value[V_R], E_R, right),
    ):
        if touching:
            assert value[w] ** 2 == pytest.approx(value[u], rel=1e-12)
            assert evaluate(c[e], n - 1, s) == pytest.approx(1.0 + PAIRS[side, DISSIPATION] * d, rel=1e-12)
            force[side] = PAIRS[side, HERTZ] * value[w] ** 3 * (1.0 + PAIRS[side, DISSIPATION] * d)
    x_l, x_r = value[X_O] + value[U_L], value[X_O] - value[U_R]
    a_l = (0.4 - 15.0 * x_l - 0.7 * value[V_L] - force[0]) / 1.0
    a_r = (-0.3 - 12.0 * x_r - 1.1 * value[V_R] + force[1]) / 2.0
    a_o = (force[0] - force[1]) / 5.0
    got = [rate[row] / clock for row in (V_L, V_R, V_O, X_O)]
    assert got == pytest.approx([a_l, a_r, a_o, value[V_O]], rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("other", ["left", "right"])
def test_one_and_both_agree_if_the_other_pair_has_no_force(other: str) -> None:
    n, tau = 30, 0.01
    pairs = PAIRS.copy()
    pairs[LEFT if other == "right" else RIGHT, HERTZ] = 0.0
    both = expand("both", n, pairs).c
    single = new_tables(n)
    single.c[list(ROWS), 0] = START["both"]
    single.c[W_L if other == "left" else W_R, 0] = both[W_L if other == "left" else W_R, 0]
    expand_one(single.c, single.f, BODIES, PAIRS, LEFT if other == "left" else RIGHT, 1.0, n)
    one = single.c
    end = np.zeros((2, 8))
    s = invert_time(both[TIME], n, tau, 1.0)
    state_at(both, n, s, True, True, end[0])
    s = invert_time(one[TIME], n, tau, 0.15)
    state_at(one, n, s, other == "left", other == "right", end[1])
    assert end[0] == pytest.approx(end[1], rel=1e-12, abs=1e-14)
    assert abs(end[0, 1] - START["both"][1]) > 1e-3


@pytest.mark.parametrize("name", START)
@pytest.mark.parametrize("n", [7, 8, 12])
def test_order_by_slope(name: str, n: int) -> None:
    best = expand(name, 45).c
    table = expand(name, n).c
    largest = 0.24 if "both" not in name else 1.0
    errors = [
        max(abs(evaluate(table[row], n, s) - evaluate(best[row], 45, s)) for row in (V_L, V_O, V_R))
        for s in (largest, largest / 4.0)
    ]
    slope = math.log(errors[0] / max(errors[1], 1e-17), 4.0)
    # coefficients have gaps at a touch: the next one present may be up to five orders later
    assert n + 0.2 < slope < n + 6.5


@pytest.mark.parametrize("name", START)
def test_step_size_keeps_its_promise(name: str) -> None:
    left, right = sides(name)
    y = START[name]
    d_l, d_r = y[1] - y[2], y[2] - y[3]
    none = (1.0, 0.0)
    scale_l = impact_scales(PAIRS[0, 0], 5.0 / 6.0, y[4], d_l, 0.0) if left else none
    scale_r = impact_scales(PAIRS[1, 0], 10.0 / 7.0, y[5], d_r, 0.0) if right else none
    speed = max(scale_l[1], scale_r[1])
    best = expand(name, 60).c
    for tolerance in (1e-4, 1e-8, 1e-12):
        n = series_order(tolerance)
        c = expand(name, n).c
        h = step_size(c, left, right, scale_l[0], scale_r[0], speed, n, tolerance)
        squared = step_size(c, left, right, scale_l[0], scale_r[0], speed, n, tolerance**2)
        assert squared / h == pytest.approx(tolerance ** (1.0 / (n + 1)), rel=1e-12)
        assert evaluate(best[TIME], 60, h) > 0.0
        error = max(abs(evaluate(c[row], n, h) - evaluate(best[row], 60, h)) for row in (V_L, V_O, V_R)) / speed
        assert error <= 30.0 * tolerance
        beyond = max(abs(evaluate(c[row], n, 3 * h) - evaluate(best[row], 60, 3 * h)) for row in (V_L, V_O, V_R))
        assert beyond > error * speed  # a step that is far too short would not notice


def test_order_grows_with_the_accuracy() -> None:
    orders = [series_order(10.0**-k) for k in range(3, 17)]
    assert orders == sorted(orders)
    assert orders[0] >= 8
    assert orders[-1] <= 40


def test_scales_are_those_of_a_hertz_impact() -> None:
    depth, speed = (5 * 0.75 * 2.0**2 / (4 * 100.0)) ** 0.4, 2.0  # O1
    for state in ((0.0, speed), (depth, 0.0)):
        w, v = impact_scales(100.0, 0.75, *state, 0.0)
        assert math.sqrt(depth) <= w <= 2.0 * math.sqrt(depth)
        assert speed <= v <= 2.0 * speed
        assert math.frexp(w)[0] == math.frexp(v)[0] == 0.5  # powers of two: scaling a scene costs no rounding
    pressed = (0.75 * 8.0 / 100.0) ** (2.0 / 3.0)  # m a = H u^(3/2)
    assert 0.5 < impact_scales(100.0, 0.75, 0.0, 0.0, 8.0)[0] ** 2 / pressed < 8.0


def rise(coefficients: Any, h: float) -> float:
    """The kernel's answer for coefficients in ascending order."""
    work = np.zeros(len(Work), dtype=np.int64)
    f = np.array(coefficients, dtype=float)
    result = first_rise(f, 1.0, 0.0, len(f) - 1, h, work)
    assert work[Work.ROOT_ITERATIONS] < 5000
    return result


@pytest.mark.parametrize(
    ("coefficients", "h", "expected"),
    [
        ([-1.0, 2.0], 1.0, 0.5),
        ([-1.0, 2.0], 0.4, math.inf),
        ([-1.0, 1.0], 1.0, 1.0),  # (0, h]
        ([-1.0, 0.0, 0.0, 0.0, 0.0, 32.0], 1.0, 0.5),
        ([0.0, -1.0, 1.0], 2.0, 1.0),  # zero at the start, falling
        ([0.0, -1.0, 1.0], 0.9, math.inf),
        ([0.0, 0.0, -1.0, 1.0], 2.0, 1.0),
        ([0.0, 0.0, -1.0], 2.0, math.inf),
        ([0.0, -1.0], 2.0, math.inf),
        ([0.0, 0.0, 0.0], 2.0, math.inf),
        ([-0.3, 1.1, -1.0], 1.0, 0.5),  # -(s - 0.5)(s - 0.6): rises at 0.5, falls at 0.6
        ([-0.24, 1.0, -1.0], 1.0, 0.4),
        ([-0.26, 1.0, -1.0], 1.0, math.inf),
        ([-0.25 - 1e-9, 1.0, -1.0], 1.0, math.inf),  # a double root, missed by 1e-9
        ([-1.0, 0.0, 0.0], 1e300, math.inf),
    ],
)
def test_first_rise_of_known_polynomials(coefficients: Any, h: float, expected: float) -> None:
    assert rise(coefficients, h) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("eps", [1e-4, 1e-8, 1e-12])
def test_first_rise_beside_a_double_root(eps: float) -> None:
    found = rise([-0.25 + eps, 1.0, -1.0], 1.0)
    assert found == pytest.approx(0.5 - math.sqrt(eps), rel=0, abs=1e-15 / math.sqrt(eps) + 1e-15)


def test_a_zero_at_the_start_that_rises_is_not_lost() -> None:
    assert 0.0 < rise([0.0, 1.0, 1.0], 1.0) < 1e-12


@pytest.mark.parametrize("seed", range(30))
def test_first_rise_of_random_products(seed: int) -> None:
    rng = np.random.default_rng(seed)
    roots = np.sort(rng.uniform(0.05, 1.4, rng.integers(1, 7)))
    with mp.workdps(40):
        product = [mpf(1)]
        for a in roots:
            product = [
                (product[k - 1] if k else 0) - a * (product[k] if k < len(product) else 0)
                for k in range(len(product) + 1)
            ]
        sign = -1 if product[0] > 0 else 1
        coefficients = [float(sign * value) for value in product]
    # negative at 0, so it rises at the first root and falls at the second
    expected = roots[0] if roots[0] <= 1.0 else math.inf
    slope = abs(np.polynomial.polynomial.polyval(roots[0], np.polynomial.polynomial.polyder(coefficients)))
    noise = 1e-15 * sum(map(abs, coefficients))
    assert rise(coefficients, 1.0) == pytest.approx(expected, rel=0, abs=max(5 * noise / slope, 1e-14))


def test_time_is_inverted_to_rounding() -> None:
    c, n = expand("both", 30).c, 30
    for s in (0.0, 1e-9, 0.03, 0.2):
        tau = evaluate(c[TIME], n, s)
        assert evaluate(c[TIME], n, invert_time(c[TIME], n, tau, 0.3)) == pytest.approx(tau, rel=4e-16, abs=1e-17)


def test_depth_is_never_negative() -> None:
    y = np.zeros(8)
    c, n = expand("left at its touch", 20).c, 20
    state_at(c, n, 0.0, True, False, y)
    assert y[U_L] == 0.0
    assert y[0] == y[X_O]
    state_at(c, n, -0.01, True, False, y)
    assert y[U_L] >= 0.0


# In s itself the coefficients of a weak impact leave the range of numbers.
@pytest.mark.parametrize("speed", [1.0, 1e-6, 1e-9, 1e-12, 1e-15, 1e-20])
@pytest.mark.parametrize("name", ["left at its touch", "both"])
def test_the_step_of_an_impact_scales_with_its_speed(name: str, speed: float) -> None:
    n = 30
    bodies = np.array([[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
    pairs = np.array([[1e4, 0.0], [1e4, 0.0]])
    tables = new_tables(n)
    depth = (5 * 0.5 * speed**2 / (4 * 1e4)) ** 0.4
    u = 0.1 * depth if name == "both" else 0.0
    c = tables.c
    c[list(ROWS), 0] = (0.0, speed, 0.0, -speed, u, u if name == "both" else -1.0)
    c[W_L, 0] = math.sqrt(u)
    w, v = impact_scales(1e4, 0.5, u, speed, 0.0)
    if name == "both":
        c[W_R, 0] = math.sqrt(u)
        expand_both(c, tables.f, bodies, pairs, 1.0 / v, n)
        h = step_size(c, True, True, w, w, v, n, 1e-14)
    else:
        expand_one(c, tables.f, bodies, pairs, LEFT, w / v, n)
        h = step_size(c, True, False, w, 1.0, v, n, 1e-14)
    duration = 2.9432751843247047 * depth / speed
    assert 0.01 * duration < evaluate(c[TIME], n, h) < duration

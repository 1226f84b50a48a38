"""Taylor contacts against Picard iteration in mpmath, which shares no recurrence with them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from mpmath import mpf

from grasp_ros.exact.contact.step_unit import (
    higher_order,
    impact_scales,
    lower_order,
    new_settings,
    new_step,
    series_order,
)
from grasp_ros.exact.contact.taylor_step import ABOVE, BELOW, accepted_length, begin_series, fitted_step, length, pulls
from grasp_ros.exact.contact.taylor_step import expand as expand_step
from grasp_ros.exact.driver.workspace import new_workspace
from grasp_ros.exact.numerics.polynomial import curvatures, invert_time, lane_range, values
from grasp_ros.exact.records import Order, Plant, Settings, State, Step, Tables
from grasp_ros.physics.layout import LANES, LEFT, RIGHT, Lane, Law, Pair, Slide, U, V, Work, X, Z
from grasp_ros.physics.model import Array

BODIES = np.array([[1.0, 15.0, 0.7, 0.4], [2.0, 12.0, 1.1, -0.3], [5.0, 3.0, 0.9, 0.2]])
PAIRS = np.array([[1e2, 0.3], [3e2, 0.7]])
LANES_OF_MOTION = [Lane.TIME, V.L, X.O, V.O, V.R, Z.L, Z.R]
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
ROWS = (X.O, V.L, V.O, V.R, U.L, U.R)  # of a start


def step_of(name: str, n: int, unit: float) -> Step:
    """The step of a table of n orders."""
    return Step(Order(n, 0.0, n), unit, *sides(name))


def new_start(name: str, n: int) -> Tables:
    """A workspace with order 0 of a start."""
    tables = new_workspace(n).tables
    tables.f[:] = np.nan  # the workspace of another step
    tables.c[list(ROWS)] = START[name]
    for z, touching in zip((Z.L, Z.R), sides(name), strict=True):
        if touching:
            tables.c[z] = math.sqrt(tables.c[z])
    return tables


def expand(name: str, n: int, pairs: Any = PAIRS, bodies: Any = BODIES, unit: float = 1.0) -> Array:
    """The kernel's table (n + 1, LANES)."""
    tables = new_start(name, n)
    expand_step(tables, Plant(bodies, bodies, pairs, 0.0), step_of(name, n, unit))
    return tables.c[: LANES * (n + 1)].reshape(n + 1, LANES)


def at(table: Array, s: float) -> Array:
    """The lanes' values at s."""
    out = np.zeros(2 * LANES)
    values(table.ravel(), len(table) - 1, s, out)
    return out[:LANES]


def sides(name: str) -> tuple[bool, bool]:
    """Which pairs are in contact."""
    return name.startswith(("left", "both")), name.startswith(("right", "both"))


def picard(name: str, n: int) -> dict[int, list[Any]]:
    """Taylor polynomials in s to order n: z <- z0 + int f(z) ds, right to one more order each time.

    The force is H w^3 (1 + p u') as it stands, with u' from the velocities.
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
    start[Lane.TIME] = mpf(0)
    for row, touching in ((Z.L, left), (Z.R, right)):
        if touching:
            start[row] = mpf(math.sqrt(START[name][4 if row == Z.L else 5]))
    z = {row: [value] + [mpf(0)] * n for row, value in start.items()}
    one, zero = [mpf(1)] + [mpf(0)] * n, [mpf(0)] * (n + 1)
    for _ in range(n + 1):
        d_l, d_r = linear(0, (1, z[V.L]), (-1, z[V.O])), linear(0, (1, z[V.O]), (-1, z[V.R]))
        clock = times(z[Z.L] if left else one, z[Z.R] if right else one)
        u_l = times(z[Z.L], z[Z.L]) if left else z[Z.L]
        u_r = times(z[Z.R], z[Z.R]) if right else z[Z.R]
        force = [zero, zero]
        for side, w, d, touching in ((LEFT, z[Z.L], d_l, left), (RIGHT, z[Z.R], d_r, right)):
            if touching:
                damped = linear(1, (pairs[side, Law.DISSIPATION], d))
                force[side] = linear(0, (pairs[side, Law.HERTZIAN], times(w, w, w, damped)))
        m_l, k_l, c_l, f_l = bodies[0]
        m_r, k_r, c_r, f_r = bodies[1]
        m_o, k_o, c_o, f_o = bodies[2]
        x_l, x_r = linear(0, (1, z[X.O]), (1, u_l)), linear(0, (1, z[X.O]), (-1, u_r))
        rates = {
            Lane.TIME: one,
            X.O: z[V.O],
            Z.L: d_l,
            Z.R: d_r,
            V.L: linear(f_l / m_l, (-k_l / m_l, x_l), (-c_l / m_l, z[V.L]), (-1 / m_l, force[0])),
            V.O: linear(
                f_o / m_o, (-k_o / m_o, z[X.O]), (-c_o / m_o, z[V.O]), (1 / m_o, force[0]), (-1 / m_o, force[1])
            ),
            V.R: linear(f_r / m_r, (-k_r / m_r, x_r), (-c_r / m_r, z[V.R]), (1 / m_r, force[1])),
        }
        rates = {row: [2 * value for value in times(clock, rate)] for row, rate in rates.items()}
        if left:
            rates[Z.L] = times(d_l, z[Z.R]) if right else d_l
        if right:
            rates[Z.R] = times(d_r, z[Z.L]) if left else d_r
        for row, rate in rates.items():
            z[row] = [start[row], *(rate[k] / (k + 1) for k in range(n))]
    return z


@pytest.mark.parametrize("name", START)
def test_coefficients_against_picard_iteration(name: str) -> None:
    n = 12
    table, expected = expand(name, n), picard(name, n)
    for row, series in expected.items():
        for k in range(n + 1):
            scale = max(abs(other[k]) for other in expected.values())
            assert abs(table[k, row] - series[k]) <= mpf("1e-13") * scale + mpf("1e-15") * abs(series[k]), (row, k)
    assert any(abs(series[n]) > 0 for series in expected.values())


def test_a_mirrored_grasp_has_mirrored_coefficients() -> None:
    """To the last bit, also those of w_l w_r, which is one product."""
    n, swap = 20, [RIGHT, LEFT, 2]
    table, tables = expand("both", n), new_workspace(n).tables
    bodies = BODIES[swap] * [1.0, 1.0, 1.0, -1.0]
    x_o, v_l, v_o, v_r, u_l, u_r = START["both"]
    tables.f[:] = np.nan
    tables.c[list(ROWS)] = -x_o, -v_r, -v_o, -v_l, math.sqrt(u_r), math.sqrt(u_l)
    expand_step(tables, Plant(bodies, bodies, PAIRS[swap[:2]], 0.0), step_of("both", n, 1.0))
    image = tables.c[: LANES * (n + 1)].reshape(n + 1, LANES)
    for lane, other, sign in ((Lane.TIME, Lane.TIME, 1.0), (X.O, X.O, -1.0), (V.O, V.O, -1.0), (V.L, V.R, -1.0),
                              (V.R, V.L, -1.0), (Z.L, Z.R, 1.0), (Z.R, Z.L, 1.0)):
        assert (image[:, lane] == sign * table[:, other]).all()


def motion(name: str) -> tuple[Plant, State]:
    """The plant of a start, and where it stands."""
    x_o, v_l, v_o, v_r, u_l, u_r = START[name]
    y = np.array([x_o + u_l, v_l, x_o, v_o, x_o - u_r, v_r, u_l, u_r])
    mode = [Pair.CONTACT if touching else Pair.OPEN for touching in sides(name)]
    state = State(y, np.array([*mode, Slide.FREE]), np.zeros(6), np.zeros(3), np.zeros(3))
    return Plant(BODIES, BODIES.copy(), PAIRS, 0.0, np.zeros(3)), state


def settings_of(tolerance: float) -> Settings:
    """What follows from a tolerance."""
    return new_settings(tolerance, higher_order(series_order(tolerance)), BODIES)


def expanded(name: str, settings: Settings, unit: float | None = None) -> tuple[Tables, Step, float]:
    """A workspace with the series of a start, what they stand for, and how far they go."""
    plant, state = motion(name)
    step = new_step(plant, state, settings, np.inf)
    if unit is not None:
        step = step._replace(unit=unit)
    tables = new_workspace(settings.one.number).tables
    tables.f[:] = np.nan
    begin_series(tables, state)
    expand_step(tables, plant, step)
    h = length(tables, pulls(plant, state.y), step, settings, 1.0)
    if not BELOW < h < ABOVE:
        h = length(tables, pulls(plant, state.y), step, settings, h)
    return tables, step, h


@pytest.mark.parametrize("name", START)
def test_a_step_neglects_little_of_what_moves_in_each_lane(name: str) -> None:
    """Time included; the lane CHECK has a test of its own, see `accepted_length`."""
    for tolerance in (1e-4, 1e-8, 1e-12):
        settings = settings_of(tolerance)
        tables, step, h = expanded(name, settings)
        table = tables.c[: LANES * (step.order.number + 1)].reshape(-1, LANES)
        best = expand(name, 60, unit=step.unit)
        moved = np.abs(best[1:6] * h ** np.arange(1, 6)[:, None]).max(axis=0)
        moved[X.O] = max(moved[X.O], moved[Lane.TIME] * moved[V.O])
        error, beyond = (np.abs(at(table, s) - at(best, s))[LANES_OF_MOTION] / moved[LANES_OF_MOTION]
                         for s in (h, 2.0 * h))
        assert error.max() <= 30.0 * tolerance
        assert beyond.max() > 10.0 * error.max()  # a step that is far too short would not notice
        assert beyond.max() > tolerance


@pytest.mark.parametrize("name", START)
@pytest.mark.parametrize("orders", [-60, -12, 12, 24])
def test_a_unit_that_does_not_fit_is_replaced(name: str, orders: int) -> None:
    settings = settings_of(1e-16)
    plant, state = motion(name)
    _, fit, good = expanded(name, settings)
    tables, step, h = expanded(name, settings, math.ldexp(fit.unit, orders))
    step, h = fitted_step(tables, plant, state, settings, step, 1.0)
    h = accepted_length(tables, step, h, settings, np.zeros(len(Work), dtype=np.int64))
    assert step._replace(unit=0.0) == fit._replace(unit=0.0)
    assert 2.0**-10 < h < 2.0**10
    assert step.unit * h == pytest.approx(fit.unit * good, rel=0.5)


@pytest.mark.parametrize("name", START)
def test_a_step_that_is_too_long_is_shortened_without_another_expansion(name: str) -> None:
    settings, work = settings_of(1e-16), np.zeros(len(Work), dtype=np.int64)
    tables, step, h = expanded(name, settings)
    order = settings.both if all(sides(name)) else settings.one
    assert step.order == order
    coefficients = tables.c.copy()
    assert accepted_length(tables, step, h, settings, work) == h
    assert work[Work.REJECTED_STEPS] == 0
    shorter = accepted_length(tables, step, 4.0 * h, settings, work)
    assert 0.5 * h < shorter < 4.0 * h
    assert work[Work.REJECTED_STEPS] > 0
    assert (tables.c == coefficients).all()
    table = coefficients[: LANES * (step.order.number + 1)].reshape(-1, LANES)
    assert tables.at[:LANES].tolist() == at(table, shorter).tolist()


def test_terms_of_a_high_order_do_not_cancel() -> None:
    """Where u' of one pair relaxes at once, they neglect nothing where they are rounding."""
    plant, state = motion("both")
    plant = plant._replace(pairs=np.array([[1e2, 0.3], [3e2, 1e9]]))
    settings, terms = settings_of(1e-16), []
    for order in (settings.both, settings.both._replace(early=settings.both.number)):
        step = new_step(plant, state, settings._replace(both=order), np.inf)
        tables = new_workspace(settings.one.number).tables
        begin_series(tables, state)
        expand_step(tables, plant, step)
        accepted_length(tables, step, length(tables, pulls(plant, state.y), step, settings, 1.0), settings,
                        np.zeros(len(Work), dtype=np.int64))
        terms.append(tables.size[V.R] / abs(tables.at[V.R] - tables.c[V.R]))
    assert terms[0] < 300.0
    assert terms[1] > 10.0 * terms[0]


def test_order_grows_with_the_accuracy() -> None:
    orders = [series_order(10.0**-k) for k in range(3, 17)]
    assert orders == sorted(orders)
    assert orders[0] >= 8
    assert orders[-1] <= 40
    for order in orders:
        higher = higher_order(order)
        assert higher % 2 == 0
        assert 3 * order <= 2 * higher < 3 * order + 4
        assert lower_order(higher) == order


def test_scales_are_those_of_a_hertz_impact() -> None:
    depth, speed = (5 * 0.75 * 2.0**2 / (4 * 100.0)) ** 0.4, 2.0  # O1
    for state in ((0.0, speed), (depth, 0.0)):
        w, v = impact_scales(100.0, 0.75, *state)
        assert math.sqrt(depth) <= w <= 2.0 * math.sqrt(depth)
        assert speed <= v <= 2.0 * speed
        assert math.frexp(w)[0] == math.frexp(v)[0] == 0.5  # powers of two: scaling a scene costs no rounding


@pytest.mark.parametrize("orders", [-100, 100])
def test_scales_of_shallow_impacts_do_not_underflow(orders: int) -> None:
    """O7: a length that is shorter by a power of 4 leaves all digits."""
    for u, d in ((0.3, 2.0), (0.3, 0.0), (0.0, 2.0)):
        w, v = impact_scales(100.0, 0.75, u, d)
        root, length = math.ldexp(1.0, -orders), math.ldexp(1.0, -2 * orders)
        assert impact_scales(100.0 / root, 0.75, u * length, d * length) == (w * root, v * length)


@pytest.mark.parametrize("name", START)
def test_time_is_inverted_to_rounding(name: str) -> None:
    unit, n = 0.25, 30
    c, high = expand(name, n, unit=unit), 0.3 if "both" in name else 0.2
    for s in (1e-9, 0.03, 0.17, high):
        tau, total = at(c, s)[Lane.TIME], at(c, high)[Lane.TIME]
        tables = Tables(c.ravel(), *[np.zeros(2 * LANES)] * 4)
        found = invert_time(tables.c, tables.at, step_of(name, n, unit), tau, high, total)
        assert at(c, found)[Lane.TIME] == pytest.approx(tau, rel=1e-15, abs=1e-17)


@pytest.mark.parametrize("seed", range(5))
def test_ranges_hold_and_are_not_idle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, h = 8, 0.7
    c = rng.normal(size=(n + 1, LANES))
    value, size = at(c, h), np.zeros(LANES)
    curvatures(c.ravel(), n, h, size)
    assert size == pytest.approx((np.abs(c[2:]) * h ** np.arange(2, n + 1)[:, None]).sum(axis=0), rel=1e-14)
    share = np.linspace(0.0, 1.0, 201)[:, None]
    inside = np.array([at(c, h * float(part)) for part in share[:, 0]])
    for lane in range(LANES):
        low, high = lane_range(c.ravel(), size, lane, h, value[lane])
        assert (inside[:, lane] >= c[0, lane] + share[:, 0] * (low - c[0, lane])).all()
        assert (inside[:, lane] <= c[0, lane] + share[:, 0] * (high - c[0, lane])).all()
        assert high - low == pytest.approx(size[lane], rel=1e-10)


@pytest.mark.parametrize("speed", [1.0, 1e-6, 1e-9, 1e-12, 1e-15, 1e-20])
@pytest.mark.parametrize("both", [False, True])
def test_the_step_of_an_impact_scales_with_its_speed(speed: float, both: bool) -> None:
    """In s itself the coefficients of a weak impact leave the range of numbers."""
    bodies, pairs = np.array([[1.0, 0.0, 0.0, 0.0]] * 3), np.array([[1e4, 0.0]] * 2)
    depth = (5 * 0.5 * speed**2 / (4 * 1e4)) ** 0.4
    u = 0.1 * depth if both else 0.0
    y = np.array([u, speed, 0.0, 0.0, -u if both else 1.0, -speed, u, u if both else -1.0])
    modes = np.array([Pair.CONTACT, Pair.CONTACT if both else Pair.OPEN, Slide.FREE])
    state = State(y, modes, np.zeros(8), np.zeros(3))
    plant, settings = Plant(bodies, bodies, pairs, 0.0), settings_of(1e-14)._replace(rate=0.0)
    step, tables = new_step(plant, state, settings, np.inf), new_workspace(settings.one.number).tables
    begin_series(tables, state)
    expand_step(tables, plant, step)
    h = length(tables, pulls(plant, y), step, settings, 1.0)
    assert 0.25 < h < 4.0
    duration = 2.9432751843247047 * depth / speed
    table = tables.c[: LANES * (step.order.number + 1)].reshape(-1, LANES)
    assert 0.01 * duration < at(table, h)[Lane.TIME] < duration

"""When an object under dry friction stops or slips, and bounds that prove that it does not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from exact.bench import ORDER, SIDES, TOLERANCE, Bench, bench
from scipy.optimize import minimize_scalar

from grasp_ros.exact.automaton.friction import (
    apply_friction,
    lift_friction,
    noise_at,
    slide_in_contact,
    slide_in_flight,
    slip_candidate,
    stays_stuck,
)
from grasp_ros.exact.compilation.jit import COMPILED
from grasp_ros.exact.contact.step_unit import higher_order, new_settings
from grasp_ros.exact.contact.taylor_step import take_step
from grasp_ros.exact.driver.workspace import new_workspace
from grasp_ros.exact.numerics.polynomial import curvatures, values
from grasp_ros.exact.records import Array, Plant, State, Tables
from grasp_ros.exact.tolerances import FRICTION
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Lane, Of, Pair, Slide, V, Work, Z
from grasp_ros.physics.model import Contact, impact_force

DRAWS, POINTS = (400, 100) if COMPILED else (8, 12)


def held(random: np.random.Generator) -> tuple[Plant, State]:
    """An object that sticks between two arms, of which one or both press."""
    given = np.zeros((3, 4))
    given[:, Of.MASS], given[:, Of.STIFFNESS] = random.uniform(0.2, 5.0, 3), random.uniform(0.0, 50.0, 3)
    given[:, Of.DAMPING], given[:, Of.FORCE] = random.uniform(0.0, 2.0, 3), random.normal(0.0, 2.0, 3)
    given[OBJECT, Of.STIFFNESS] = 0.0
    pairs = np.column_stack([10.0 ** random.uniform(3.0, 6.0, 2), random.uniform(0.0, 2.0, 2)])
    u = 10.0 ** random.uniform(-6.0, -2.0, 2) * random.choice([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0]])
    rate = np.where(u > 0.0, random.uniform(-0.4, 0.4, 2), 0.0)
    y = np.array([u[LEFT], rate[LEFT], 0.0, 0.0, -u[RIGHT], -rate[RIGHT], *u])
    modes = np.array([*np.where(u > 0.0, Pair.CONTACT, Pair.OPEN), Slide.STUCK])
    plant = Plant(given, given.copy(), pairs, 0.0, given[:, Of.FORCE].copy())
    apply_friction(plant, modes)
    return plant, State(y, modes, np.zeros(6), np.zeros(3), np.zeros(3))


def push_at(tables: Tables, plant: Plant, state: State, n: int, s: float) -> float:
    """The force on the object beside its friction at a place of a step, N, by the impact law."""
    values(tables.c, n, s, tables.at)
    push = plant.given[OBJECT, Of.FORCE]
    for side, v, sign in ((LEFT, V.L, 1.0), (RIGHT, V.R, -1.0)):
        if state.mode[side] == Pair.CONTACT:
            depth = np.square(max(tables.at[Z.L + side], 0.0))
            push += sign * impact_force(Contact(*plant.pairs[side]), depth, sign * tables.at[v])
    return float(push)


def pushes(tables: Tables, plant: Plant, state: State, n: int, h: float) -> Array:
    """The same at many places."""
    return np.array([push_at(tables, plant, state, n, s) for s in np.linspace(0.0, h, POINTS)])


@SIDES
@pytest.mark.parametrize("drag", [0.0, 0.5])
def test_a_sliding_object_stops_in_flight_where_its_speed_ends(side: Body, drag: float) -> None:
    """v' = -5 - c v, from 0.3 m/s."""
    b = bench(side, -1.0, 0.0, coulomb=5.0, object_speed=0.3,
              slide=Slide.RIGHTWARD if side == LEFT else Slide.LEFTWARD)
    b.plant.given[OBJECT, Of.DAMPING] = b.plant.bodies[OBJECT, Of.DAMPING] = drag
    apply_friction(b.plant, b.state.mode)
    found = slide_in_flight(b.plant, b.state)
    assert found.what == Slide.STUCK
    assert found.when == pytest.approx(math.log1p(0.3 * drag / 5.0) / drag if drag else 0.06, rel=1e-14)


@SIDES
@pytest.mark.parametrize(("slide", "speed", "push", "coulomb"), [
    (Slide.FREE, 0.3, -1.0, 0.0), (Slide.RIGHTWARD, 0.0, 1.0, 5.0), (Slide.RIGHTWARD, 0.3, 5.0, 5.0),
    (Slide.RIGHTWARD, 0.3, 6.0, 5.0), (Slide.STUCK, 0.0, 1.0, 5.0),
])
def test_what_is_free_at_rest_or_driven_does_not_stop_in_flight(
    side: Body, slide: Slide, speed: float, push: float, coulomb: float
) -> None:
    mirrored = side == RIGHT and slide == Slide.RIGHTWARD
    b = bench(side, -1.0, 0.0, coulomb=coulomb, object_speed=speed, object_push=push,
              slide=Slide.LEFTWARD if mirrored else slide)
    apply_friction(b.plant, b.state.mode)
    assert slide_in_flight(b.plant, b.state).when == math.inf


@pytest.mark.parametrize("part", [0.0, 0.3, 1.0])
def test_the_rounding_of_the_force_is_that_of_its_terms(part: float) -> None:
    random = np.random.default_rng(6)
    for _ in range(10):
        tables, plant, state, n, h = stuck_step(random)
        found = noise_at(tables, plant, state.mode, n, part * h)
        values(tables.c, n, part * h, tables.at)
        expected = abs(plant.given[OBJECT, Of.FORCE])
        for side, v in ((LEFT, V.L), (RIGHT, V.R)):
            if state.mode[side] == Pair.CONTACT:
                hertzian, loss = plant.pairs[side]
                speeds = abs(tables.at[v]) + abs(tables.at[V.O])
                expected += 0.5 * hertzian * max(tables.at[Z.L + side], 0.0) ** 3 * (1.0 + loss * speeds)
        assert found == pytest.approx(FRICTION * expected, rel=1e-13, abs=0.0)


def stuck_step(random: np.random.Generator) -> tuple[Tables, Plant, State, int, float]:
    """A Taylor step beside a stuck object, its order and its length."""
    plant, state = held(random)
    tables, settings = new_workspace(ORDER).tables, new_settings(TOLERANCE, higher_order(ORDER), plant.given)
    segment = take_step(tables, plant, state, settings, np.inf, np.zeros(len(Work), dtype=np.int64))
    return tables, plant, state, segment.step.order.number, segment.s


@pytest.mark.parametrize("part", [0.0, 0.5])
def test_a_stuck_object_slips_where_the_impacts_overcome_the_friction(part: float) -> None:
    """At once if they do at the begin, and not at all below it."""
    random, slips, work = np.random.default_rng(5), 0, np.zeros(len(Work), dtype=np.int64)
    for _ in range(DRAWS):
        tables, plant, state, n, h = stuck_step(random)
        along = np.abs(pushes(tables, plant, state, n, h))
        released = (tables.at[[Z.L, Z.R]] <= 0.0) & (state.mode[:OBJECT] == Pair.CONTACT)
        if along.max() <= 1.01 * along[0] or released.any():
            continue
        for coulomb in ((1.0 - part) * along[0] + part * along.max(), 1.1 * along.max(), 0.9 * along[0]):
            values(tables.c, n, h, tables.at)
            held_by = plant._replace(coulomb=coulomb)
            found = slide_in_contact(tables, held_by, state, n, h, work)
            if coulomb > along.max():
                assert not found.when <= h
                continue
            push = push_at(tables, plant, state, n, found.when)
            assert found.what == (Slide.RIGHTWARD if push > 0.0 else Slide.LEFTWARD)
            if coulomb < along[0]:
                assert found.when < 1e-20 * h
                continue
            assert abs(push) == pytest.approx(coulomb, rel=1e-10)
            assert (along[np.linspace(0.0, h, POINTS) < found.when] <= coulomb * (1.0 + 1e-10)).all()
            slips += 1
    assert slips > 0.1 * DRAWS


@pytest.mark.parametrize("part", [1.0, 1e-2])
def test_an_object_is_held_by_bounds_where_no_impact_overcomes_the_friction(part: float) -> None:
    random, proved, work = np.random.default_rng(5), 0, np.zeros(len(Work), dtype=np.int64)
    for _ in range(DRAWS):
        plant, state = held(random)
        settings = new_settings(TOLERANCE, higher_order(ORDER), plant.given)
        tables = new_workspace(ORDER).tables
        segment = take_step(tables, plant, state, settings, np.inf, work)
        n, h = segment.step.order.number, part * segment.s
        push = np.abs(pushes(tables, plant, state, n, h)).max()

        def holds(coulomb: float, n: int = n, h: float = h, tables: Tables = tables, plant: Plant = plant,
                  mode: Array = state.mode) -> bool:
            values(tables.c, n, h, tables.at)
            curvatures(tables.c, n, h, tables.size)
            return stays_stuck(tables, plant._replace(coulomb=coulomb), mode, h)

        assert not holds(push * (1.0 - 1e-9))
        assert holds(100.0 * push + 1e3)
        proved += holds(1.3 * push)
    assert proved > DRAWS * (0.9 if part < 1.0 else 0.1)


@pytest.mark.parametrize("slide", [Slide.RIGHTWARD, Slide.LEFTWARD])
def test_an_object_that_moves_against_the_mode_of_its_friction_stops_at_once(slide: Slide) -> None:
    random, turned, work = np.random.default_rng(5), 0, np.zeros(len(Work), dtype=np.int64)
    sign = 1.0 if slide == Slide.RIGHTWARD else -1.0
    for _ in range(DRAWS):
        plant, state = held(random)
        state.mode[OBJECT], state.y[V.O] = slide, -1e-17 * sign  # a rounding: it has stopped a little too late
        lift_friction(plant)
        apply_friction(plant, state.mode)
        tables = new_workspace(ORDER).tables
        settings = new_settings(TOLERANCE, higher_order(ORDER), plant.given)
        segment = take_step(tables, plant, state, settings, np.inf, work)
        if sign * tables.c[LANES + V.O] < 0.0:
            stop = slide_in_contact(tables, plant, state, segment.step.order.number, segment.s, work)
            assert stop.when < 1e-15 * segment.s
            turned += 1
    assert turned > 0.2 * DRAWS


def step(b: Bench) -> tuple[Tables, int, float]:
    """A Taylor step from a state, its order and its length."""
    apply_friction(b.plant, b.state.mode)
    tables = new_workspace(ORDER).tables
    segment = take_step(tables, b.plant, b.state, b.settings, np.inf, np.zeros(len(Work), dtype=np.int64))
    return tables, segment.step.order.number, segment.s


def first_event(b: Bench) -> tuple[float, Slide, Array]:
    """When the object stops or slips within the Taylor step from a state, s; what it does; the values there."""
    tables, n, h = step(b)
    found = slide_in_contact(tables, b.plant, b.state, n, h, np.zeros(len(Work), dtype=np.int64))
    if not found.when <= h:
        return math.inf, Slide.STUCK, tables.at
    values(tables.c, n, found.when, tables.at)
    return float(tables.at[Lane.TIME]), Slide(found.what), tables.at


def pressing(u: float, rate: float) -> Array:
    """Force on an object at rest, its rate and what it is rounded from, of an arm of 1 kg; H = 1e4 and p = 0.5."""
    elastic, factor = 1e4 * u**1.5, 1.0 + 0.5 * rate
    force = elastic * factor
    change = 1.5 * force * rate / u - elastic * 0.5 * force  # u'' is -force
    return np.array([force, change, elastic * (1.0 + 0.5 * abs(rate))])


def forward(side: Body, slide: Slide) -> Slide:
    """RIGHTWARD on the left bench, LEFTWARD on its mirror image."""
    return {RIGHT: {Slide.RIGHTWARD: Slide.LEFTWARD}}.get(side, {}).get(slide, slide)


@SIDES
@pytest.mark.parametrize(("slide", "rate", "excess", "expected"), [
    (Slide.STUCK, 0.4, 2.0, 0.0), (Slide.STUCK, -0.4, 2.0, 0.0),
    (Slide.STUCK, 0.4, 0.0, 1.0), (Slide.STUCK, -0.4, 0.0, math.inf),  # it slips when it is certain
    (Slide.STUCK, 0.4, -2.0, 2.0), (Slide.STUCK, -0.4, -2.0, math.inf),
    (Slide.RIGHTWARD, 0.4, 2.0, math.inf), (Slide.RIGHTWARD, -0.4, 2.0, 4.0),
    (Slide.RIGHTWARD, 0.4, 0.3, math.inf), (Slide.RIGHTWARD, -0.4, 0.3, 0.0),  # below half of the rounding the
    (Slide.RIGHTWARD, 0.4, -0.3, math.inf), (Slide.RIGHTWARD, -0.4, -0.3, 0.0),  # rate of the force decides
    (Slide.RIGHTWARD, 0.4, -2.0, 0.0),
])
def test_an_object_at_rest_follows_a_force_near_its_friction(
    side: Body, slide: Slide, rate: float, excess: float, expected: float
) -> None:
    """Both arms press, together with F + F' t, F' in N/s, and the friction is F - e; v = e t + F' t^2 / 2 for 1 kg.

    `excess` is e in roundings r of the force and the friction, and `expected` in r / |F'|.
    """
    beside = 0.001, 0.2 * rate
    near, far = pressing(0.01, rate), pressing(*beside)
    force, change, _ = near - far
    rounding = FRICTION * (0.5 * (near + far)[2] + force)
    b = bench(side, 0.01, rate, Pair.CONTACT, beside=beside, beside_mode=Pair.CONTACT, p=0.5,
              coulomb=force - excess * rounding, slide=forward(side, slide))
    time, what, _ = first_event(b)
    assert time == pytest.approx(expected * rounding / abs(change), rel=0.1, abs=1e-25)
    assert what is (forward(side, Slide.RIGHTWARD) if slide == Slide.STUCK and time < math.inf else Slide.STUCK)


@SIDES
@pytest.mark.parametrize(("excess", "slips"), [(-2.0, False), (0.5, False), (3.0, True), (1000.0, True)])
def test_an_impact_lets_an_object_slip_if_its_peak_exceeds_the_friction(side: Body, excess: float, slips: bool) -> None:
    """The energy of an arm of 1 kg at 9.99 mm is the one of the contact at 10 mm, where it turns, far within the step.

    `excess` is that of the peak, in roundings; only one rounding is certain.
    """
    deepest, u = 0.01, 0.00999
    peak, rate = 1e4 * deepest**1.5, math.sqrt(0.8e4 * (deepest**2.5 - u**2.5))
    rounding = FRICTION * 1.5 * peak
    b = bench(side, u, rate, Pair.CONTACT, p=0.0, coulomb=peak - excess * rounding, slide=Slide.STUCK)
    time, what, at = first_event(b)
    assert (time < math.inf) is slips
    if slips:
        assert what is forward(side, Slide.RIGHTWARD)
        assert at[V.L if side == LEFT else V.R] * (1.0 if side == LEFT else -1.0) > 0.0  # not after the peak
        assert 1e4 * at[Z.L + side] ** 3 - b.plant.coulomb == pytest.approx(rounding, rel=0.1)


@SIDES
def test_a_slip_hidden_by_impacts_that_balance_is_found_when_they_are_weaker(side: Body) -> None:
    """Both arms leave an object alike, which a force of little more than its friction pushes.

    The rounding is that of this force, of the friction and of half of each impact, 10 N at first: 5 N are left when it
    is as large as what the force exceeds the friction by.
    """
    b = bench(side, 0.01, -0.4, Pair.CONTACT, beside=(0.01, -0.4), beside_mode=Pair.CONTACT, p=0.0, coulomb=1.0,
              object_push=1.0 + 7.0 * FRICTION, slide=Slide.STUCK)
    _, what, at = first_event(b)
    assert what is forward(side, Slide.RIGHTWARD)
    assert 1e4 * at[[Z.L, Z.R]] ** 3 == pytest.approx(5.0, rel=0.1)


@SIDES
@pytest.mark.parametrize(("excess", "slips"), [(0.2, False), (0.8, True)])
def test_the_peak_of_a_push_is_as_certain_as_weaker_impacts_tell(side: Body, excess: float, slips: bool) -> None:
    """Both arms leave, and one of them is pushed back: what the other adds has its peak while both impacts die out.

    `excess` is that of the peak in roundings at the begin, of 10 N each. At the peak they have 6 N, and at the end of
    the step 3 N.
    """
    def leaving(coulomb: float) -> Bench:
        return bench(side, 0.01, -0.8, Pair.CONTACT, beside=(0.01, -0.81), beside_mode=Pair.CONTACT, beside_push=-2.5,
                     p=0.0, coulomb=coulomb, slide=Slide.STUCK)

    b = leaving(0.0)
    tables, n, h = step(b)
    peak = -minimize_scalar(lambda s: -abs(push_at(tables, b.plant, b.state, n, s)), bounds=(0.0, h), method="bounded",
                            options={"xatol": 1e-9}).fun
    assert abs(push_at(tables, b.plant, b.state, n, h)) < 0.9 * peak
    time, what, at = first_event(leaving(peak - excess * FRICTION * (peak + 10.0)))
    assert (time < math.inf) is slips
    if slips:
        assert what is forward(side, Slide.RIGHTWARD)
        assert abs(at[Z.L] ** 3 - at[Z.R] ** 3) * 1e4 == pytest.approx(peak, abs=FRICTION * 10.0)


@pytest.mark.parametrize("push", [6.0, -6.0])
def test_a_search_that_fails_is_no_slip_to_the_other_side(push: float) -> None:
    """6 N against 5 N slips at once to its own side; a search that gives up, here at a nan, ends the run."""
    b = bench(LEFT, -1.0, 0.0, coulomb=5.0, slide=Slide.STUCK)
    tables = new_workspace(ORDER).tables
    tables.row[:3] = push, 0.0, math.nan
    assert math.isnan(slip_candidate(tables, b.plant, 2, 1.0, (0.0, 0.0), np.zeros(len(Work), dtype=np.int64)).when)

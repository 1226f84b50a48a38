"""Contacts that begin at u = 0 from rest, or both at once: against the reference."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import gmpy2
import numpy as np
import pytest
from exact.bench import SIDES, Bench, bench, bits, drive
from gmpy2 import mpfr
from oracles import FREE, done, kinds, run

from grasp_ros.exact.automaton.begin import force_free_time, is_negligible, leaves_force_out, must_begin
from grasp_ros.exact.automaton.edge import HIGHEST
from grasp_ros.exact.automaton.friction import apply_friction
from grasp_ros.exact.automaton.modes import initial_modes
from grasp_ros.exact.kinematics import other
from grasp_ros.exact.records import Array
from grasp_ros.exact.tolerances import FORCE_FREE
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, Slide, Transition, U, V, Work, X
from grasp_ros.physics.model import Contact
from grasp_ros.physics.system import COLUMN
from lab.cases.impacts import TOUCHING
from lab.reference import plant as exact
from lab.reference.grasp import Grasp
from lab.reference.run import Run, precision

PARTS = pytest.mark.parametrize("part", [1.0, 1e-2, 1e-5])
MOTION = [V.L, V.O, V.R]
OVERLAPS = [U.L, U.R]
DIGITS = 20
SHOWS = 5e-4  # s: by then the forces of most scenes have changed the velocities
OTHERS = {
    "a light stiff arm beside": 1e-6, "a light stiff arm from rest": 1e-6, "pressed from rest, order 3": 0.02,
    "pressed from rest, order 4": 0.05,
}


def start(side: Body, **options: Any) -> Bench:
    """Pairs at u = 0 with the modes that follow, and options of `bench`."""
    mass, hertzian = options.pop("masses", {}), options.pop("hertzian", {})
    slide = options.get("slide", Slide.FREE)
    if side == RIGHT and slide in (Slide.RIGHTWARD, Slide.LEFTWARD):
        options["slide"] = Slide.RIGHTWARD if slide == Slide.LEFTWARD else Slide.LEFTWARD
    b = bench(side, 0.0, options.pop("d", 0.0), **options)
    for name, body in (("side", side), ("object", OBJECT), ("beside", other(side))):
        b.plant.given[body, Of.MASS] = mass.get(name, 1.0)
        if name in hertzian:
            b.plant.pairs[body, Law.HERTZIAN] = hertzian[name]
    b.plant.bodies[:] = b.plant.given
    apply_friction(b.plant, b.state.mode)
    initial_modes(b.plant, b.state)
    return b


SCENES: dict[str, dict[str, Any]] = {
    "both approaching": {"d": 0.3, "beside": (0.0, 0.5)},
    "both approaching alike": {"d": 0.3, "beside": (0.0, 0.3)},
    "touching chain": {"d": 0.3, "beside": (0.0, 0.0)},
    "touching chain without damping": {"d": 0.3, "beside": (0.0, 0.0), "p": 0.0},
    "pressed from rest": {"push": 2.0},
    "pressed from rest, order 3": {"object_speed": -0.3, "stiffness": 2.0},
    "pressed from rest, order 4": {"push": -1.0, "object_push": -1.0, "stiffness": 2.0},
    "both pressed from rest": {"push": 2.0, "beside": (0.0, 0.0), "beside_push": -1.0},
    "one presses the other from rest": {"push": 2.0, "beside": (0.0, 0.0)},
    "from rest beside a deep contact": {"beside": (0.01, 0.1)},
    "pulled from rest by less than a deep contact presses": {"push": -5.0, "beside": (0.01, -0.1)},
    "from rest beside a clamped pair": {"push": 2.0, "beside": (0.01, -9.0)},
    "parting from rest beside a start": {"push": -2.0, "beside": (0.0, 0.0), "beside_push": -1.0},
    "parting from rest beside a start, order 3": {
        "object_speed": 0.3, "stiffness": 2.0, "beside": (0.0, 0.0), "beside_push": -1.0,
    },
    "against a stuck object": {"push": 2.0, "slide": Slide.STUCK, "coulomb": 5.0},
    "a light stiff arm beside": {
        "d": 0.3, "beside": (0.0, 0.0), "masses": {"beside": 0.025}, "hertzian": {"beside": 1e15},
    },
    "a light stiff arm from rest": {"push": 2.0, "masses": {"side": 0.025}, "hertzian": {"side": 1e15}},
}


def shows(name: str) -> float:
    """Time in s after which the force of a contact has changed a velocity."""
    return OTHERS.get(name, SHOWS)


@cache
def behind(name: str, side: Body, part: float = 1.0) -> tuple[Bench, Bench, Array]:
    """A scene before and behind its begin, and the states within it."""
    before, b, t = start(side, **SCENES[name]), start(side, **SCENES[name]), part * shows(name)
    return before, b, drive(b, t, [0.01 * t, 0.3 * t, 0.9 * t])


def states_at(b: Bench, times: list[float]) -> list[list[Any]]:
    """x and v of left arm, object and right arm at ascending times, and u of both pairs behind them."""
    bodies = [exact.Body.of(*map(mpfr, row)) for row in b.plant.given.tolist()]
    laws = [exact.Law(*map(mpfr, row)) for row in b.plant.pairs.tolist()]
    motion = exact.Plant(tuple(bodies), tuple(laws), mpfr(b.plant.coulomb))
    x, v = ([mpfr(float(b.state.y[COLUMN[body] + i])) for body in (LEFT, RIGHT, OBJECT)] for i in (0, 1))
    found = Run(motion, x, v, [mpfr(time) for time in times], DIGITS, math.inf)
    found.advance(mpfr(times[-1]))
    return [[*row, row[X.L] - row[X.O], row[X.O] - row[X.R]] for row in found.rows]


@pytest.mark.parametrize("name", SCENES)
@PARTS
def test_a_begin_against_the_reference(name: str, part: float) -> None:
    """To some roundings of what has changed, of the fastest velocity and of the longest way; outputs, too.

    The mirror image, below, has the same bits.
    """
    before, b, rows = behind(name, LEFT, part)
    t = part * shows(name)
    assert b.events == []
    with gmpy2.context(precision=precision(DIGITS)):
        *within, expected = states_at(before, [0.01 * t, 0.3 * t, 0.9 * t, t])
        moved = [abs(p - mpfr(float(q))) for p, q in zip(expected, before.state.y, strict=True)]
        fastest = max(abs(expected[lane]) for lane in MOTION)
        for lane in (*MOTION, *OVERLAPS):
            rounding = fastest if lane in MOTION else abs(expected[lane]) + t * fastest
            bound = 2e-14 * moved[lane] + 2.0 * EPS * rounding
            assert abs(mpfr(float(b.state.y[lane])) - expected[lane]) <= bound, lane
        for row, right in zip([*rows, b.state.y[:6]], [*within, expected], strict=True):
            for lane in range(6):
                size = max(abs(value) for value in right[lane % 2 : 6 : 2])
                assert abs(mpfr(float(row[lane])) - right[lane]) <= 1e-15 * size, lane


@SIDES
@pytest.mark.parametrize("name", SCENES)
def test_behind_a_begin_the_forces_act(name: str, side: Body) -> None:
    before, b, _ = behind(name, side)
    assert Pair.BEGINNING not in (b.mode(LEFT), b.mode(RIGHT))
    changes = []
    for own in (LEFT, RIGHT):
        if b.mode(own) is Pair.CONTACT and before.state.y[U.L + own] == 0.0:
            mass = 1.0 / (1.0 / b.plant.bodies[own, Of.MASS] + 1.0 / b.plant.bodies[OBJECT, Of.MASS])
            d = abs(b.state.y[V.L] - b.state.y[V.O] if own == LEFT else b.state.y[V.O] - b.state.y[V.R])
            changes.append(b.plant.pairs[own, Law.HERTZIAN] * b.state.y[U.L + own] ** 1.5 * shows(name) / (mass * d))
    assert max(changes) > 1e-7  # of the speed u', by the force at the end


def reflected(y: Array) -> Array:
    """States of the mirror image."""
    return -y[..., [X.R, V.R, X.O, V.O, X.L, V.L]]


@pytest.mark.parametrize("name", SCENES)
@PARTS
def test_a_mirrored_begin_is_the_same_to_the_bit(name: str, part: float) -> None:
    (_, left, rows), (_, right, others) = behind(name, LEFT, part), behind(name, RIGHT, part)
    assert left.events == [(other(side), kind) for side, kind in right.events]
    assert bits(left.state.y[:6] + 0.0) == bits(reflected(right.state.y) + 0.0)
    assert bits(rows + 0.0) == bits(reflected(others) + 0.0)
    assert bits(left.state.y[OVERLAPS]) == bits(right.state.y[[U.R, U.L]])


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(
    ("metre", "second", "kilogram"), [(4.0, 2.0, 8.0), (2.0**-40, 2.0**7, 2.0**-11), (1.0, 2.0**-30, 1.0)]
)
def test_a_begin_in_other_units_is_the_same_to_the_bit(name: str, metre: float, second: float, kilogram: float) -> None:
    """O7: lengths by powers of 4, times and masses by powers of 2."""
    _, plain, _ = behind(name, LEFT)
    b = start(LEFT, **SCENES[name])
    newton = kilogram * metre / second**2
    units = np.array([kilogram, newton / metre, newton * second / metre, newton])
    pairs = np.array([newton / (metre * math.sqrt(metre)), second / metre])
    state = np.array([metre, metre / second] * 3 + [metre] * 2)
    plant = b.plant._replace(given=b.plant.given * units, bodies=b.plant.bodies * units, pairs=b.plant.pairs * pairs,
                             coulomb=b.plant.coulomb * newton)
    b = b._replace(plant=plant)
    b.state.y[:] *= state
    drive(b, shows(name) * second)
    assert bits(b.state.y) == bits(plain.state.y * state)


@SIDES
@pytest.mark.parametrize("gap", [1e-9, 1e-20])
def test_a_begin_finds_the_touch_of_the_other_pair(gap: float, side: Body) -> None:
    b = start(side, push=2.0, beside=(-gap, 0.5))
    drive(b, 3.0 * gap)
    assert b.events == [(other(side), Transition.TOUCH)]
    assert b.times == pytest.approx([2.0 * gap], rel=1e-9, abs=0.0)


@SIDES
@pytest.mark.parametrize("depth", [1e-9, 1e-20])
def test_a_begin_finds_where_the_other_pair_parts(depth: float, side: Body) -> None:
    b = start(side, push=2.0, beside=(depth, -9.0))
    assert b.mode(other(side)) is Pair.CLAMPED
    drive(b, depth)
    assert b.events == [(other(side), Transition.RELEASE)]
    assert b.times == pytest.approx([depth / 9.0], rel=1e-6, abs=0.0)


# Which pairs begin, and how long without their force.


@SIDES
@pytest.mark.parametrize(("u", "d", "mode", "beside", "beside_mode", "expected"), [
    (0.0, 0.0, Pair.CONTACT, (-1.0, 0.0), Pair.OPEN, True),
    (0.0, 0.3, Pair.CONTACT, (-1.0, 0.0), Pair.OPEN, False),
    (0.0, 0.3, Pair.CONTACT, (0.0, 0.1), Pair.CONTACT, True),
    (0.0, 0.3, Pair.CONTACT, (0.0, 0.0), Pair.BEGINNING, True),
    (0.0, 0.3, Pair.CONTACT, (0.0, 0.1), Pair.OPEN, False),
    (0.0, 0.3, Pair.CONTACT, (0.01, 0.1), Pair.CONTACT, False),
    (0.0, 0.0, Pair.CONTACT, (0.01, 0.1), Pair.CONTACT, True),
    (1e-9, 0.0, Pair.CONTACT, (0.0, 0.1), Pair.CONTACT, False),
    (0.0, 0.0, Pair.RESTING, (0.0, 0.1), Pair.CONTACT, False),
])
def test_a_pair_begins_where_the_regularised_time_cannot(
    side: Body, u: float, d: float, mode: Pair, beside: tuple[float, float], beside_mode: Pair, expected: bool
) -> None:
    b = bench(side, u, d, mode, beside=beside, beside_mode=beside_mode)
    assert must_begin(b.state, side) is expected


@SIDES
@pytest.mark.parametrize(("options", "order"), [({"d": 0.3}, 1), ({"push": 2.0}, 2), ({"d": 1e-12, "push": 2.0}, 1)])
@pytest.mark.parametrize("loss", [0.0, 0.5, 1e6])
def test_what_a_pair_leaves_out_is_below_the_rounding_of_its_motion(
    side: Body, options: dict[str, float], order: int, loss: float
) -> None:
    b = bench(side, 0.0, options.get("d", 0.0), Pair.BEGINNING, push=options.get("push", 0.0), p=loss)
    t = force_free_time(np.zeros(HIGHEST + 1), b.plant, b.state, side)
    d, a = options.get("d", 0.0), options.get("push", 0.0)
    for time, expected in ((t, True), (2.0**40 * t, False)):
        u, rate = d * time + 0.5 * a * time**2, d + a * time
        assert leaves_force_out(b.plant, side, u, rate, rate) is expected
    assert math.frexp(t)[0] == 0.5


@SIDES
@pytest.mark.parametrize("push", [-0.0625, -0.06, -1e-3])
@pytest.mark.parametrize("hertzian", [1e-14, 1e-9, 1.0])
def test_a_pair_that_turns_back_leaves_out_no_contact(side: Body, hertzian: float, push: float) -> None:
    b = bench(side, 0.0, 1.0, Pair.BEGINNING, push=push)
    b.plant.pairs[side] = hertzian, 0.0
    t = force_free_time(np.zeros(HIGHEST + 1), b.plant, b.state, side)
    for part in np.linspace(0.0, 1.0, 101)[1:]:
        u, rate = part * t + 0.5 * push * (part * t) ** 2, 1.0 + push * part * t
        assert rate > 0.0
        assert leaves_force_out(b.plant, side, u, rate, 1.0)


@SIDES
@pytest.mark.parametrize("rate", [-1e3, 1e-6, 1e-3, 1e3])
def test_the_impulse_that_is_left_out_is_the_force_times_the_time_since_u_was_0(side: Body, rate: float) -> None:
    """H u^(3/2) u / |u'|, beside 0.5 kg times the larger of |u'| and 1 m/s."""
    b = bench(side, 0.0, rate, Pair.BEGINNING, p=0.0)
    for part in (0.9, 1.1):
        u = (part * FORCE_FREE * 0.5 * max(abs(rate), 1.0) * abs(rate) / 1e4) ** 0.4
        assert leaves_force_out(b.plant, side, u, rate, 1.0) is (part < 1.0)


@SIDES
def test_nothing_moves_a_pair_that_only_another_one_will_press(side: Body) -> None:
    assert force_free_time(np.zeros(HIGHEST + 1), *bench(side, 0.0, 0.0, Pair.BEGINNING)[:2], side) == math.inf
    assert force_free_time(np.zeros(HIGHEST + 1), *bench(side, 0.0, 0.3, Pair.CONTACT)[:2], side) == math.inf


# The impulse that a pair leaves out.


@SIDES
@pytest.mark.parametrize(("u", "stuck", "negligible"), [(1e-10, False, True), (1e-10, True, False), (1e-14, True, True),
                                                        (1e-6, False, False)])
def test_a_stuck_object_takes_a_smaller_force_for_one(side: Body, u: float, stuck: bool, negligible: bool) -> None:
    """Of 1 kg at 1 m/s the impulses 1e-21, 1e-31 and 1e-11 N s; 1 N of friction holds against 1e-11 and 1e-17 N."""
    b = bench(side, u, 1.0, p=0.0, coulomb=1.0)
    if stuck:
        b.plant.bodies[OBJECT, Of.MASS] = math.inf
    assert bool(is_negligible(b.plant, side, u, 1.0, EPS)) is negligible


@SIDES
@pytest.mark.parametrize(("u", "d", "negligible"), [(0.0, 0.0, True), (-1e-3, 1.0, True), (1e-3, 0.0, False)])
def test_without_penetration_there_is_no_impulse_and_without_approach_no_bound(
    side: Body, u: float, d: float, negligible: bool
) -> None:
    b = bench(side, u, d)
    assert bool(is_negligible(b.plant, side, u, d, EPS)) is negligible


# Whole runs.


@pytest.mark.parametrize("hertzian", [1e2, 1e4, 1e12])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(("object_mass", "steps"), [(1.0, 46), (0.5, 48), (0.1, 58)])
def test_a_touching_chain(object_mass: float, steps: int, mirror: bool, speed: float, hertzian: float) -> None:
    """O11: the same for every H and every speed."""
    grasp = Grasp(FREE, FREE, Contact(hertzian, 0.0), Contact(hertzian, 0.0), object_mass)
    state = [0.0, 0.0, 0.0, 0.0, 0.0, -speed] if mirror else [0.0, speed, 0.0, 0.0, 0.0, 0.0]
    duration = 20.0 * (1.0 / (hertzian * math.sqrt(speed))) ** 0.4
    result = run(grasp, state, duration)
    found = done(result).state[1::2] / speed
    assert (-found[::-1] if mirror else found).tolist() == pytest.approx(TOUCHING[object_mass], rel=3e-15, abs=1e-14)
    assert done(result).work[Work.CONTACT_STEPS] <= steps
    assert [kind for kind, _ in kinds(result)] == ["TOUCH", "TOUCH", "RELEASE", "RELEASE"]


@pytest.mark.parametrize("pieces", [2, 7, 100])
def test_a_chain_in_pieces_is_the_same_chain(pieces: int) -> None:
    grasp = Grasp(FREE, FREE, Contact(1e4, 0.3), Contact(1e4, 0.3), 1.0)
    whole = run(grasp, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 0.1)
    parts = run(grasp, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 0.1 / pieces)
    for _ in range(pieces - 1):
        parts.integrator.advance(0.1 / pieces)
    assert done(parts).state == pytest.approx(done(whole).state, rel=1e-13, abs=1e-14)
    assert [kind for kind, _ in kinds(parts)] == [kind for kind, _ in kinds(whole)]


def test_a_chain_records_its_second_touch_when_it_presses() -> None:
    """A chain that comes from afar touches twice at one instant."""
    grasp = Grasp(FREE, FREE, Contact(1e4, 0.3), Contact(1e4, 0.3), 1.0)
    result = run(grasp, [-0.5, 1.0, 0.0, 0.0, 0.0, 0.0], 0.6)
    first, second = done(result).events[:2]
    assert (first.kind, first.side, second.kind, second.side) == (Transition.TOUCH, LEFT, Transition.TOUCH, RIGHT)
    assert first.time == second.time == 0.5

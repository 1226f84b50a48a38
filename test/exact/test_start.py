"""Contacts that begin at u = 0 from rest, or both at once: the start segment against a motion in 50 digits."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import gmpy2
import numpy as np
import pytest
from exact.bench import Bench, bench, bits
from exact.motion import BITS, states_at
from gmpy2 import mpfr
from oracles import FREE, done, kinds, run

from grasp_ros.exact.friction import apply_friction
from grasp_ros.exact.kinematics import other
from grasp_ros.exact.modes import initial_modes
from grasp_ros.exact.records import Array
from grasp_ros.exact.scales import new_settings
from grasp_ros.exact.series import new_tables
from grasp_ros.exact.start import must_start, start_segment
from grasp_ros.exact.start_scales import holding_time
from grasp_ros.physics.layout import (
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_L,
    X_O,
    X_R,
    Body,
    Filled,
    Pair,
    Slide,
    Transition,
    Work,
)
from grasp_ros.physics.model import Contact, Grasp

SIDES = pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
MOTION = [V_L, V_O, V_R]
OVERLAPS = [U_L, U_R]


def start(side: Body, **options: Any) -> Bench:
    """Pairs at u = 0 with the modes that follow, and options of `bench`."""
    mass, hertzian = options.pop("masses", {}), options.pop("hertzian", {})
    slide = options.get("slide", Slide.FREE)
    if side == RIGHT and slide in (Slide.RIGHTWARD, Slide.LEFTWARD):
        options["slide"] = Slide.RIGHTWARD if slide == Slide.LEFTWARD else Slide.LEFTWARD
    b = bench(side, 0.0, options.pop("d", 0.0), **options)
    for name, body in (("side", side), ("object", OBJECT), ("beside", other(side))):
        b.plant.given[body, MASS] = mass.get(name, 1.0)
        if name in hertzian:
            b.plant.pairs[body, HERTZIAN] = hertzian[name]
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
    "a slip at the limit": {"push": 2.0, "slide": Slide.RIGHTWARD, "object_push": 5.0, "coulomb": 5.0},
    "a light stiff arm beside": {
        "d": 0.3, "beside": (0.0, 0.0), "masses": {"beside": 0.025}, "hertzian": {"beside": 1e15},
    },
    "a light stiff arm from rest": {"push": 2.0, "masses": {"side": 0.025}, "hertzian": {"side": 1e15}},
}


@cache
def segment(name: str, side: Body, tolerance: float = 1e-16) -> tuple[Bench, Bench, float]:
    """A scene before and behind its start segment, and how long that is."""
    before, b = start(side, **SCENES[name]), start(side, **SCENES[name])
    return before, b, start_for(b, 1e9, tolerance)


def start_for(b: Bench, span: float, tolerance: float = 1e-16) -> float:
    """The start segment of at most `span` seconds; its length."""
    assert must_start(b.state)
    b.state.carry[:] = 1e-20
    settings = new_settings(tolerance, b.settings.both.number, b.plant.given)._replace(rate=b.settings.rate)
    found = float(start_segment(new_tables(b.settings.one.number), b.plant, b.state, settings, span, b.out))
    assert [b.state.y[U_L + side] for side, _ in b.events] in ([], [0.0])  # it ends with its first event
    assert b.out.work[Work.CONTACT_STEPS] == 1
    assert not b.state.carry.any()  # of places that are gone
    return found


@SIDES
@pytest.mark.parametrize("name", SCENES)
def test_a_start_against_50_digits(name: str, side: Body) -> None:
    before, b, t = segment(name, side)
    with gmpy2.context(precision=BITS):
        expected = next(states_at(before, [t]))
        moved = [abs(p - mpfr(float(q))) for p, q in zip(expected, before.state.y, strict=True)]
        for lane in (*MOTION, *OVERLAPS):
            bound = 2e-14 * moved[lane] + 2.3e-16 * abs(expected[lane])
            assert abs(mpfr(float(b.state.y[lane])) - expected[lane]) <= bound, lane
        places = max(moved[lane] + abs(expected[lane]) for lane in (X_L, X_O, X_R))
        for lane in (X_L, X_O, X_R):
            assert abs(mpfr(float(b.state.y[lane])) - expected[lane]) <= 1e-15 * places, lane
    assert b.state.clock.tolist() == [t, 0.0, 0.0]


@SIDES
@pytest.mark.parametrize("name", SCENES)
def test_a_start_goes_as_far_as_the_contact_shows(name: str, side: Body) -> None:
    """A start that is too short would pass every other test: behind it the regularised time can go on."""
    before, b, t = segment(name, side)
    assert t > 0.0
    for own in (LEFT, RIGHT):
        if b.mode(own) is Pair.CONTACT:
            assert b.state.y[U_L + own] > 0.0
    assert not must_start(b.state)
    changes = []
    for own in (LEFT, RIGHT):
        if b.mode(own) is Pair.CONTACT and before.state.y[U_L + own] == 0.0:
            mass = 1.0 / (1.0 / b.plant.bodies[own, MASS] + 1.0 / b.plant.bodies[OBJECT, MASS])
            d = abs(b.state.y[V_L] - b.state.y[V_O] if own == LEFT else b.state.y[V_O] - b.state.y[V_R])
            changes.append(b.plant.pairs[own, HERTZIAN] * b.state.y[U_L + own] ** 1.5 * t / (mass * d))
    assert max(changes) > 1e-7  # of the speed u', by the force at the end


def reflected(y: Array) -> Array:
    """The state of the mirror image."""
    return -y[[X_R, V_R, X_O, V_O, X_L, V_L]]


@pytest.mark.parametrize("name", SCENES)
def test_a_mirrored_start_is_the_same_to_the_bit(name: str) -> None:
    _, left, t = segment(name, LEFT)
    _, right, mirrored = segment(name, RIGHT)
    assert bits(np.array(t)) == bits(np.array(mirrored))
    assert bits(left.state.y[:6] + 0.0) == bits(reflected(right.state.y) + 0.0)
    assert bits(left.state.y[OVERLAPS]) == bits(right.state.y[[U_R, U_L]])


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize(
    ("metre", "second", "kilogram"), [(4.0, 2.0, 8.0), (2.0**-40, 2.0**7, 2.0**-11), (1.0, 2.0**-90, 1.0)]
)
def test_a_start_in_other_units_is_the_same_to_the_bit(name: str, metre: float, second: float, kilogram: float) -> None:
    """O7: lengths by powers of 4, times and masses by powers of 2."""
    _, plain, t = segment(name, LEFT)
    b = start(LEFT, **SCENES[name])
    newton = kilogram * metre / second**2
    units = np.array([kilogram, newton / metre, newton * second / metre, newton])
    pairs = np.array([newton / (metre * math.sqrt(metre)), second / metre])
    state = np.array([metre, metre / second] * 3 + [metre] * 2)
    plant = b.plant._replace(given=b.plant.given * units, bodies=b.plant.bodies * units, pairs=b.plant.pairs * pairs,
                             coulomb=b.plant.coulomb * newton)
    b = b._replace(plant=plant, settings=b.settings._replace(rate=b.settings.rate / second))
    b.state.y[:] *= state
    assert start_for(b, 1e9 * second) == t * second
    assert bits(b.state.y) == bits(plain.state.y * state)


@SIDES
@pytest.mark.parametrize("name", ["both approaching", "touching chain", "pressed from rest, order 4"])
def test_outputs_inside_a_start(name: str, side: Body) -> None:
    before, whole, t = segment(name, side)
    times = [part * t for part in (1e-6, 0.01, 0.3, 0.7, 0.999)]
    b = start(side, **SCENES[name])
    out = b.out._replace(grid=np.array([*times, 2.0 * t]), rows=np.full((len(times) + 1, 6), np.nan))
    b = b._replace(out=out)
    assert start_for(b, 1e9) == t
    assert bits(b.state.y) == bits(whole.state.y)
    assert b.out.filled[Filled.OUTPUTS] == len(times)
    assert np.isnan(out.rows[-1]).all()
    with gmpy2.context(precision=BITS):
        for row, expected in zip(out.rows, states_at(before, times), strict=False):
            for lane in range(6):
                size = max(abs(value) for value in expected[lane % 2 : 6 : 2])
                assert abs(mpfr(float(row[lane])) - expected[lane]) <= 1e-15 * size


@SIDES
@pytest.mark.parametrize("name", SCENES)
def test_a_start_ends_with_the_span(name: str, side: Body) -> None:
    before, _, t = segment(name, side)
    for part in (1e-9, 0.1, 0.9):
        b = start(side, **SCENES[name])
        assert start_for(b, part * t) == part * t
        with gmpy2.context(precision=BITS):
            expected = next(states_at(before, [part * t]))
            for lane in OVERLAPS:
                moved = abs(expected[lane] - mpfr(float(before.state.y[lane])))
                bound = 2e-14 * moved + 2.3e-16 * abs(expected[lane])
                assert abs(mpfr(float(b.state.y[lane])) - expected[lane]) <= bound, lane


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8, 1e-12])
def test_a_coarser_accuracy_neglects_what_it_may_of_what_moves(name: str, tolerance: float) -> None:
    before, b, t = segment(name, LEFT, tolerance)
    with gmpy2.context(precision=BITS):
        expected = next(states_at(before, [t]))
        ended = [U_L + own for own, _ in b.events]  # its u came back to 0: it has not moved
        for lane in {*MOTION, *OVERLAPS} - set(ended):
            moved = abs(expected[lane] - mpfr(float(before.state.y[lane])))
            bound = (30 * tolerance + 2e-14) * moved + 2.3e-16 * abs(expected[lane])
            assert abs(mpfr(float(b.state.y[lane])) - expected[lane]) <= bound, lane


@pytest.mark.parametrize("name", ["touching chain", "pressed from rest", "one presses the other from rest"])
def test_a_coarser_accuracy_goes_further(name: str) -> None:
    lengths = [segment(name, LEFT, tolerance)[2] for tolerance in (1e-16, 1e-12, 1e-8, 1e-4)]
    assert lengths == sorted(lengths)
    assert lengths[-1] > 3.0 * lengths[0]


@SIDES
@pytest.mark.parametrize("gap", [1e-9, 1e-130, 1e-240])
def test_a_start_ends_where_the_other_pair_touches(gap: float, side: Body) -> None:
    b = start(side, push=2.0, beside=(-gap, 0.5))
    t = start_for(b, 1e9)
    assert t == pytest.approx(2.0 * gap, rel=1e-9, abs=0.0)
    assert b.events == [(other(side), Transition.TOUCH)]
    assert b.state.y[U_L + other(side)] == 0.0


@SIDES
@pytest.mark.parametrize("depth", [1e-9, 1e-130, 1e-240])
def test_a_start_ends_where_the_other_pair_parts(depth: float, side: Body) -> None:
    b = start(side, push=2.0, beside=(depth, -9.0))
    assert b.mode(other(side)) is Pair.CLAMPED
    t = start_for(b, 1e9)
    assert t == pytest.approx(depth / 9.0, rel=1e-6, abs=0.0)
    assert b.events == [(other(side), Transition.RELEASE)]
    assert b.state.y[U_L + other(side)] == 0.0


@SIDES
def test_forces_are_left_out_only_where_all_begin_from_rest(side: Body) -> None:
    resting, moving = start(side, push=2.0, beside=(0.0, 0.0), beside_push=-1.0), start(side, beside=(0.01, 0.0))
    assert 0.0 < holding_time(*resting[:3]) < 1e-4
    assert holding_time(*moving[:3]) == 0.0
    assert holding_time(*start(side, push=2.0, coulomb=1e3, slide=Slide.STUCK)[:3]) == 0.0


# Whole runs.


@pytest.mark.parametrize("hertzian", [1e2, 1e4, 1e12])
@pytest.mark.parametrize("speed", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(
    ("object_mass", "expected", "steps"),
    [
        (1.0, (-0.070952353651436871, 0.076403039071206993, 0.994549314580229878), 15),
        (0.5, (-0.136122574012185708, 0.355827683353408662, 0.958208732335481377), 17),
        (0.1, (-0.0475095756030004457, 0.907669860965354066, 0.956742589506465039), 27),
    ],
)
def test_a_touching_chain(
    object_mass: float, expected: tuple[float, float, float], steps: int, mirror: bool, speed: float, hertzian: float
) -> None:
    """O11: the same for every H and every speed."""
    grasp = Grasp(FREE, FREE, Contact(hertzian, 0.0), Contact(hertzian, 0.0), object_mass)
    state = [0.0, 0.0, 0.0, 0.0, 0.0, -speed] if mirror else [0.0, speed, 0.0, 0.0, 0.0, 0.0]
    duration = 20.0 * (1.0 / (hertzian * math.sqrt(speed))) ** 0.4
    result = run(grasp, state, duration)
    found = done(result).state[1::2] / speed
    assert (-found[::-1] if mirror else found).tolist() == pytest.approx(expected, rel=3e-15, abs=1e-14)
    assert done(result).work[Work.CONTACT_STEPS] <= steps
    assert [kind for kind, _ in kinds(result)] == ["RELEASE", "RELEASE"]


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
    """A run that starts in contact records no touch; a chain that comes from afar touches twice at one instant."""
    grasp = Grasp(FREE, FREE, Contact(1e4, 0.3), Contact(1e4, 0.3), 1.0)
    result = run(grasp, [-0.5, 1.0, 0.0, 0.0, 0.0, 0.0], 0.6)
    first, second = done(result).events[:2]
    assert (first.kind, first.side, second.kind, second.side) == (Transition.TOUCH, LEFT, Transition.TOUCH, RIGHT)
    assert first.time == second.time == 0.5

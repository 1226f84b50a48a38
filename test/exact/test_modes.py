"""The automaton: one direct test per arrow, left and right, and per corner rule.

`mutants.py` changes every branch of `grasp_ros.exact.automaton.modes` and expects a test of this file to fail.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from exact.bench import SIDES, TOLERANCE, Bench, bench, bits

from grasp_ros.exact.automaton.friction import apply_friction, since_certain
from grasp_ros.exact.automaton.modes import (
    begin_contacts,
    begin_interval,
    end_begin,
    initial_modes,
    initial_slide,
    let_leave,
    make_slide_transition,
    make_transition,
    make_transitions,
    mode_of,
    settle_pairs,
    settle_resting,
)
from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.kinematics import is_closed, is_resting, other
from grasp_ros.exact.records import Candidate, Ends, Tables
from grasp_ros.exact.tolerances import DIED_OUT, LEFT_OUT
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, Slide, Transition, U, V, X

NEVER = Candidate(math.inf, Transition.TOUCH)
NO_SLIDE = Candidate(math.inf, Slide.FREE)


def toward(side: Body, slide: Slide) -> Slide:
    """RIGHTWARD on the left bench, LEFTWARD on its mirror image."""
    mirrored = {Slide.RIGHTWARD: Slide.LEFTWARD, Slide.LEFTWARD: Slide.RIGHTWARD}
    return slide if side == LEFT else mirrored[slide]


# Arrows of a pair: the reset map.


@SIDES
@pytest.mark.parametrize(("kind", "before", "after", "u", "d", "u_after"), [
    (Transition.TOUCH, Pair.OPEN, Pair.CONTACT, 1e-17, 0.3, 0.0),
    (Transition.RELEASE, Pair.CONTACT, Pair.OPEN, -1e-17, -0.3, 0.0),
    (Transition.RELEASE, Pair.CLAMPED, Pair.OPEN, 1e-17, -3.0, 0.0),
    (Transition.RELEASE, Pair.LEAVING, Pair.OPEN, 1e-17, -0.3, 0.0),
    (Transition.CLAMP, Pair.CONTACT, Pair.CLAMPED, 0.01, -2.0, 0.01),
    (Transition.REENTRY, Pair.CLAMPED, Pair.CONTACT, 0.01, -2.0, 0.01),
])
def test_arrow(side: Body, kind: Transition, before: Pair, after: Pair, u: float, d: float, u_after: float) -> None:
    b = bench(side, u, d, before, beside=(0.2, 0.1), beside_mode=Pair.CONTACT)
    make_transition(b.plant, b.state, side, kind, False, b.out)
    assert b.mode(side) is after
    assert bits(b.state.y[U.L + side]) == bits(u_after)
    assert b.events == [(side, kind)]
    assert b.recorded_motion == [(u_after, d)]
    place = b.state.y[velocity_lane(side) - 1]
    assert place == (b.state.y[X.O] if u_after == 0.0 else (u if side == LEFT else -u))
    assert b.mode(other(side)) is Pair.CONTACT
    assert b.state.y[U.L + other(side)] == 0.2


def clamp(b: Bench, side: Body, at: float = 1.0) -> None:
    """What follows when u' of a pair comes to -1/p, at 1 s or later."""
    crossing = Candidate(at, Transition.CLAMP)
    left, right = (crossing, NEVER) if side == LEFT else (NEVER, crossing)
    make_transitions(b.plant, b.state, Ends(left, right, NO_SLIDE, 1.0), 1.0, b.out)


@SIDES
@pytest.mark.parametrize(("beside_mode", "options", "expected"), [
    *((mode, {}, Pair.LEAVING) for mode in (Pair.OPEN, Pair.LEAVING, Pair.RESTING, Pair.ABSENT)),
    *((Pair.OPEN, options, Pair.CLAMPED)
      for options in ({"push": -1.0}, {"push": 1e-9}, {"stiffness": 1e-3}, {"object_push": 1.0})),
])
def test_a_pair_on_the_surface_clamps_if_something_moves_it_and_leaves_without_an_event_otherwise(
    side: Body, beside_mode: Pair, options: dict[str, Any], expected: Pair
) -> None:
    b = bench(side, 0.01, -2.0, Pair.CONTACT, beside_mode=beside_mode, **options)
    clamp(b, side)
    assert b.mode(side) is expected
    assert b.events == ([(side, Transition.CLAMP)] if expected is Pair.CLAMPED else [])


@SIDES
def test_pairs_that_glide_leave_alike(side: Body) -> None:
    """Of two crossings at one instant the first must not decide about the second."""
    b = bench(side, 0.01, -2.0, Pair.CONTACT, beside=(0.01, -2.0 - 1e-14), beside_mode=Pair.CONTACT)
    crossing = Candidate(1.0, Transition.CLAMP)
    make_transitions(b.plant, b.state, Ends(crossing, crossing, NO_SLIDE, 1.0), 1.0, b.out)
    assert (b.mode(side), b.mode(other(side))) == (Pair.CLAMPED, Pair.LEAVING)
    assert b.events == [(side, Transition.CLAMP)]


@SIDES
@pytest.mark.parametrize(("kind", "mode"), [
    *((Transition.TOUCH, mode) for mode in Pair), (Transition.RELEASE, Pair.LEAVING),
])
def test_only_a_touch_turns_back_a_pair_and_only_one_that_leaves(side: Body, kind: Transition, mode: Pair) -> None:
    b = bench(side, 0.0, 0.3, beside=(0.01, -2.0), beside_mode=mode)
    make_transition(b.plant, b.state, side, kind, False, b.out)
    turned = kind is Transition.TOUCH and mode is Pair.LEAVING
    assert b.mode(other(side)) is (Pair.CONTACT if turned else mode)
    assert b.events == [(side, kind)]


@SIDES
@pytest.mark.parametrize("d", [0.0, -1e-9])
def test_a_touch_whose_speed_is_lost_to_rounding_makes_a_pair_at_rest(side: Body, d: float) -> None:
    b = bench(side, 1e-17, d, object_speed=0.3, push=1.0)
    make_transition(b.plant, b.state, side, Transition.TOUCH, False, b.out)
    assert b.mode(side) is Pair.OPEN
    assert is_resting(b.state.y, side)
    assert abs(b.state.y[V.O]) == 0.3
    assert b.events == []
    settle_resting(b.plant, b.state, b.out)
    assert b.events == [(side, Transition.TOUCH)]


def now(b: Bench, left: float, right: float, slide: float) -> Bench:
    """Make the transitions of a segment that ended at 1.0 s, with candidates at these times."""
    candidates = Candidate(left, Transition.TOUCH), Candidate(right, Transition.TOUCH)
    make_transitions(b.plant, b.state, Ends(*candidates, Candidate(slide, Slide.STUCK), 1.0), 1.0, b.out)
    return b


@pytest.mark.parametrize(("times", "met"), [
    ((1.0, 2.0, 2.0), [X.L]), ((2.0, 2.0, 1.0), []), ((2.0, 1.0, 2.0), [X.R]), ((2.0, 2.0, 2.0), [])])
def test_a_touch_puts_the_arm_where_the_object_is_to_the_low_word(times: tuple[float, float, float], met: list[int]
                                                                  ) -> None:
    b = bench(LEFT, 0.0, 1.0, beside=(0.0, 1.0), slide=Slide.RIGHTWARD, coulomb=1.0)
    b.state.low[:] = 1e-20, 2e-20, 3e-20, 4e-20, 5e-20, 6e-20
    expected = b.state.low.copy()
    expected[met] = 3e-20
    if times[2] == 1.0:
        expected[V.O] = 0.0  # it stops
    assert (now(b, *times).state.low == expected).all()


def test_events_within_a_few_roundings_happen_together_and_others_do_not() -> None:
    def both(**options: float) -> Bench:
        return bench(LEFT, 0.0, 0.3, beside=(0.0, 0.3), coulomb=5.0, slide=Slide.RIGHTWARD, **options)

    soon, later = 1.0 + 4e-16, 1.0 + 4e-15
    assert now(both(), 1.0, later, math.inf).events == [(LEFT, Transition.TOUCH)]
    assert now(both(), later, 1.0, math.inf).events == [(RIGHT, Transition.TOUCH)]
    assert now(both(), 1.0, soon, later).events == [(LEFT, Transition.TOUCH), (RIGHT, Transition.TOUCH)]
    assert now(both(), soon, 1.0, math.inf).events == [(LEFT, Transition.TOUCH), (RIGHT, Transition.TOUCH)]
    assert now(both(), later, math.inf, 1.0).events == [(OBJECT, Transition.STICK)]
    assert now(both(), math.inf, math.inf, soon).events == [(OBJECT, Transition.STICK)]
    assert now(both(), math.inf, math.inf, math.inf).events == []


@SIDES
@pytest.mark.parametrize("at", [1.0, 1.0 + 4e-15])
@pytest.mark.parametrize("push", [4.0, 6.0, -6.0])
def test_a_stuck_object_is_asked_again_when_a_pair_has_lost_its_force(side: Body, at: float, push: float) -> None:
    """The rounding of 1e12 N has hidden what pushes it."""
    b = bench(side, 1.0, -2.0, Pair.CONTACT, coulomb=5.0, slide=Slide.STUCK, object_push=push, push=-1.0)
    b.plant.pairs[side, Law.HERTZIAN] = 1e12
    apply_friction(b.plant, b.state.mode)
    clamp(b, side, at)
    clamps = [(side, Transition.CLAMP)] if at == 1.0 else []
    slips = abs(push) > 5.0 and clamps
    assert b.events == clamps + ([(OBJECT, Transition.SLIP)] if slips else [])
    assert b.slide is (toward(side, Slide.RIGHTWARD if push > 0.0 else Slide.LEFTWARD) if slips else Slide.STUCK)


@SIDES
def test_no_event_of_a_pair_asks_a_sliding_object(side: Body) -> None:
    b = bench(side, 1.0, -2.0, Pair.CONTACT, coulomb=5.0, slide=toward(side, Slide.RIGHTWARD), push=-1.0)
    clamp(b, side)
    assert b.events == [(side, Transition.CLAMP)]


@SIDES
@pytest.mark.parametrize(("begin", "expected"), [(0.0, 0.5), (6.0, 0.0)])
def test_a_push_is_certain_since_it_exceeds_its_rounding_or_from_the_begin(
    side: Body, begin: float, expected: float
) -> None:
    """6 N against 5 N, from the begin or from the middle of the step on; what another bit may tell at 0 has no end."""
    b = bench(side, 1.0, -2.0, Pair.CLAMPED, coulomb=5.0, slide=Slide.STUCK)
    row, empty = np.zeros(3), np.zeros(16)
    row[0], row[1] = begin, 10.0 if begin == 0.0 else 0.0
    tables = Tables(np.zeros(3 * LANES), empty, np.zeros(2 * LANES), empty, row)
    found = since_certain(tables, b.plant, b.state.mode, 2, 1.0)
    assert found.what is Slide.RIGHTWARD
    assert found.when > 0.0
    assert found.when == pytest.approx(expected, rel=1e-13, abs=1e-30)


# Consistent initialisation: the mode of a pair from its state.


@SIDES
@pytest.mark.parametrize(("u", "d", "p", "expected"), [
    (-1e-3, 5.0, 0.5, Pair.OPEN),
    (-1e-3, -5.0, 0.5, Pair.OPEN),
    (-5e-324, 0.4, 0.5, Pair.OPEN),
    (1e-3, 5.0, 0.5, Pair.CONTACT),
    (1e-3, -1.9, 0.5, Pair.CONTACT),
    (1e-3, -2.0, 0.5, Pair.CONTACT),  # u' = -1/p for ever belongs to the contact, (10)
    (1e-3, -2.0000001, 0.5, Pair.CLAMPED),
    (1e-3, -1e9, 0.0, Pair.CONTACT),  # p = 0: there is no clamp surface
    (0.0, 0.4, 0.5, Pair.CONTACT),
    (0.0, -0.4, 0.5, Pair.OPEN),
    (0.0, -4.0, 0.5, Pair.OPEN),
])
def test_the_mode_follows_from_the_state(side: Body, u: float, d: float, p: float, expected: Pair) -> None:
    for beside_mode in (Pair.OPEN, Pair.CONTACT):
        b = bench(side, u, d, p=p, beside_mode=beside_mode)
        assert mode_of(b.plant, b.state, side) is expected


@SIDES
def test_a_pair_without_contact_is_absent(side: Body) -> None:
    for u in (-0.1, 0.0, 0.1):
        b = bench(side, u, 0.0, push=1.0, beside_mode=Pair.CONTACT)
        b.plant.pairs[side] = 0.0
        assert mode_of(b.plant, b.state, side) is Pair.ABSENT


PRESSING = {"beside": (0.01, 0.0), "beside_mode": Pair.CONTACT}  # 10 N towards the pair, by the other one


@SIDES
@pytest.mark.parametrize(("speed", "options", "expected"), [
    (-2.0, {"push": 1.0}, Pair.CONTACT),
    (-2.0, {"push": -1.0}, Pair.CLAMPED),
    (-2.0, {"push": 1.0, "object_push": 2.0}, Pair.CLAMPED),
    (-2.0, {"push": -1.0, **PRESSING}, Pair.CONTACT),
    (-2.0, {"push": -11.0, **PRESSING}, Pair.CLAMPED),
    (math.nextafter(-2.0, 0.0), {"push": -1.0}, Pair.CLAMPED),  # within rounding the speed decides nothing
    (math.nextafter(-2.0, -9.0), {"push": 1.0}, Pair.CONTACT),
    (-2.0 + 1e-14, {"push": -1.0}, Pair.CONTACT),
    (-2.0 - 1e-14, {"push": 1.0}, Pair.CLAMPED),
])
def test_on_the_surface_what_moves_u_rate_decides(
    side: Body, speed: float, options: dict[str, Any], expected: Pair
) -> None:
    b = bench(side, 0.01, speed, **options)
    assert mode_of(b.plant, b.state, side) is expected


def test_the_rounding_on_the_surface_is_that_of_the_velocities() -> None:
    """Both bodies at 1e6 m/s: u' = -2 m/s has an error of 1e-10."""
    b = bench(LEFT, 0.01, -2.0 + 1e-10, push=-1.0, object_speed=1e6)
    assert mode_of(b.plant, b.state, LEFT) is Pair.CLAMPED


@SIDES
@pytest.mark.parametrize(("options", "expected"), [
    ({"push": 1.0}, Pair.CONTACT),  # pressed together
    ({"push": 1.0, "object_push": 0.5}, Pair.CONTACT),
    ({"object_push": -1.0}, Pair.CONTACT),
    ({"push": -1.0}, Pair.OPEN),  # pulled apart
    ({"push": 0.5, "object_push": 1.0}, Pair.OPEN),
    ({}, Pair.RESTING),  # nothing differs
    ({"push": 1.0, "object_push": 1.0}, Pair.RESTING),
    ({"object_speed": 0.3, "stiffness": 2.0}, Pair.OPEN),  # order 3: the spring brakes the arm
    ({"object_speed": -0.3, "stiffness": 2.0}, Pair.CONTACT),
    ({"push": 1.0, "object_push": 1.0, "stiffness": 2.0}, Pair.OPEN),  # order 4
    ({"push": -1.0, "object_push": -1.0, "stiffness": 2.0}, Pair.CONTACT),
    ({**PRESSING}, Pair.CONTACT),  # the other pair presses with 10 N
    ({"push": -9.0, **PRESSING}, Pair.CONTACT),
    ({"push": -11.0, **PRESSING}, Pair.OPEN),
    ({"push": -10.0, "p": 0.0, "beside": (0.01, 0.2), "beside_mode": Pair.CONTACT}, Pair.CONTACT),  # ever more
    ({"push": -10.0, "p": 0.0, "beside": (0.01, -0.2), "beside_mode": Pair.CONTACT}, Pair.OPEN),
    ({"beside": (0.01, -9.0), "beside_mode": Pair.CLAMPED}, Pair.RESTING),  # no force
    ({"beside": (0.0, 0.3), "beside_mode": Pair.CONTACT}, Pair.CONTACT),  # it has just touched: order 3.5
    ({"push": -1.0, "beside": (0.0, 0.3), "beside_mode": Pair.CONTACT}, Pair.OPEN),  # order 2 comes before
    ({"object_speed": 0.3, "stiffness": 2.0, "beside": (0.0, 0.3), "beside_mode": Pair.CONTACT}, Pair.OPEN),
    ({"push": 1.0, "object_push": 1.0, "stiffness": 2.0, "beside": (0.0, 0.3), "beside_mode": Pair.CONTACT},
     Pair.CONTACT),  # order 4 is its own, and comes behind order 3.5
])
def test_at_rest_at_zero_the_first_derivative_that_differs_decides(
    side: Body, options: dict[str, Any], expected: Pair
) -> None:
    b = bench(side, 0.0, 0.0, **options)
    assert mode_of(b.plant, b.state, side) is expected


@SIDES
def test_a_pair_at_rest_on_a_stuck_object_feels_its_own_arm_alone(side: Body) -> None:
    for push, expected in ((1.0, Pair.CONTACT), (-1.0, Pair.OPEN), (0.0, Pair.RESTING)):
        b = bench(side, 0.0, 0.0, push=push, slide=Slide.STUCK, **PRESSING)
        b.plant.bodies[OBJECT, Of.MASS], b.plant.bodies[OBJECT, Of.FORCE] = math.inf, 0.0
        assert mode_of(b.plant, b.state, side) is expected


@SIDES
@pytest.mark.parametrize(("own", "beside", "push", "expected"), [
    ((0.0, 0.0), (0.0, 0.4), 0.0, (Pair.CONTACT, Pair.CONTACT)),  # at rest it follows the other one
    ((0.0, 0.0), (0.0, -0.4), 0.0, (Pair.RESTING, Pair.OPEN)),
    ((0.0, 0.0), (0.0, 0.0), 0.0, (Pair.RESTING, Pair.RESTING)),
    ((0.0, 0.0), (0.0, 0.0), 1.0, (Pair.CONTACT, Pair.CONTACT)),
    ((0.0, 0.0), (0.0, 0.0), -1.0, (Pair.OPEN, Pair.RESTING)),
    ((-0.1, 0.0), (0.05, 0.2), 0.0, (Pair.OPEN, Pair.CONTACT)),
    ((0.1, 0.0), (0.05, 0.2), 0.0, (Pair.CONTACT, Pair.CONTACT)),
    ((0.1, -9.0), (0.05, 0.2), 0.0, (Pair.CLAMPED, Pair.CONTACT)),
])
def test_initial_modes_of_two_pairs(
    side: Body, own: tuple[float, float], beside: tuple[float, float], push: float, expected: tuple[Pair, Pair]
) -> None:
    """Whichever side is judged first."""
    b = bench(side, *own, beside=beside, push=push)
    initial_modes(b.plant, b.state)
    assert (b.mode(side), b.mode(other(side))) == expected


# The object under dry friction.


@SIDES
@pytest.mark.parametrize(("speed", "push", "expected"), [
    (0.1, 0.0, Slide.RIGHTWARD), (0.1, -9.0, Slide.RIGHTWARD), (-0.1, 0.0, Slide.LEFTWARD),
    (0.0, 0.0, Slide.STUCK), (0.0, 5.0, Slide.STUCK), (0.0, -5.0, Slide.STUCK),
    (0.0, 5.0 + 1e-14, Slide.STUCK), (0.0, -5.0 - 1e-14, Slide.STUCK),  # within rounding
    (0.0, 5.0 + 1e-12, Slide.RIGHTWARD), (0.0, -5.0 - 1e-12, Slide.LEFTWARD),
])
def test_the_slide_follows_from_the_state(side: Body, speed: float, push: float, expected: Slide) -> None:
    b = bench(side, -1.0, 0.0, coulomb=5.0, object_speed=speed, object_push=push)
    initial_slide(b.plant, b.state)
    assert b.slide is toward(side, expected) if expected is not Slide.STUCK else b.slide is Slide.STUCK
    sign = 1.0 if side == LEFT else -1.0  # to the right
    friction = {Slide.RIGHTWARD: -5.0, Slide.LEFTWARD: 5.0}
    mass, force = (math.inf, 0.0) if expected is Slide.STUCK else (1.0, sign * (push + friction[expected]))
    assert (b.plant.bodies[OBJECT, Of.MASS], b.plant.bodies[OBJECT, Of.FORCE]) == (mass, force)
    assert (b.plant.given[OBJECT, Of.MASS], b.plant.given[OBJECT, Of.FORCE]) == (1.0, sign * push)


@SIDES
def test_an_impact_force_can_move_an_object_at_rest(side: Body) -> None:
    """1e4 (0.01)^(3/2) = 10 N against 5 N; half of it is held, and a pair without force does not push."""
    for u, mode, expected in (
        (0.01, Pair.CONTACT, toward(side, Slide.RIGHTWARD)), (0.005, Pair.CONTACT, Slide.STUCK),
        (0.01, Pair.CLAMPED, Slide.STUCK),
    ):
        b = bench(side, u, 0.0, mode, coulomb=5.0)
        initial_slide(b.plant, b.state)
        assert b.slide is expected


def test_without_dry_friction_the_object_is_free() -> None:
    b = bench(LEFT, -1.0, 0.0, object_push=3.0, object_speed=1.0)
    initial_slide(b.plant, b.state)
    assert b.slide is Slide.FREE
    assert bits(b.plant.bodies) == bits(b.plant.given)


@SIDES
@pytest.mark.parametrize(("before", "push", "to", "after", "event"), [
    (Slide.RIGHTWARD, 4.0, Slide.STUCK, Slide.STUCK, Transition.STICK),
    (Slide.RIGHTWARD, -6.0, Slide.STUCK, Slide.LEFTWARD, None),  # it turns without a rest
    (Slide.STUCK, -5.5, Slide.LEFTWARD, Slide.LEFTWARD, Transition.SLIP),
    (Slide.STUCK, -5.0 * (1.0 - 1e-9), Slide.LEFTWARD, Slide.STUCK, None),  # the series foresaw it too early
])
def test_a_slide_begins_and_ends_as_its_force_says(
    side: Body, before: Slide, push: float, to: Slide, after: Slide, event: Transition | None
) -> None:
    """5 N of friction; a series has the error of the accuracy."""
    to, after = (own if own is Slide.STUCK else toward(side, own) for own in (to, after))
    if before is Slide.STUCK:
        b = bench(side, -1.0, 0.0, coulomb=5.0, slide=before, object_push=push)
        b.plant.bodies[OBJECT, Of.MASS] = math.inf
    else:
        b = bench(side, -1.0, 0.0, coulomb=5.0, slide=toward(side, before), object_push=push, object_speed=1e-17)
    make_slide_transition(b.plant, b.state, to, b.out)
    assert b.slide is after
    assert b.state.y[V.O] == 0.0
    assert b.plant.bodies[OBJECT, Of.MASS] == (math.inf if after is Slide.STUCK else 1.0)
    assert after is Slide.STUCK or abs(b.plant.bodies[OBJECT, Of.FORCE]) == pytest.approx(abs(push) - 5.0)
    assert b.events == ([] if event is None else [(OBJECT, event)])


# The begin of an interval: inputs may change.


def begin(b: Bench) -> Bench:
    """Begin an interval, as far as its first segment."""
    begin_interval(b.plant, b.state, b.out)
    settle_resting(b.plant, b.state, b.out)
    return b


@SIDES
@pytest.mark.parametrize(("u", "d", "options", "expected", "slide", "events"), [
    (0.0, 0.0, {"beside": (0.01, 0.0), "push": 1.0, "coulomb": 50.0}, Pair.CONTACT, Slide.STUCK, [Transition.TOUCH]),
    (-1.0, 0.0, {"slide": Slide.STUCK}, Pair.OPEN, Slide.FREE, []),  # it forgets the slide of another one
    (0.0, 0.0, {"push": 1.0, "object_push": 2.0}, Pair.OPEN, Slide.FREE, []),  # the object runs away from the arm
    (0.0, 0.0, {"push": 1.0, "object_push": 2.0, "coulomb": 5.0}, Pair.CONTACT, Slide.STUCK, [Transition.TOUCH]),
    (0.01, -2.0, {"object_push": 2.0, "object_speed": 1.0}, Pair.CLAMPED, Slide.FREE, []),  # it leaves the arm behind
    (0.01, -2.0, {"object_push": 2.0, "object_speed": 1.0, "coulomb": 5.0}, Pair.CONTACT, Slide.RIGHTWARD, []),
    (0.01, 0.0, {"coulomb": 5.0}, Pair.CONTACT, Slide.RIGHTWARD, []),  # an impact pushes it with 10 N
])
def test_a_run_starts_as_its_state_and_its_friction_say(
    side: Body, u: float, d: float, options: dict[str, Any], expected: Pair, slide: Slide, events: list[Transition]
) -> None:
    b = begin(bench(side, u, d, Pair.UNKNOWN, beside_mode=Pair.UNKNOWN, **options))
    assert (b.mode(side), b.mode(other(side))) == (expected, Pair.CONTACT if "beside" in options else Pair.OPEN)
    assert b.slide is (toward(side, slide) if slide is Slide.RIGHTWARD else slide)
    assert b.events == [(side, event) for event in events]


@SIDES
@pytest.mark.parametrize(("u", "d", "mode", "options", "expected", "event"), [
    *((0.0, 0.0, mode, {"push": push}, after, event) for mode in (Pair.OPEN, Pair.RESTING) for push, after, event in (
        (1.0, Pair.CONTACT, Transition.TOUCH), (0.0, Pair.RESTING, None), (-1.0, Pair.OPEN, None))),
    (0.0, 0.0, Pair.CONTACT, {"push": -1.0}, Pair.OPEN, Transition.RELEASE),
    (0.0, 0.0, Pair.CONTACT, {}, Pair.RESTING, Transition.RELEASE),
    (0.0, 0.0, Pair.CONTACT, {"push": 1.0}, Pair.CONTACT, None),
    *((u, d, mode, {"push": -1.0}, mode, None) for u, d, mode in (  # in motion
        (0.0, -0.3, Pair.CONTACT), (0.0, 0.3, Pair.CONTACT), (1e-9, 0.0, Pair.CONTACT), (-1e-9, 0.3, Pair.OPEN),
        (1e-9, -9.0, Pair.CLAMPED), (1e-9, -0.3, Pair.CONTACT))),
    (0.01, -2.0 - 1e-14, Pair.LEAVING, {}, Pair.LEAVING, None),
    (0.01, -2.0 + 1e-14, Pair.LEAVING, {}, Pair.LEAVING, None),
    (0.01, -2.0 - 1e-9, Pair.LEAVING, {}, Pair.CLAMPED, Transition.CLAMP),
    (0.01, -2.0 + 1e-9, Pair.LEAVING, {}, Pair.CONTACT, None),
    (0.01, -2.0, Pair.LEAVING, {"push": 1.0}, Pair.CONTACT, None),
    (0.01, -2.0, Pair.LEAVING, {"push": -1.0}, Pair.CLAMPED, Transition.CLAMP),
])
def test_what_a_tick_makes_of_a_pair(side: Body, u: float, d: float, mode: Pair, options: dict[str, float],
                                     expected: Pair, event: Transition | None) -> None:
    b = begin(bench(side, u, d, mode, **options))  # type: ignore[arg-type]
    assert b.mode(side) is expected
    assert b.events == ([] if event is None else [(side, event)])


@SIDES
def test_pairs_that_approach_do_not_leave(side: Body) -> None:
    both = (1e-20, 1e-9)
    b = bench(side, *both, Pair.CONTACT, beside=both, beside_mode=Pair.CONTACT, push=-100.0, beside_push=100.0)
    let_leave(b.plant, b.state, b.settings)
    assert (b.mode(side), b.mode(other(side))) == (Pair.CONTACT, Pair.CONTACT)


@SIDES
def test_pairs_that_leave_are_in_contact_again_when_inputs_may_change(side: Body) -> None:
    b = begin(bench(side, 1e-9, -0.3, Pair.LEAVING, beside=(1e-9, -9.0), beside_mode=Pair.LEAVING))
    assert (b.mode(side), b.mode(other(side))) == (Pair.CONTACT, Pair.CLAMPED)
    assert b.events == [(other(side), Transition.CLAMP)]


@SIDES
def test_a_pair_that_is_pushed_back_pushes_back_the_other_one(side: Body) -> None:
    """Both glide, and an input presses only one arm; the object that it pushes comes towards the other one."""
    glides = (0.01, -2.0)
    b = begin(bench(side, *glides, Pair.LEAVING, beside=glides, beside_mode=Pair.LEAVING, beside_push=-1.0))
    assert (b.mode(side), b.mode(other(side)), b.events) == (Pair.CONTACT, Pair.CONTACT, [])


@SIDES
@pytest.mark.parametrize(("before", "options", "after", "event"), [
    (Slide.STUCK, {"object_push": 6.0}, Slide.RIGHTWARD, Transition.SLIP),
    (Slide.STUCK, {"object_push": 4.0}, Slide.STUCK, None),
    (Slide.STUCK, {"object_speed": 1.0}, Slide.RIGHTWARD, Transition.SLIP),
    (Slide.RIGHTWARD, {"object_speed": 1.0}, Slide.RIGHTWARD, None),
    (Slide.RIGHTWARD, {"object_push": 4.0}, Slide.STUCK, Transition.STICK),  # held at its turn
])
def test_what_a_tick_makes_of_an_object(side: Body, before: Slide, options: dict[str, float], after: Slide,
                                        event: Transition | None) -> None:
    """5 N of friction."""
    before, after = (own if own is Slide.STUCK else toward(side, own) for own in (before, after))
    b = begin(bench(side, -1.0, 0.0, coulomb=5.0, slide=before, **options))  # type: ignore[arg-type]
    assert b.slide is after
    assert b.events == ([] if event is None else [(OBJECT, event)])


@SIDES
def test_an_interval_that_goes_on_keeps_its_modes(side: Body) -> None:
    b = bench(side, 1e-9, -0.3, Pair.LEAVING, push=1.0, coulomb=5.0, slide=Slide.STUCK, object_push=6.0, time=0.5)
    b.plant.bodies[:] = np.nan
    begin(b)
    assert (b.mode(side), b.slide, b.events) == (Pair.LEAVING, Slide.STUCK, [])
    assert b.plant.bodies[OBJECT, Of.MASS] == math.inf
    assert bits(b.plant.bodies[side]) == bits(b.plant.given[side])


# Rules between segments.


@SIDES
@pytest.mark.parametrize(("u", "d", "mode", "options", "expected"), [
    (0.0, 0.0, Pair.OPEN, {"push": 1.0}, Pair.CONTACT),
    (0.0, 0.0, Pair.RESTING, {"push": 1.0}, Pair.CONTACT),
    *((u, d, mode, {"push": 1.0}, mode) for u, d, mode in (
        (-1e-9, 0.0, Pair.OPEN), (0.0, -1e-9, Pair.OPEN), (0.0, 0.0, Pair.ABSENT), (0.0, 0.0, Pair.LEAVING),
        (0.0, 0.0, Pair.CONTACT))),
    (1e-17, -0.3, Pair.OPEN, {"beside": (0.0, 0.0)}, Pair.OPEN),  # u is rounding: `mode_of` would call it a contact
    *((0.0, 0.0, mode, {"beside_mode": beside_mode, "beside": beside}, expected)
      for mode in (Pair.OPEN, Pair.RESTING) for beside_mode, beside, expected in (
        (Pair.CONTACT, (0.01, 0.1), Pair.CONTACT), (Pair.CONTACT, (0.0, 0.1), Pair.CONTACT),
        (Pair.CLAMPED, (0.01, -9.0), Pair.RESTING), (Pair.OPEN, (-0.1, 0.1), Pair.RESTING))),
])
def test_only_a_pair_at_rest_without_force_settles(
    side: Body, u: float, d: float, mode: Pair, options: dict[str, Any], expected: Pair
) -> None:
    """By its input, or by what the other one begins to push."""
    b = bench(side, u, d, mode, **options)
    settle_resting(b.plant, b.state, b.out)
    touches = expected is Pair.CONTACT is not mode
    assert b.mode(side) is expected
    assert b.events == ([(side, Transition.TOUCH)] if touches else [])
    assert b.recorded_motion == ([(0.0, 0.0)] if touches else [])


@SIDES
@pytest.mark.parametrize(("u", "d", "rests"), [(0.0, 0.0, True), (0.0, 1e-300, False), (-1e-300, 0.0, False)])
def test_a_pair_at_rest_is_one_at_zero_without_speed(side: Body, u: float, d: float, rests: bool) -> None:
    assert is_resting(bench(side, u, d).state.y, side) == rests


def test_a_closed_pair_is_between_its_touch_and_its_release() -> None:
    closed = {Pair.CONTACT, Pair.BEGINNING, Pair.CLAMPED, Pair.LEAVING}
    assert {mode for mode in Pair if is_closed(mode)} == closed


@SIDES
def test_a_resting_pair_is_pressed_by_a_resting_one(side: Body) -> None:
    """The first presses the second, whichever is judged first."""
    b = bench(side, 0.0, 0.0, Pair.RESTING, beside=(0.0, 0.0), beside_mode=Pair.RESTING, push=1.0)
    settle_resting(b.plant, b.state, b.out)
    assert (b.mode(side), b.mode(other(side))) == (Pair.CONTACT, Pair.CONTACT)
    assert sorted(b.events) == [(LEFT, Transition.TOUCH), (RIGHT, Transition.TOUCH)]


def depth(d: float) -> float:
    """u of the pair on the bench at which the impulse that is left is what `let_leave` may leave out, m."""
    return float((LEFT_OUT * TOLERANCE * 0.5 * d * d / (1e4 * (1.0 + 0.5 * d))) ** 0.4)


STAY, LEAVING = ((mode, mode) for mode in (Pair.CONTACT, Pair.LEAVING))


U_SOON = 0.5 * depth(1e-4)  # m


@SIDES
@pytest.mark.parametrize(("u", "d", "beside", "options", "expected"), [
    (0.1, -0.3, (0.1, -0.3), {}, LEAVING), (0.9, -0.3, (0.1, -0.3), {}, LEAVING),
    (0.9, -0.3, (0.9, -1.3), {}, LEAVING), (0.0, -0.3, (0.1, -0.3), {}, LEAVING),
    (1.1, -0.3, (0.1, -0.3), {}, STAY),
    (0.1, -0.3, (0.1, 0.3), {}, STAY),  # one goes, one comes
    (0.0, 0.3, (0.0, 0.3), {}, STAY),  # both touch at once
    (0.0, 0.0, (0.1, -0.3), {}, STAY), (0.0, 0.0, (0.0, 0.0), {}, STAY),
    # an object at rest that slips needs the force that lets it: without it friction would push it
    *((0.1, -0.3, (0.1, -0.3), {"slide": slide, "coulomb": 1e-9, "object_speed": speed}, expected)
      for slide in (Slide.RIGHTWARD, Slide.LEFTWARD) for speed, expected in ((0.0, STAY), (0.5, LEAVING))),
    # 20 u |u''| beside u'^2: a push that turns it before u = 0 keeps it in contact
    *((0.5, -1e-4, (0.5, -1e-4), {"push": push}, expected)
      for push, expected in ((0.0, LEAVING), (1e9, STAY), (-1e9, STAY))),
    *((0.5, -1e-4, (0.5, -1e-4), {"stiffness": part * (1e-4 / U_SOON) ** 2, "push": part * 1e-8 / U_SOON}, expected)
      for part, expected in ((1e2, STAY), (1e-2, LEAVING))),  # a spring that a push balances
])
def test_both_pairs_leave_together(
    side: Body, u: float, d: float, beside: tuple[float, float], options: dict[str, Any], expected: tuple[Pair, Pair]
) -> None:
    """u in units of `depth`."""
    far = (beside[0] * depth(abs(beside[1])), beside[1])
    b = bench(side, u * depth(abs(d)), d, Pair.CONTACT, beside=far, beside_mode=Pair.CONTACT, **options)
    let_leave(b.plant, b.state, b.settings)
    assert (b.mode(side), b.mode(other(side))) == expected
    assert b.events == []


@SIDES
@pytest.mark.parametrize("beside_mode", [Pair.OPEN, Pair.LEAVING, Pair.RESTING, Pair.CLAMPED, Pair.ABSENT])
def test_one_pair_alone_does_not_leave_without_its_force(side: Body, beside_mode: Pair) -> None:
    b = bench(side, 0.1 * depth(0.3), -0.3, Pair.CONTACT, beside=(0.1 * depth(0.3), -0.3), beside_mode=beside_mode)
    let_leave(b.plant, b.state, b.settings)
    assert (b.mode(side), b.mode(other(side))) == (Pair.CONTACT, beside_mode)


@SIDES
@pytest.mark.parametrize("mode", [Pair.OPEN, Pair.CONTACT])
@pytest.mark.parametrize(("u", "d", "dead"), [
    (0.5, -0.5, True), (0.5, 0.0, True), (0.0, 0.5, True), (-0.5, 0.0, True),
    (1.5, 0.5, False), (0.5, 1.5, False), (-1.5, 0.5, False), (0.5, -1.5, False),
])
def test_a_pair_whose_motion_has_died_out_rests(side: Body, mode: Pair, u: float, d: float, dead: bool) -> None:
    """u and u' are parts of what they may be."""
    b = bench(side, DIED_OUT * u, DIED_OUT * d, mode)
    before = b.state.y.copy()
    settle_pairs(b.plant, b.state, b.settings, b.out)
    assert b.mode(side) is (Pair.RESTING if dead else mode)
    assert bool(is_resting(b.state.y, side)) is dead
    assert dead or b.state.y.tobytes() == before.tobytes()


@SIDES
def test_an_arm_that_touches_nothing_moves_on_however_little(side: Body) -> None:
    b = bench(side, 0.5 * DIED_OUT, 0.5 * DIED_OUT, Pair.ABSENT)
    before = b.state.y.copy()
    settle_pairs(b.plant, b.state, b.settings, b.out)
    assert b.state.y.tobytes() == before.tobytes()


@SIDES
@pytest.mark.parametrize(("d", "mode", "options", "expected"), [
    (-2.0, Pair.CONTACT, {}, Pair.LEAVING), (-1.0, Pair.CONTACT, {}, Pair.CONTACT),
    (-2.0, Pair.CONTACT, {"push": 1.0}, Pair.CONTACT),
    *((-2.0, mode, {}, mode) for mode in Pair if mode is not Pair.CONTACT),
])
def test_only_a_pair_in_contact_that_nothing_moves_leaves_alone(
    side: Body, d: float, mode: Pair, options: dict[str, Any], expected: Pair
) -> None:
    b = bench(side, 0.01, d, mode, **options)
    let_leave(b.plant, b.state, b.settings)
    assert (b.mode(side), b.mode(other(side)), b.events) == (expected, Pair.OPEN, [])


# Pairs that begin without their force.


@SIDES
def test_pairs_begin_alike(side: Body) -> None:
    """Each of two that touch at once begins because the other one does."""
    alone, both = bench(side, 0.0, 0.0, Pair.CONTACT), bench(side, 0.0, 0.3, Pair.CONTACT, beside=(0.0, 0.1),
                                                             beside_mode=Pair.CONTACT)
    for b, expected in ((alone, Pair.OPEN), (both, Pair.BEGINNING)):
        begin_contacts(b.state)
        assert (b.mode(side), b.mode(other(side)), b.events) == (Pair.BEGINNING, expected, [])


@SIDES
@pytest.mark.parametrize(("u", "d", "mode", "expected"), [
    (1e-30, 0.1, Pair.BEGINNING, Pair.CONTACT), (1e-30, -0.1, Pair.BEGINNING, Pair.CONTACT),
    (1e-30, 0.0, Pair.BEGINNING, Pair.CONTACT), (0.0, 0.1, Pair.BEGINNING, Pair.CONTACT),
    (0.0, 0.0, Pair.BEGINNING, Pair.BEGINNING),
    (0.0, -0.1, Pair.BEGINNING, Pair.OPEN), (-1e-30, 0.1, Pair.BEGINNING, Pair.OPEN),
    (1e-9, 0.1, Pair.LEAVING, Pair.LEAVING), (-1e-9, 0.1, Pair.OPEN, Pair.OPEN)])
def test_a_pair_that_has_begun_is_in_contact_or_has_come_back(side: Body, u: float, d: float, mode: Pair, expected: Pair
                                                              ) -> None:
    b = bench(side, u, d, mode)
    end_begin(b.state, side, b.out)
    assert (b.mode(side), b.mode(other(side))) == (expected, Pair.OPEN)
    released = mode is Pair.BEGINNING and expected is Pair.OPEN
    assert b.events == ([(side, Transition.RELEASE)] if released else [])


@SIDES
def test_a_segment_begins_with_every_rule_for_pairs(side: Body) -> None:
    for b, expected, events in (
        (bench(side, 0.0, 0.0, push=1.0), Pair.BEGINNING, [(side, Transition.TOUCH)]),  # pressed from rest
        (bench(side, 1e-30, 0.1, Pair.BEGINNING), Pair.CONTACT, []),
        (bench(side, 0.01, -2.0, Pair.CONTACT), Pair.LEAVING, []),
    ):
        settle_pairs(b.plant, b.state, b.settings, b.out)
        assert (b.mode(side), b.mode(other(side)), b.events) == (expected, Pair.OPEN, events)

"""The automaton: one direct test per arrow, left and right, and per corner rule.

`mutants.py` deletes and negates every branch of `grasp_ros.exact.modes` and expects a test of this file to fail.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from exact.bench import Bench, bench, bits

from grasp_ros.exact.kinematics import other
from grasp_ros.exact.modes import (
    begin_interval,
    close_resting_pair,
    end_ballistic,
    initial_modes,
    initial_slide,
    is_ballistic,
    leaning,
    leave_corner,
    make_slide_transition,
    make_transition,
    make_transitions,
    mode_of,
)
from grasp_ros.exact.records import Candidate, SlideCandidate
from grasp_ros.exact.scales import scales, sliver
from grasp_ros.physics.layout import FORCE, LEFT, MASS, OBJECT, RIGHT, U_L, V_O, Body, Pair, Slide, Transition

SIDES = pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
NEVER = Candidate(math.inf, Transition.TOUCH)
NO_SLIDE = SlideCandidate(math.inf, Slide.FREE)


def toward(side: Body, slide: Slide) -> Slide:
    """RIGHTWARD on the left bench, LEFTWARD on its mirror image."""
    mirrored = {Slide.RIGHTWARD: Slide.LEFTWARD, Slide.LEFTWARD: Slide.RIGHTWARD}
    return slide if side == LEFT else mirrored[slide]


# Arrows of a pair: the reset map.


@SIDES
@pytest.mark.parametrize(
    ("kind", "before", "after", "u", "d", "u_after"),
    [
        (Transition.TOUCH, Pair.OPEN, Pair.CONTACT, 1e-17, 0.3, 0.0),
        (Transition.RELEASE, Pair.CONTACT, Pair.OPEN, -1e-17, -0.3, 0.0),
        (Transition.RELEASE, Pair.CLAMPED, Pair.OPEN, 1e-17, -3.0, 0.0),
        (Transition.RELEASE, Pair.LEAVING, Pair.OPEN, 1e-17, -0.3, 0.0),
        (Transition.CLAMP, Pair.CONTACT, Pair.CLAMPED, 0.01, -2.0, 0.01),
        (Transition.REENTRY, Pair.CLAMPED, Pair.CONTACT, 0.01, -2.0, 0.01),
    ],
)
def test_arrow(side: Body, kind: Transition, before: Pair, after: Pair, u: float, d: float, u_after: float) -> None:
    b = bench(side, u, d, before, beside=(0.2, 0.1), beside_mode=Pair.CONTACT)
    make_transition(b.state, side, kind, b.out)
    assert b.mode(side) is after
    assert bits(b.state.y[U_L + side]) == bits(u_after)
    assert b.events == [(side, kind)]
    assert b.recorded_motion == [(u_after, d)]
    assert b.mode(other(side)) is Pair.CONTACT
    assert b.state.y[U_L + other(side)] == 0.2


@SIDES
@pytest.mark.parametrize("d", [0.0, -1e-9])
def test_a_touch_that_rounding_invents_is_no_event(side: Body, d: float) -> None:
    b = bench(side, 1e-17, d)
    make_transition(b.state, side, Transition.TOUCH, b.out)
    assert b.mode(side) is Pair.OPEN
    assert b.state.y[U_L + side] == 0.0
    assert b.events == []


def now(b: Bench, left: float, right: float, slide: float) -> Bench:
    """Make the transitions of a segment that ended at 1.0 s, with candidates at these times."""
    candidates = Candidate(left, Transition.TOUCH), Candidate(right, Transition.TOUCH)
    make_transitions(b.plant, b.state, *candidates, SlideCandidate(slide, Slide.STUCK), 1.0, b.out)
    return b


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


# Consistent initialisation: the mode of a pair from its state.


@SIDES
@pytest.mark.parametrize(
    ("u", "d", "p", "expected"),
    [
        (-1e-3, 5.0, 0.5, Pair.OPEN),
        (-1e-3, -5.0, 0.5, Pair.OPEN),
        (-5e-324, 0.4, 0.5, Pair.OPEN),
        (1e-3, 5.0, 0.5, Pair.CONTACT),
        (1e-3, -1.9, 0.5, Pair.CONTACT),
        (1e-3, -2.0, 0.5, Pair.CONTACT),  # u' = -1/p exactly belongs to the contact, (10)
        (1e-3, -2.0000001, 0.5, Pair.CLAMPED),
        (1e-3, -1e9, 0.0, Pair.CONTACT),  # p = 0: there is no second surface
        (0.0, 0.4, 0.5, Pair.CONTACT),
        (0.0, -0.4, 0.5, Pair.OPEN),
        (0.0, -4.0, 0.5, Pair.OPEN),
    ],
)
def test_the_mode_follows_from_the_state(side: Body, u: float, d: float, p: float, expected: Pair) -> None:
    for beside_mode in (Pair.OPEN, Pair.CONTACT):
        b = bench(side, u, d, p=p, beside_mode=beside_mode)
        assert mode_of(b.plant, b.state, b.settings, side) is expected


@SIDES
def test_a_pair_without_contact_is_absent(side: Body) -> None:
    for u in (-0.1, 0.0, 0.1):
        b = bench(side, u, 0.0, push=1.0, beside_mode=Pair.CONTACT)
        b.plant.pairs[side] = 0.0
        assert mode_of(b.plant, b.state, b.settings, side) is Pair.ABSENT


@SIDES
@pytest.mark.parametrize(
    ("push", "object_push", "beside_contact", "expected"),
    [
        (1.0, 0.0, False, Pair.BALLISTIC),  # pressed together
        (1.0, 0.5, False, Pair.BALLISTIC),
        (0.0, -1.0, False, Pair.BALLISTIC),
        (-1.0, 0.0, False, Pair.OPEN),  # pulled apart
        (-1.0, 0.0, True, Pair.OPEN),
        (0.5, 1.0, True, Pair.OPEN),
        (1.0, 1.0, False, Pair.OPEN),  # both alike: it follows the other pair
        (1.0, 1.0, True, Pair.BALLISTIC),
        (0.0, 0.0, False, Pair.OPEN),
        (0.0, 0.0, True, Pair.BALLISTIC),
    ],
)
def test_at_rest_at_zero_the_first_derivative_that_differs_decides(
    side: Body, push: float, object_push: float, beside_contact: bool, expected: Pair
) -> None:
    beside_mode = Pair.CONTACT if beside_contact else Pair.CLAMPED
    b = bench(side, 0.0, 0.0, push=push, object_push=object_push, beside_mode=beside_mode)
    assert mode_of(b.plant, b.state, b.settings, side) is expected


@SIDES
def test_leaning_is_what_u_will_be_and_nothing_within_rounding(side: Body) -> None:
    t = 1.0  # nothing sets a rate
    assert leaning(*lean_arguments(bench(side, 0.0, 0.0, push=2.0, object_push=0.5), side)) == pytest.approx(0.75 * t)
    assert leaning(*lean_arguments(bench(side, 0.0, 0.0, push=0.5, object_push=2.0), side)) == pytest.approx(-0.75 * t)
    assert leaning(*lean_arguments(bench(side, 0.0, 0.0, push=1.0, object_push=1.0 + 4e-16), side)) == 0.0
    assert leaning(*lean_arguments(bench(side, 0.0, 0.0, push=1.0, object_push=1.0 + 4e-15), side)) < 0.0


def lean_arguments(b: Bench, side: Body) -> tuple[object, ...]:
    """What `leaning` takes."""
    return b.plant, b.state.y, b.settings, side


@SIDES
def test_initial_modes_of_a_chain(side: Body) -> None:
    """A pair at rest at u = 0 on which nothing acts follows the other one, whichever side is judged first."""
    for rate, beside, expected in (
        (0.4, Pair.CONTACT, Pair.BALLISTIC), (-0.4, Pair.OPEN, Pair.OPEN), (0.0, Pair.OPEN, Pair.OPEN)
    ):
        b = bench(side, 0.0, 0.0, beside=(0.0, rate))
        b.state.y[V_O] = 0.0
        initial_modes(b.plant, b.state, b.settings)
        assert (b.mode(side), b.mode(other(side))) == (expected, beside)


@SIDES
def test_initial_modes_leave_a_decided_pair_alone(side: Body) -> None:
    for u, d, expected in ((-0.1, 0.0, Pair.OPEN), (0.1, 0.0, Pair.CONTACT), (0.1, -9.0, Pair.CLAMPED)):
        b = bench(side, u, d, beside=(0.05, 0.2))
        initial_modes(b.plant, b.state, b.settings)
        assert (b.mode(side), b.mode(other(side))) == (expected, Pair.CONTACT)


# The object under dry friction.


@SIDES
@pytest.mark.parametrize(
    ("speed", "push", "expected"),
    [
        (0.1, 0.0, Slide.RIGHTWARD), (0.1, -9.0, Slide.RIGHTWARD), (-0.1, 0.0, Slide.LEFTWARD),
        (0.0, 0.0, Slide.STUCK), (0.0, 5.0, Slide.STUCK), (0.0, -5.0, Slide.STUCK),
        (0.0, 5.1, Slide.RIGHTWARD), (0.0, -5.1, Slide.LEFTWARD),
    ],
)
def test_the_slide_follows_from_the_state(side: Body, speed: float, push: float, expected: Slide) -> None:
    b = bench(side, -1.0, 0.0, coulomb=5.0, object_speed=speed, object_push=push)
    initial_slide(b.plant, b.state)
    assert b.slide is toward(side, expected) if expected is not Slide.STUCK else b.slide is Slide.STUCK
    sign = 1.0 if side == LEFT else -1.0
    friction = {Slide.RIGHTWARD: -5.0, Slide.LEFTWARD: 5.0}
    mass, force = (math.inf, 0.0) if expected is Slide.STUCK else (1.0, sign * (push + friction[expected]))
    assert (b.plant.bodies[OBJECT, MASS], b.plant.bodies[OBJECT, FORCE]) == (mass, force)
    assert (b.plant.given[OBJECT, MASS], b.plant.given[OBJECT, FORCE]) == (1.0, sign * push)


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
def test_stick(side: Body) -> None:
    b = bench(side, -1.0, 0.0, coulomb=5.0, slide=toward(side, Slide.RIGHTWARD), object_speed=1e-17, object_push=4.0)
    make_slide_transition(b.plant, b.state, Slide.STUCK, b.out)
    assert b.slide is Slide.STUCK
    assert b.state.y[V_O] == 0.0
    assert b.plant.bodies[OBJECT, MASS] == math.inf
    assert b.events == [(OBJECT, Transition.STICK)]


@SIDES
def test_slip(side: Body) -> None:
    following = toward(side, Slide.LEFTWARD)
    b = bench(side, -1.0, 0.0, coulomb=5.0, slide=Slide.STUCK, object_push=-5.5)
    b.plant.bodies[OBJECT, MASS] = math.inf
    make_slide_transition(b.plant, b.state, following, b.out)
    assert b.slide is following
    assert b.plant.bodies[OBJECT, MASS] == 1.0
    assert abs(b.plant.bodies[OBJECT, FORCE]) == pytest.approx(0.5)
    assert b.events == [(OBJECT, Transition.SLIP)]


@SIDES
def test_an_object_that_turns_without_a_rest_is_no_event(side: Body) -> None:
    b = bench(side, -1.0, 0.0, coulomb=5.0, slide=toward(side, Slide.RIGHTWARD), object_speed=1e-17, object_push=-6.0)
    make_slide_transition(b.plant, b.state, Slide.STUCK, b.out)
    assert b.slide is toward(side, Slide.LEFTWARD)
    assert b.state.y[V_O] == 0.0
    assert b.events == []


# The begin of an interval: inputs may change.


def begin(b: Bench) -> Bench:
    """Begin an interval."""
    begin_interval(b.plant, b.state, b.settings, b.out)
    return b


@SIDES
def test_a_run_that_starts_gets_its_modes_without_events(side: Body) -> None:
    b = begin(bench(side, 0.0, 0.0, Pair.UNKNOWN, beside=(0.01, 0.0), beside_mode=Pair.UNKNOWN, push=1.0, coulomb=50.0))
    assert (b.mode(side), b.mode(other(side)), b.slide) == (Pair.BALLISTIC, Pair.CONTACT, Slide.STUCK)
    assert b.events == []


def test_a_run_that_starts_forgets_the_slide_of_another() -> None:
    b = begin(bench(LEFT, -1.0, 0.0, Pair.UNKNOWN, beside_mode=Pair.UNKNOWN, slide=Slide.STUCK))
    assert b.slide is Slide.FREE


@SIDES
def test_a_pair_at_rest_starts_as_friction_lets_it(side: Body) -> None:
    """Without friction the object would run away from the arm that pushes it."""
    options = {"push": 1.0, "object_push": 2.0}
    free = begin(bench(side, 0.0, 0.0, Pair.UNKNOWN, beside_mode=Pair.UNKNOWN, **options))
    held = begin(bench(side, 0.0, 0.0, Pair.UNKNOWN, beside_mode=Pair.UNKNOWN, coulomb=5.0, **options))
    assert (free.mode(side), held.mode(side)) == (Pair.OPEN, Pair.BALLISTIC)
    assert free.events == held.events == []


@SIDES
def test_an_object_starts_to_slide_if_an_impact_pushes_it(side: Body) -> None:
    """1e4 (0.01)^(3/2) = 10 N against 5 N."""
    b = begin(bench(side, 0.01, 0.0, Pair.UNKNOWN, beside_mode=Pair.UNKNOWN, coulomb=5.0))
    assert (b.slide, b.events) == (toward(side, Slide.RIGHTWARD), [])


@SIDES
def test_a_resting_pair_touches_when_an_input_begins_to_press(side: Body) -> None:
    b = begin(bench(side, 0.0, 0.0, push=1.0))
    assert b.mode(side) is Pair.BALLISTIC
    assert b.events == [(side, Transition.TOUCH)]
    assert begin(bench(side, 0.0, 0.0, push=-1.0)).events == []


@SIDES
def test_a_stuck_object_slips_when_an_input_exceeds_its_friction(side: Body) -> None:
    b = begin(bench(side, -1.0, 0.0, coulomb=5.0, slide=Slide.STUCK, object_push=6.0))
    assert b.slide is toward(side, Slide.RIGHTWARD)
    assert b.events == [(OBJECT, Transition.SLIP)]
    held = begin(bench(side, -1.0, 0.0, coulomb=5.0, slide=Slide.STUCK, object_push=4.0))
    assert (held.slide, held.events) == (Slide.STUCK, [])
    moving = begin(bench(side, -1.0, 0.0, coulomb=5.0, slide=Slide.STUCK, object_speed=1.0))
    moved = toward(side, Slide.RIGHTWARD)
    assert (moving.slide, moving.events) == (moved, [(OBJECT, Transition.SLIP)])
    again = begin(bench(side, -1.0, 0.0, coulomb=5.0, slide=moved, object_speed=1.0))
    assert (again.slide, again.events) == (moved, [])


@SIDES
def test_an_interval_that_goes_on_keeps_its_modes(side: Body) -> None:
    b = bench(side, 0.0, 0.0, push=1.0, coulomb=5.0, slide=Slide.STUCK, object_push=6.0, time=0.5)
    b.plant.bodies[:] = np.nan
    begin(b)
    assert (b.mode(side), b.slide, b.events) == (Pair.OPEN, Slide.STUCK, [])
    assert b.plant.bodies[OBJECT, MASS] == math.inf
    assert bits(b.plant.bodies[side]) == bits(b.plant.given[side])


# Rules between segments.


@SIDES
@pytest.mark.parametrize(
    ("u", "d", "mode", "touches"),
    [
        (0.0, 0.0, Pair.OPEN, True), (-1e-9, 0.0, Pair.OPEN, False), (0.0, -1e-9, Pair.OPEN, False),
        (0.0, 0.0, Pair.ABSENT, False), (0.0, 0.0, Pair.LEAVING, False),
    ],
)
def test_only_a_pair_at_rest_at_zero_is_closed(side: Body, u: float, d: float, mode: Pair, touches: bool) -> None:
    b = bench(side, u, d, mode, push=1.0)
    close_resting_pair(b.plant, b.state, b.settings, side, b.out)
    assert b.mode(side) is (Pair.BALLISTIC if touches else mode)
    assert b.events == ([(side, Transition.TOUCH)] if touches else [])


@SIDES
def test_a_resting_pair_closes_when_the_other_one_begins_to_push(side: Body) -> None:
    for beside_mode, beside, closes in (
        (Pair.CONTACT, (0.01, 0.1), True), (Pair.CLAMPED, (0.01, -9.0), False), (Pair.OPEN, (-0.1, 0.1), False),
    ):
        b = bench(side, 0.0, 0.0, beside=beside, beside_mode=beside_mode)
        b.state.y[V_O] = 0.0
        leave_corner(b.plant, b.state, b.settings, b.out)
        assert b.mode(side) is (Pair.BALLISTIC if closes else Pair.OPEN)
        assert b.events == ([(side, Transition.TOUCH)] if closes else [])


@SIDES
def test_a_pair_that_is_pressed_by_its_own_inputs_waits_for_them(side: Body) -> None:
    b = bench(side, 0.0, 0.0, push=1.0, beside=(-0.1, 0.1))
    leave_corner(b.plant, b.state, b.settings, b.out)
    assert (b.mode(side), b.events) == (Pair.OPEN, [])


def depth(b: Bench, side: Body) -> float:
    """The sliver of an impact's depth, m."""
    w, _ = scales(b.plant, b.state, b.settings, side)
    return float(sliver(b.settings.tolerance) * w * w)


def corner(side: Body, u: float, d: float, beside: tuple[float, float], **options: float) -> tuple[Pair, Pair]:
    """Both pairs in contact, `u` in slivers: their modes behind `leave_corner`."""
    def both(first: float, second: float) -> Bench:
        return bench(side, first, d, Pair.CONTACT, beside=(second, beside[1]), beside_mode=Pair.CONTACT, **options)

    unit = both(0.0, 0.0)
    b = both(u * depth(unit, side), beside[0] * depth(unit, other(side)))
    leave_corner(b.plant, b.state, b.settings, b.out)
    assert b.events == []
    return b.mode(side), b.mode(other(side))


BALLISTIC, LEAVING, STAY = ((mode, mode) for mode in (Pair.BALLISTIC, Pair.LEAVING, Pair.CONTACT))


@SIDES
@pytest.mark.parametrize(
    ("u", "d", "beside", "expected"),
    [
        (0.0, 0.3, (0.0, 0.3), BALLISTIC),  # both touch at once
        (0.0, 0.3, (0.2, 0.3), BALLISTIC),  # nearly so
        (0.0, 0.3, (0.5, 0.3), STAY),
        (0.0, 0.3, (9.0, 0.3), STAY),
        (0.5, 0.3, (0.5, 0.3), STAY),
        (0.1, -0.3, (0.1, -0.3), LEAVING),  # both release at once
        (0.9, -0.3, (0.1, -0.3), LEAVING),
        (1.1, -0.3, (0.1, -0.3), STAY),
        (0.0, 0.3, (0.0, -0.3), STAY),  # one comes, one goes
        (0.0, -0.3, (0.0, 0.3), STAY),
    ],
)
def test_both_sides_at_the_corner(
    side: Body, u: float, d: float, beside: tuple[float, float], expected: tuple[Pair, Pair]
) -> None:
    assert corner(side, u, d, beside) == expected


@SIDES
def test_a_pair_that_will_turn_back_does_not_leave(side: Body) -> None:
    """20 u |u''| beside u'^2: a push that turns it within the sliver keeps it in contact."""
    assert corner(side, 0.5, -1e-4, (0.5, -1e-4)) == LEAVING
    assert corner(side, 0.5, -1e-4, (0.5, -1e-4), push=1e9) == STAY
    assert corner(side, 0.5, -1e-4, (0.5, -1e-4), push=-1e9) == STAY


@SIDES
@pytest.mark.parametrize("beside_mode", [Pair.OPEN, Pair.LEAVING, Pair.BALLISTIC, Pair.ABSENT])
def test_one_side_alone_has_no_corner(side: Body, beside_mode: Pair) -> None:
    b = bench(side, 0.0, 0.3, Pair.CONTACT, beside=(0.0, 0.3), beside_mode=beside_mode)
    leave_corner(b.plant, b.state, b.settings, b.out)
    assert (b.mode(side), b.mode(other(side))) == (Pair.CONTACT, beside_mode)


@SIDES
@pytest.mark.parametrize(
    ("u", "d", "expected", "recorded"),
    [
        (0.5, 0.3, Pair.CONTACT, False),  # deep enough to push
        (0.5e-3, 0.3, Pair.BALLISTIC, False),  # still below rounding
        (0.5, -0.3, Pair.CONTACT, False),  # turned in the contact
        (0.5e-3, -0.3, Pair.CONTACT, False),
        (-0.5, -0.3, Pair.OPEN, True),  # parted before it pushed
        (-0.5, 0.3, Pair.OPEN, True),
        (0.0, -0.3, Pair.OPEN, True),
        (0.0, 0.3, Pair.BALLISTIC, False),
    ],
)
def test_the_end_of_a_ballistic_start(side: Body, u: float, d: float, expected: Pair, recorded: bool) -> None:
    unit = bench(side, 0.0, abs(d), Pair.BALLISTIC)
    b = bench(side, u * depth(unit, side), d, Pair.BALLISTIC, beside=(0.2, 0.1), beside_mode=Pair.CONTACT)
    b.state.mode[other(side)] = Pair.OPEN  # its force would enter the scales
    assert is_ballistic(b.state.mode)
    end_ballistic(b.plant, b.state, b.settings, b.out)
    assert b.mode(side) is expected
    assert b.events == ([(side, Transition.RELEASE)] if recorded else [])
    if recorded:
        assert b.recorded_motion == [(b.state.y[U_L + side], d)]


@SIDES
def test_a_ballistic_pair_at_rest_goes_on_with_the_pair_that_pushes(side: Body) -> None:
    for beside_mode, expected in ((Pair.CONTACT, Pair.BALLISTIC), (Pair.OPEN, Pair.OPEN)):
        b = bench(side, 0.0, 0.0, Pair.BALLISTIC, beside=(0.2, 0.0), beside_mode=beside_mode)
        assert is_ballistic(b.state.mode)
        end_ballistic(b.plant, b.state, b.settings, b.out)
        assert b.mode(side) is expected


def test_where_nothing_is_ballistic_nothing_ends() -> None:
    b = bench(LEFT, 0.0, -0.3, Pair.CONTACT, beside=(0.1, -0.2), beside_mode=Pair.CLAMPED)
    assert not is_ballistic(b.state.mode)
    end_ballistic(b.plant, b.state, b.settings, b.out)
    assert (b.mode(LEFT), b.mode(RIGHT), b.events) == (Pair.CONTACT, Pair.CLAMPED, [])

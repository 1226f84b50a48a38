"""The hybrid automaton: the mode of each pair and of the object, and every transition between modes.

A pair, by condition (10):

             TOUCH u up 0                CLAMP u' down -1/p
      OPEN --------------> CONTACT ---------------------------> CLAMPED
       ^  <--------------    | ^   <---------------------------   |
       |    RELEASE u down 0 | |        REENTRY u' up -1/p        |
       |                     v | both at u = 0: BALLISTIC, LEAVING|
       +----------------------- RELEASE --------------------------+

The object, by dry friction:

      RIGHTWARD, LEFTWARD --STICK v to 0, push within F--> STUCK --SLIP push beyond F--> RIGHTWARD, LEFTWARD

BALLISTIC, of one pair or both, ends in `end_ballistic`; LEAVING ends with its RELEASE. A pair gets into contact in
`make_transition` (an event), `close_resting_pair` (from rest, a TOUCH) or `initial_modes` (no event).

A mode is frozen within a segment, which calls `make_transitions` at its end. An event counts in (0, t] of a segment,
once, and never again from an exact zero. At an event, u = 0 and v_o = 0 are set exactly.
Where the state alone does not decide, these rules do:

* At u = 0 the sign of u' decides, and at u' = 0 the sign of the first derivative of u that differs from zero: pressed
  together it is BALLISTIC, otherwise OPEN. Where none differs, it follows the other pair: it is pressed as soon as
  that one is in contact.
* Such a resting pair gets its mode anew when the inputs change and whenever the other pair is in contact.
* Both pairs at u = 0 at once, where w_l w_r = 0 would stop the regularised time: approaching, both go BALLISTIC,
  without force for a time in which the impulse left out is below the tolerance; separating, both go LEAVING, without
  the rest of their impulse.
* An object at rest sticks if friction can balance what pushes it. One that stops while more pushes it turns around
  without a rest, and nothing is recorded.
"""

from __future__ import annotations

from grasp_ros.exact.flight import displacement, launch
from grasp_ros.exact.friction import apply_friction, impact_on_object, lift_friction
from grasp_ros.exact.impact import damping_factor
from grasp_ros.exact.jit import inlined, kernel
from grasp_ros.exact.kinematics import approach, arm_of, other, relative_motion
from grasp_ros.exact.outputs import record
from grasp_ros.exact.records import Array, Candidate, Integers, Output, Plant, Settings, SlideCandidate, State
from grasp_ros.exact.scales import probe_time, scales, sliver
from grasp_ros.physics.layout import (
    DISSIPATION,
    EPS,
    FORCE,
    HERTZIAN,
    LEFT,
    OBJECT,
    RIGHT,
    U_L,
    V_O,
    X_O,
    Body,
    Pair,
    Slide,
    Transition,
)

TOGETHER = 1.0 + 4.0 * EPS  # events closer than this happen together


# Consistent initialisation: modes from the state.


@kernel
def leaning(plant: Plant, y: Array, settings: Settings, side: Body) -> float:
    """u of a pair at rest at u = 0 a little later: its sign tells whether it is pressed together; 0: neither."""
    x, v, sign = arm_of(y, side)
    t = probe_time(settings, 1.0)
    far = displacement(launch(plant.bodies[side], x, v), t)
    far_o = displacement(launch(plant.bodies[OBJECT], y[X_O], y[V_O]), t)
    return sign * (far - far_o) if abs(far - far_o) > 4.0 * EPS * (abs(far) + abs(far_o)) else 0.0


@kernel
def mode_of(plant: Plant, state: State, settings: Settings, side: Body) -> Pair:
    """Mode of a pair from the motion, and at rest at u = 0, where nothing else decides, from the other pair."""
    y = state.y
    if plant.pairs[side, HERTZIAN] == 0.0:
        return Pair.ABSENT
    u, d = y[U_L + side], approach(y, side)
    if u < 0.0:
        return Pair.OPEN
    if u > 0.0:
        return Pair.CONTACT if damping_factor(plant.pairs[side, DISSIPATION], d) >= 0.0 else Pair.CLAMPED
    if d == 0.0:
        lean = leaning(plant, y, settings, side)
        pushed = lean == 0.0 and state.mode[other(side)] == Pair.CONTACT
        return Pair.BALLISTIC if lean > 0.0 or pushed else Pair.OPEN
    return Pair.CONTACT if d > 0.0 else Pair.OPEN


@kernel
def initial_modes(plant: Plant, state: State, settings: Settings) -> None:
    """Modes of both pairs for a run that starts here."""
    for side in (LEFT, RIGHT, LEFT):  # the left pair again, because it may follow the right one
        state.mode[side] = mode_of(plant, state, settings, side)


@kernel
def initial_slide(plant: Plant, state: State) -> None:
    """Mode of the object from its state: at rest it sticks if friction can balance what pushes it."""
    if plant.coulomb == 0.0:
        return
    direction = state.y[V_O]
    if direction == 0.0:
        push = impact_on_object(plant, state) + plant.given[OBJECT, FORCE]
        direction = push if abs(push) > plant.coulomb else 0.0
    if direction == 0.0:
        state.mode[OBJECT] = Slide.STUCK
    else:
        state.mode[OBJECT] = Slide.RIGHTWARD if direction > 0.0 else Slide.LEFTWARD
    apply_friction(plant, state.mode)


@kernel
def begin_interval(plant: Plant, state: State, settings: Settings, out: Output) -> None:
    """Modes under the inputs of a new interval, which may be discontinuous here; a run that starts gets its first.

    An interval that goes on after it has handed over its events keeps its modes.
    """
    mode = state.mode
    lift_friction(plant)
    if mode[LEFT] == Pair.UNKNOWN:
        mode[OBJECT] = Slide.FREE
        initial_modes(plant, state, settings)
        initial_slide(plant, state)
        initial_modes(plant, state, settings)  # a pair at rest at u = 0 moves as friction lets it
    if state.clock[0] > 0.0:
        apply_friction(plant, mode)
        return
    stuck = mode[OBJECT] == Slide.STUCK
    initial_slide(plant, state)
    if stuck and mode[OBJECT] != Slide.STUCK:
        record(state, OBJECT, Transition.SLIP, 0.0, 0.0, out)
    for side in (LEFT, RIGHT):
        close_resting_pair(plant, state, settings, side, out)


# Rules between segments.


@inlined
def close_resting_pair(plant: Plant, state: State, settings: Settings, side: Body, out: Output) -> None:
    """A pair that rests at u = 0 touches if what acts now presses it together."""
    y, mode = state.y, state.mode
    if mode[side] == Pair.OPEN and y[U_L + side] == 0.0 and approach(y, side) == 0.0:
        mode[side] = mode_of(plant, state, settings, side)
        if mode[side] != Pair.OPEN:
            record(state, side, Transition.TOUCH, 0.0, 0.0, out)


@inlined
def leave_corner(plant: Plant, state: State, settings: Settings, out: Output) -> None:
    """Take both pairs off the corner w_l = w_r = 0, where the product w_l w_r stops the regularised time."""
    mode, y = state.mode, state.y
    for side in (LEFT, RIGHT):
        if mode[other(side)] == Pair.CONTACT:
            close_resting_pair(plant, state, settings, side, out)
    if mode[LEFT] != Pair.CONTACT or mode[RIGHT] != Pair.CONTACT:
        return
    shallow = sliver(settings.tolerance)
    approaching = 0
    separating = 0
    for side in (LEFT, RIGHT):
        d, a = relative_motion(plant, y, side)
        w, _ = scales(plant, state, settings, side)
        u = y[U_L + side]
        if d >= 0.0 and u < 0.3 * shallow * w * w:
            approaching += 1
        elif d < 0.0 and u < shallow * w * w and 20.0 * u * abs(a) < d * d:
            separating += 1
    if approaching == 2:
        mode[LEFT] = mode[RIGHT] = Pair.BALLISTIC
    elif separating == 2:
        mode[LEFT] = mode[RIGHT] = Pair.LEAVING


@inlined
def is_ballistic(mode: Integers) -> bool:
    """Whether a pair goes without force for a while."""
    return mode[LEFT] == Pair.BALLISTIC or mode[RIGHT] == Pair.BALLISTIC


@kernel
def end_ballistic(plant: Plant, state: State, settings: Settings, out: Output) -> None:
    """Give ballistic pairs a mode again, unless one is still so shallow that its force is below rounding."""
    y, mode = state.y, state.mode
    for side in (LEFT, RIGHT):
        if mode[side] != Pair.BALLISTIC:
            continue
        u, d = y[U_L + side], approach(y, side)
        if u >= 0.0 and d > 0.0:
            w, _ = scales(plant, state, settings, side)
            if u <= 1e-3 * sliver(settings.tolerance) * w * w:
                continue
        mode[side] = mode_of(plant, state, settings, side)
        if mode[side] == Pair.OPEN:
            record(state, side, Transition.RELEASE, u, d, out)


# Transitions at the end of a segment.


@inlined
def make_transitions(plant: Plant, state: State, left: Candidate, right: Candidate, slide: SlideCandidate, end: float,
                     out: Output) -> None:
    """Make all transitions within a few roundings of the end of a segment."""
    if left.when <= end * TOGETHER:
        make_transition(state, LEFT, left.what, out)
    if right.when <= end * TOGETHER:
        make_transition(state, RIGHT, right.what, out)
    if slide.when <= end * TOGETHER:
        make_slide_transition(plant, state, slide.what, out)


@kernel
def make_transition(state: State, side: Body, kind: Transition, out: Output) -> None:
    """The reset map of a pair: its next mode, u = 0 at a touch and a release, and the record of the event.

    A touch that rounding invents at the turning point of a grazing approach has u' <= 0 and is no event.
    """
    y, mode, d = state.y, state.mode, approach(state.y, side)
    if kind in (Transition.TOUCH, Transition.RELEASE):
        y[U_L + side] = 0.0
    if kind == Transition.TOUCH and d <= 0.0:
        return
    if kind == Transition.RELEASE:
        mode[side] = Pair.OPEN
    else:
        mode[side] = Pair.CLAMPED if kind == Transition.CLAMP else Pair.CONTACT
    record(state, side, kind, y[U_L + side], d, out)


@kernel
def make_slide_transition(plant: Plant, state: State, following: Slide, out: Output) -> None:
    """The reset map of the object: it stops, or slips into the mode that follows; v_o = 0, and the record."""
    mode = state.mode
    stopped = mode[OBJECT] != Slide.STUCK
    state.y[V_O] = 0.0
    if stopped:
        initial_slide(plant, state)
    else:
        mode[OBJECT] = following
        apply_friction(plant, mode)
    if stopped and mode[OBJECT] != Slide.STUCK:  # it turns without a rest
        return
    record(state, OBJECT, Transition.STICK if stopped else Transition.SLIP, 0.0, 0.0, out)

"""The hybrid automaton: the mode of each pair and of the object, and every transition between modes.

`docs/automaton.md` has the diagrams and the rules. A mode is frozen within a segment: `settle_pairs` makes the modes
consistent where one begins, and `make_transitions` where it ends; `begin_interval` does so under new inputs.
"""

from __future__ import annotations

from grasp_ros.exact.automaton.begin import is_negligible, must_begin
from grasp_ros.exact.automaton.edge import NEVER, deciding_derivative, glides, has_glided, separates, surface_side
from grasp_ros.exact.automaton.friction import apply_friction, lift_friction, push_on_object
from grasp_ros.exact.compensated import copy, keep_together, meet, put, velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.driver.outputs import record
from grasp_ros.exact.kinematics import approach, is_closed, is_resting, other
from grasp_ros.exact.records import Ends, Output, Plant, Settings, State
from grasp_ros.exact.tolerances import DIED_OUT, LEFT_OUT, SLIPS, SURFACE, SURFACE_DRIFT, TOGETHER
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Law, Pair, Slide, Transition, U, V


@kernel
def mode_of(plant: Plant, state: State, side: Body) -> Pair:
    """Consistent mode of a pair: at u = 0 and at u' = -1/p by the first derivative of its motion that decides."""
    y = state.y
    if plant.pairs[side, Law.HERTZIAN] == 0.0:
        return Pair.ABSENT
    u, d = y[U.L + side], approach(y, side)
    if u > 0.0:
        return Pair.CONTACT if surface_side(plant, state, side) >= 0.0 else Pair.CLAMPED
    if u < 0.0 or d != 0.0:
        return Pair.CONTACT if u == 0.0 and d > 0.0 else Pair.OPEN
    order, value = deciding_derivative(plant, state, side)
    if order == NEVER:
        return Pair.RESTING
    return Pair.CONTACT if value > 0.0 else Pair.OPEN


@kernel
def initial_modes(plant: Plant, state: State) -> None:
    """Modes of both pairs at the start of a run, iterated as each depends on the other; both at once, for symmetry."""
    for _ in range(3):  # by its own motion; by the other's mode; by that mode where it depended on this one
        left, right = mode_of(plant, state, LEFT), mode_of(plant, state, RIGHT)
        state.mode[LEFT], state.mode[RIGHT] = left, right


@kernel
def initial_slide(plant: Plant, state: State) -> None:
    """Mode of the object from its state: at rest it sticks if friction can balance what pushes it."""
    if plant.coulomb == 0.0:
        return
    direction = state.y[V.O]
    if direction == 0.0:
        push = push_on_object(plant, state)
        direction = push.value if abs(push.value) - plant.coulomb > push.rounding else 0.0
    if direction == 0.0:
        state.mode[OBJECT] = Slide.STUCK
    else:
        state.mode[OBJECT] = Slide.RIGHTWARD if direction > 0.0 else Slide.LEFTWARD
    apply_friction(plant, state.mode)


@inlined
def begin_interval(plant: Plant, state: State, out: Output) -> None:
    """Set the modes under the inputs of a new interval, or the first of a run; a resumed interval keeps them.

    What would change nothing is not called: handing over the records takes longer than the flight of a tick.
    """
    mode = state.mode
    lift_friction(plant)
    if mode[LEFT] == Pair.UNKNOWN:
        mode[OBJECT] = Slide.FREE
        initial_modes(plant, state)
        initial_slide(plant, state)
        initial_modes(plant, state)  # a pair at rest at u = 0 moves as friction lets it
        for side in (LEFT, RIGHT):  # a run that starts with a pair closed at u = 0 starts with its touch
            if mode[side] == Pair.CONTACT and state.y[U.L + side] == 0.0:
                record(state, side, Transition.TOUCH, 0.0, approach(state.y, side), out)
    if state.clock[0] > 0.0:
        apply_friction(plant, mode)
        return
    if plant.coulomb > 0.0:
        settle_object(plant, state, out)
    for _ in range(2):  # a pair that is pushed back may push the other one back, too
        left, right = mode_at_tick(plant, state, LEFT), mode_at_tick(plant, state, RIGHT)
        if left != mode[LEFT]:
            settle(state, LEFT, left, out)
        if right != mode[RIGHT]:
            settle(state, RIGHT, right, out)


@inlined
def mode_at_tick(plant: Plant, state: State, side: Body) -> Pair:
    """Mode of a pair under new inputs: a new one if it is LEAVING and moved; `settle_resting` sets pairs at rest."""
    mode = state.mode[side]
    leaves = mode == Pair.LEAVING and not has_glided(plant, state, side, SURFACE_DRIFT)
    return mode_of(plant, state, side) if leaves else mode


@kernel
def settle_object(plant: Plant, state: State, out: Output) -> None:
    """Give the object its mode anew, and record it if it sticks or slips."""
    stuck = state.mode[OBJECT] == Slide.STUCK
    initial_slide(plant, state)
    if stuck != (state.mode[OBJECT] == Slide.STUCK):
        record(state, OBJECT, Transition.SLIP if stuck else Transition.STICK, 0.0, 0.0, out)


@kernel
def settle(state: State, side: Body, following: Pair, out: Output) -> None:
    """Set the mode of a pair, and record a TOUCH, a RELEASE, or a CLAMP of a pair that was LEAVING."""
    mode, y = state.mode, state.y
    before, left = is_closed(mode[side]), mode[side] == Pair.LEAVING
    mode[side] = following
    if is_closed(following) != before:
        record(state, side, Transition.RELEASE if before else Transition.TOUCH, y[U.L + side], approach(y, side), out)
    elif left and following == Pair.CLAMPED:
        record(state, side, Transition.CLAMP, y[U.L + side], approach(y, side), out)


@inlined
def waits(state: State, side: Body) -> bool:
    """Whether a pair is at u = u' = 0 and its mode may change, as the other pair may have changed."""
    return state.mode[side] in (Pair.OPEN, Pair.RESTING, Pair.CONTACT, Pair.BEGINNING) and is_resting(state.y, side)


@inlined
def settle_resting(plant: Plant, state: State, out: Output) -> None:
    """Settle pairs at u = u' = 0: inputs, or the other pair, may press them together now."""
    waits_l, waits_r = waits(state, LEFT), waits(state, RIGHT)
    if not (waits_l or waits_r):
        return
    for _ in range(2):
        left = mode_of(plant, state, LEFT) if waits_l else state.mode[LEFT]
        right = mode_of(plant, state, RIGHT) if waits_r else state.mode[RIGHT]
        settle(state, LEFT, left, out)
        settle(state, RIGHT, right, out)


@inlined
def begin_contacts(state: State) -> None:
    """Let pairs begin that must; both at once, for symmetry."""
    left, right = must_begin(state, LEFT), must_begin(state, RIGHT)
    if left:
        state.mode[LEFT] = Pair.BEGINNING
    if right:
        state.mode[RIGHT] = Pair.BEGINNING


@inlined
def end_begin(state: State, side: Body, out: Output) -> None:
    """A pair that has begun is in contact; one that has come back instead is open."""
    u, d = state.y[U.L + side], approach(state.y, side)
    if state.mode[side] == Pair.BEGINNING and (u != 0.0 or d != 0.0):
        settle(state, side, Pair.CONTACT if u > 0.0 or (u == 0.0 and d > 0.0) else Pair.OPEN, out)


@inlined
def end_motion(state: State, side: Body) -> None:
    """Put a pair at u = u' = 0 whose motion has died out: squares of it would have left the range of numbers."""
    dead = abs(state.y[U.L + side]) < DIED_OUT and abs(approach(state.y, side)) < DIED_OUT
    if dead and state.mode[side] != Pair.ABSENT:
        keep_together(state, side)


@inlined
def settle_pairs(plant: Plant, state: State, settings: Settings, out: Output) -> None:
    """Modes of the pairs that are consistent with where a segment begins."""
    end_motion(state, LEFT)
    end_motion(state, RIGHT)
    settle_resting(plant, state, out)
    end_begin(state, LEFT, out)
    end_begin(state, RIGHT, out)
    begin_contacts(state)
    let_leave(plant, state, settings)


@inlined
def let_leave(plant: Plant, state: State, settings: Settings) -> None:
    """Make pairs LEAVING that nothing moves off u' = -1/p, where the force has died out, both at once, for symmetry.

    So are both before a common release: w_l w_r = 0 stops regularised time.
    """
    mode, y = state.mode, state.y
    left = mode[LEFT] == Pair.CONTACT and has_glided(plant, state, LEFT, SURFACE)
    right = mode[RIGHT] == Pair.CONTACT and has_glided(plant, state, RIGHT, SURFACE)
    if left:
        mode[LEFT] = Pair.LEAVING
    if right:
        mode[RIGHT] = Pair.LEAVING
    slipping = mode[OBJECT] in (Slide.RIGHTWARD, Slide.LEFTWARD) and y[V.O] == 0.0  # it needs their force
    if mode[LEFT] != Pair.CONTACT or mode[RIGHT] != Pair.CONTACT or slipping:
        return
    for side in (LEFT, RIGHT):
        u, d = y[U.L + side], approach(y, side)
        if not (separates(plant, y, side) and is_negligible(plant, side, u, d, LEFT_OUT * settings.tolerance)):
            return
    mode[LEFT] = mode[RIGHT] = Pair.LEAVING


@inlined
def make_transitions(plant: Plant, state: State, ends: Ends, end: float, out: Output) -> None:
    """Make all transitions within a few roundings of the end.

    Where a pair changes, the rounding of its force is gone: whether a stuck object slips is decided again.
    """
    (left, right, slide, _), last = ends, end * TOGETHER
    leaves_l = left.when <= last and left.what == Transition.CLAMP and glides(plant, state, LEFT)
    leaves_r = right.when <= last and right.what == Transition.CLAMP and glides(plant, state, RIGHT)
    if left.when <= last:
        make_transition(plant, state, LEFT, left.what, leaves_l, out)
    if right.when <= last:
        make_transition(plant, state, RIGHT, right.what, leaves_r, out)
    if slide.when <= last:
        make_slide_transition(plant, state, slide.what, out)
    elif state.mode[OBJECT] == Slide.STUCK and min(left.when, right.when) <= last:
        settle_object(plant, state, out)


@kernel
def make_transition(plant: Plant, state: State, side: Body, kind: Transition, leaves: bool, out: Output) -> None:
    """The reset map of a pair: its next mode, u = 0 at a touch and a release, and the record of the event.

    If rounding makes u' <= 0 at a touch, the pair is at rest, and `settle_resting` decides. If nothing moves a pair off
    u' = -1/p, its CLAMP is due to rounding: the pair `leaves`, without an event.
    """
    y, mode, d, opposite = state.y, state.mode, approach(state.y, side), other(side)
    if kind in (Transition.TOUCH, Transition.RELEASE):
        meet(state, side)  # the positions agree but for rounding
    if kind == Transition.TOUCH and d <= 0.0:
        copy(state, velocity_lane(side), V.O)
        return
    if leaves:
        mode[side] = Pair.LEAVING
        return
    if kind == Transition.TOUCH and mode[opposite] == Pair.LEAVING:
        mode[opposite] = Pair.CONTACT  # the force of this pair may turn it back
    if kind == Transition.CLAMP:
        mode[side] = Pair.CLAMPED
    else:
        mode[side] = Pair.OPEN if kind == Transition.RELEASE else Pair.CONTACT
    record(state, side, kind, y[U.L + side], d, out)


@kernel
def make_slide_transition(plant: Plant, state: State, following: Slide, out: Output) -> None:
    """The reset map of the object: it slips into the mode that follows, stops, or turns without a rest; v_o = 0.

    The slip is found in series with the error of the accuracy. If the force in the state at their end is below the
    friction by a quarter of its rounding, the object stays stuck, and the next step finds the slip; at half of it,
    `slide_in_contact` would stop the object at once.
    """
    put(state, V.O, 0.0)
    if state.mode[OBJECT] != Slide.STUCK:
        settle_object(plant, state, out)
        return
    push = push_on_object(plant, state)
    if abs(push.value) - plant.coulomb < -SLIPS * push.rounding:
        return
    state.mode[OBJECT] = following
    apply_friction(plant, state.mode)
    record(state, OBJECT, Transition.SLIP, 0.0, 0.0, out)

"""A segment with a squeezed contact of large dissipation: one implicit step in place of very many Taylor steps.

Where p H u^1.5 / mu is a fast rate and the pair only creeps, a Taylor series goes on resolving a relaxation that is
long over. The collocation of `collocation` is L-stable, and its solution is a polynomial in t: the same tables hold it,
and the same searches find its events. The surface of condition (10) is e = 1 + p u' = 0, an unknown of its own with all
its digits, where p times a difference of velocities would have none.
"""

from __future__ import annotations

import math

from grasp_ros.exact.beside import end_beside, free_flight, part_beside, place_beside
from grasp_ros.exact.clock import tick, until
from grasp_ros.exact.collocation import E_NODES, SUMS, Approach, impact_at, motion_of
from grasp_ros.exact.contact import write_state
from grasp_ros.exact.energy_check import check_segment, energy_level
from grasp_ros.exact.friction import push_on_object, slide_in_contact, slip_candidate
from grasp_ros.exact.implicit import expand_row, implicit_step
from grasp_ros.exact.jit import door, inlined, kernel
from grasp_ros.exact.kinematics import keep_resting
from grasp_ros.exact.modes import TOGETHER, make_transitions
from grasp_ros.exact.observer import leave_step, notify
from grasp_ros.exact.outputs import due, wait
from grasp_ros.exact.polynomial import values
from grasp_ros.exact.radau import FIRST, STAGES
from grasp_ros.exact.records import (
    Array,
    Candidate,
    Flight,
    Integers,
    Output,
    Placing,
    Plant,
    SlideCandidate,
    Start,
    State,
    Tables,
)
from grasp_ros.exact.roots import first_rise
from grasp_ros.exact.scales import new_settings
from grasp_ros.exact.sums import forget
from grasp_ros.physics.layout import (
    DISSIPATION,
    EPS,
    LANES,
    LEFT,
    OBJECT,
    RIGHT,
    U_L,
    U_R,
    X_O,
    Body,
    Filled,
    Outcome,
    Pair,
    Segment,
    Slide,
    Transition,
    Work,
)

EARLY, AFTER = 0.1, 4.0  # part of a step of which few nodes tell, and parts up to a release in the step after that
GAINS = 16.0  # times 1/p: a u' of which a crossing of -1/p has too many roundings
SOON = 1e-3  # of a step: an event so early may hang on a relaxation that the step does not resolve
NOISY = 1e-3  # part of e at which what is left of a relaxation hides the course of e between the nodes


@kernel
def first_crossing(tables: Tables, side: Body, pair: Approach, loss: float, turn: float, work: Integers) -> float:
    """First part of a step at which turn (1 + p u') rises through zero; inf if there is none."""
    f, row, at, highest = tables.f, tables.row, E_NODES + side * STAGES, -math.inf
    for j in range(STAGES):
        row[j] = turn * (f[at + j] if pair.stiff else 1.0 + loss * f[at + j])
        highest = max(highest, row[j])
    last, rest = expand_row(tables)
    if abs(f[SUMS]) > 2.0 * rest or (highest < 0.0 and last > -NOISY * highest):
        return math.inf
    return first_rise(row, STAGES - 1, 1.0, 0.0, work)


@kernel
def squeezed_candidate(tables: Tables, plant: Plant, state: State, side: Body, h: float, work: Integers) -> Candidate:
    """First event of one pair within an implicit step of h s, in units of it."""
    mode, loss, row = state.mode[side], plant.pairs[side, DISSIPATION], tables.row
    if mode in (Pair.RESTING, Pair.ABSENT):
        return Candidate(math.inf, Transition.TOUCH)
    crossed, turn = math.inf, -1.0 if mode == Pair.CONTACT else 1.0
    if loss > 0.0 and mode in (Pair.CONTACT, Pair.CLAMPED):
        crossed = first_crossing(tables, side, motion_of(plant, state, side, h), loss, turn, work)
    for k in range(STAGES + 1):
        row[k] = (1.0 if mode == Pair.OPEN else -1.0) * tables.c[LANES * k + U_L + side]
    depth = first_rise(row, STAGES, 1.0, EPS * abs(row[FIRST]), work)
    if crossed < depth or math.isnan(crossed):
        return Candidate(crossed, Transition.CLAMP if mode == Pair.CONTACT else Transition.REENTRY)
    return Candidate(depth, Transition.TOUCH if mode == Pair.OPEN else Transition.RELEASE)


@inlined
def deliver(tables: Tables, h: float, t: float, how: tuple[Placing, Placing], free: tuple[Flight, Flight],
            state: State, out: Output) -> None:
    """Write the states at the output times before the end t of a segment, from the polynomials in t / h."""
    tau = due(state, out)
    while tau < t:
        row = out.rows[out.filled[Filled.OUTPUTS]]
        values(tables.c, STAGES, tau / h, tables.at)
        write_state(tables.at, tables.at[X_O], tables.at[U_L], tables.at[U_R], row)
        place_beside(tables.at, how, free, tau, row)
        out.filled[Filled.OUTPUTS] += 1
        tau = due(state, out)


@kernel
def squeezed_slide(tables: Tables, plant: Plant, state: State, h: float, work: Integers) -> SlideCandidate:
    """First event of the object within an implicit step of h s, in units of it."""
    if state.mode[OBJECT] != Slide.STUCK:
        return slide_in_contact(tables, plant, state, STAGES, 1.0, work)
    f, row, push = tables.f, tables.row, push_on_object(plant, state)
    left, right = motion_of(plant, state, LEFT, h), motion_of(plant, state, RIGHT, h)
    for j in range(STAGES):
        row[j] = impact_at(f, LEFT, left, h, j) - impact_at(f, RIGHT, right, h, j)
    expand_row(tables)
    resolved = (left.stiff or left.hertzian == 0.0) and (right.stiff or right.hertzian == 0.0)  # e has its own digits
    rounding = push.rounding if resolved else push.noise
    return slip_candidate(tables, plant, STAGES - 1, 1.0, (rounding, rounding), work)


@inlined
def is_doubtful(tables: Tables, plant: Plant, state: State, side: Body, candidate: Candidate, s: float, h: float
                ) -> bool:
    """Whether an event early in a step, at s, is a release, or has the roundings of all that u' gains in the step."""
    if candidate.when > s * TOGETHER:
        return False
    if candidate.what in (Transition.CLAMP, Transition.REENTRY) and not motion_of(plant, state, side, h).stiff:
        return abs(tables.f[E_NODES + side * STAGES + STAGES - 1]) * plant.pairs[side, DISSIPATION] > GAINS
    return candidate.what == Transition.RELEASE


@kernel
def squeezed_segment(tables: Tables, plant: Plant, state: State, h: float, out: Output) -> float:
    """The implicit step of h s to its first event, whose transitions it makes, or to its end.

    Returns its time in s; 0 if the search for the first event does not end, -t if an event at about t is so early that
    the nodes hardly see what is before it.
    """
    out.work[Work.CONTACT_STEPS] += 1
    c, at, y = tables.c, tables.at, state.y
    left = squeezed_candidate(tables, plant, state, LEFT, h, out.work)
    right = squeezed_candidate(tables, plant, state, RIGHT, h, out.work)
    slide = SlideCandidate(math.inf, Slide.FREE)
    if state.mode[OBJECT] != Slide.FREE:
        slide = squeezed_slide(tables, plant, state, h, out.work)
    if math.isnan(left.when) or math.isnan(right.when) or math.isnan(slide.when):
        wait(out, 4.0)
        return 0.0
    s = min(1.0, left.when, right.when, slide.when)
    if s < EARLY and s * h > 0.0 and (is_doubtful(tables, plant, state, LEFT, left, s, h)
                                      or is_doubtful(tables, plant, state, RIGHT, right, s, h)):
        out.work[Work.REJECTED_STEPS] += 1
        return -s * h
    if s < SOON:
        wait(out, 4.0)
    else:
        out.filled[Filled.PENALTY] = 0
    t = s * h
    how = (Placing.BY_GAP if state.mode[LEFT] == Pair.CONTACT else Placing.BY_FLIGHT,
           Placing.BY_GAP if state.mode[RIGHT] == Pair.CONTACT else Placing.BY_FLIGHT)
    free = (free_flight(plant, y, LEFT, how[0]), free_flight(plant, y, RIGHT, how[1]))
    deliver(tables, h, t, how, free, state, out)
    values(c, STAGES, s, at)
    y[U_L], y[U_R] = at[U_L], at[U_R]
    write_state(at, at[X_O], y[U_L], y[U_R], y)
    forget(state)
    end_beside(state, at, how, free, t)
    part_beside(plant, how, free, t, state)
    keep_resting(state)
    tick(state.clock, t)
    leave_step(tables, s, h)
    notify(out, Segment.CREEP, t)
    make_transitions(plant, state, left, right, slide, s, out)
    return t


@door
def creep(
    c: Array, f: Array, at: Array, size: Array, row: Array, start_c: Array, start_f: Array,
    given: Array, bodies: Array, pairs: Array, coulomb: float,
    y: Array, mode: Integers, carry: Array, clock: Array,
    end: float, tolerance: float, max_work: int,
    grid: Array, rows: Array, events: Array, filled: Integers, work: Integers,
) -> int:
    """Make one implicit step, if it is worth its price: a door with the arguments of `hybrid.advance`.

    It is a door of its own, so that only who squeezes a contact waits for its compilation.

    Returns
    -------
    int
        A `layout.Outcome`: GO_ON, or why the step cannot be believed; `rows` holds nothing of it then.
    """
    tables = Tables(c, f, at, size, size, Start(start_c, start_f))  # this row is long enough at any accuracy
    plant, state = Plant(given, bodies, pairs, coulomb), State(y, mode, carry, clock)
    settings = new_settings(tolerance, row.shape[0] - 1, given)
    out = Output(grid, rows, events, filled, work)
    reached = out.filled[Filled.OUTPUTS]
    before, modes = energy_level(plant, state, 0.0), (mode[LEFT], mode[RIGHT])
    span, t = until(state.clock, end), -1.0
    while t < 0.0:
        h = implicit_step(tables, plant, state, settings, span, out)
        if h == 0.0:
            return Outcome.GO_ON
        t = squeezed_segment(tables, plant, state, h, out)
        span = -AFTER * t
    if t == 0.0:
        return Outcome.GO_ON
    outcome = check_segment(plant, state, settings, before, energy_level(plant, state, t), t, 0, modes)
    if outcome != Outcome.GO_ON:
        out.filled[Filled.OUTPUTS] = reached
    return outcome

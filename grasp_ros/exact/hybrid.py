"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the transitions of `modes`.

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings happen together.
"""

from __future__ import annotations

from grasp_ros.exact.clock import until
from grasp_ros.exact.contact import contact_segment
from grasp_ros.exact.creeping import is_squeezed
from grasp_ros.exact.energy_check import check_segment, energy_level
from grasp_ros.exact.flight_segment import flight_segment
from grasp_ros.exact.jit import door
from grasp_ros.exact.loop import answer_end, close_interval, enter_interval, open_interval
from grasp_ros.exact.modes import let_leave, settle_resting
from grasp_ros.exact.outputs import may_go_on, write_reached
from grasp_ros.exact.records import Array, Integers, Level, Loop, Output, Plant, Start, State, Tables
from grasp_ros.exact.scales import new_settings
from grasp_ros.exact.start import must_start, start_segment
from grasp_ros.physics.layout import LEFT, RIGHT, Filled, Outcome, Pair, Place


@door
def advance(
    c: Array, f: Array, at: Array, size: Array, row: Array, start_c: Array, start_f: Array,
    given: Array, bodies: Array, pairs: Array, coulomb: float,
    y: Array, mode: Integers, carry: Array, clock: Array,
    tolerance: float, max_work: int,
    grid: Array, rows: Array, events: Array, filled: Integers, work: Integers,
    own: Array, lengths: Array, begins: Array, bounds: Integers, place: Integers, inputs: Array, external: Array,
    answers: Array, callee: Integers, laws: Array, normals: Array, waiting: Array,
) -> int:
    """Integrate interval by interval, each segment by segment, from where the loop and the clock stand.

    This is the door: flat arrays come in and become records, because a record that crosses from Python costs half a
    microsecond.

    Parameters
    ----------
    c, f, at, size, row, start_c, start_f : arrays
        Workspace, `records.Tables`; its size sets the highest order.
    given, bodies, pairs, coulomb : arrays (3, 4), (3, 4), (2, 2), and float in N
        `records.Plant`.
    y, mode, carry, clock : arrays (8,), (3,), (8,) and (3,)
        `records.State`, updated in place.
    tolerance : float
        First neglected Taylor term, relative to the impact.
    max_work : int
        Budget of flights, contact steps and evaluations of event functions together.
    grid, rows, events, filled, work : arrays (n,), (n, 6), (m, 5), (6,) and (4,)
        `records.Output`, filled in place; output times in s from the begin of their interval.
    own : array (3,), N by body
        Constant forces of the bodies by themselves, to which the inputs are added.
    lengths, begins, bounds, place, inputs, external, answers, callee, laws, normals, waiting : arrays
        `records.Loop`, filled in place.

    Returns
    -------
    int
        A `layout.Outcome`. After SQUEEZED the next step is one of `squeezed.creep`. If it is none of DONE,
        EVENTS_FULL, WORK_USED, SQUEEZED and NO_COMMAND, `rows` holds nothing of the segment that failed.
    """
    tables, state = Tables(c, f, at, size, row, Start(start_c, start_f)), State(y, mode, carry, clock)
    plant = Plant(given, bodies, pairs, coulomb)
    settings = new_settings(tolerance, row.shape[0] - 1, given)
    loop = Loop(lengths, begins, bounds, place, inputs, external, answers, callee, laws, normals, waiting)
    out = Output(grid, rows, events, filled, work)
    if lengths.shape[0] == 0:
        return answer_end(state, loop)
    end, idle, before, enters = 0.0, 0, Level(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), True
    while True:
        if enters:
            if not open_interval(plant, state, own, loop, filled):
                return Outcome.NO_COMMAND
            end, out = lengths[place[Place.INTERVAL]], enter_interval(plant, state, loop, out, grid)
            idle, before, enters = 0, energy_level(plant, state, 0.0), False
        reached = write_reached(state, out)
        span = until(state.clock, end)
        outcome = may_go_on(span, max_work, out)
        enters = outcome == Outcome.DONE and close_interval(loop)
        if enters:
            continue
        if outcome != Outcome.GO_ON:
            return outcome
        settle_resting(plant, state, out)
        let_leave(plant, state, settings)
        modes = (state.mode[LEFT], state.mode[RIGHT])
        if must_start(state):
            t = start_segment(tables, plant, state, settings, span, out)
        elif state.mode[LEFT] == Pair.CONTACT or state.mode[RIGHT] == Pair.CONTACT:
            if is_squeezed(plant, state, settings, span, out):
                return Outcome.SQUEEZED
            t = contact_segment(tables, plant, state, settings, span, out)
        else:
            t = flight_segment(tables, plant, state, settings, span, out)
        idle = 0 if t > 0.0 else idle + 1
        after = energy_level(plant, state, t)
        outcome = check_segment(plant, state, settings, before, after, t, idle, modes)
        if outcome != Outcome.GO_ON:
            out.filled[Filled.OUTPUTS] = reached
            return outcome
        before = after

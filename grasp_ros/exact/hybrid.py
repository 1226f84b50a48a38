"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the transitions of `modes`.

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings happen together.
"""

from __future__ import annotations

from grasp_ros.exact.clock import until
from grasp_ros.exact.contact import contact_segment
from grasp_ros.exact.energy_check import check_segment, energy_level
from grasp_ros.exact.flight_segment import flight_segment
from grasp_ros.exact.jit import kernel
from grasp_ros.exact.kinematics import is_clamped
from grasp_ros.exact.modes import begin_interval, leave_together, settle_resting
from grasp_ros.exact.outputs import may_go_on, write_reached
from grasp_ros.exact.records import Array, Integers, Output, Plant, Start, State, Tables
from grasp_ros.exact.scales import is_squeezed, new_settings
from grasp_ros.exact.start import must_start, start_segment
from grasp_ros.physics.layout import LEFT, RIGHT, Filled, Outcome, Pair


@kernel
def advance(
    c: Array, f: Array, at: Array, size: Array, row: Array, start_c: Array, start_f: Array,
    given: Array, bodies: Array, pairs: Array, coulomb: float,
    y: Array, mode: Integers, clock: Array,
    end: float, tolerance: float, max_work: int,
    grid: Array, rows: Array, events: Array, filled: Integers, work: Integers,
) -> int:
    """Integrate from the clock to `end` under constant inputs, segment by segment.

    This is the door: flat arrays come in and become records, because a record that crosses from Python costs half a
    microsecond.

    Parameters
    ----------
    c, f, at, size, row, start_c, start_f : arrays
        Workspace, `records.Tables`; its size sets the order.
    given, bodies, pairs, coulomb : arrays (3, 4), (3, 4), (2, 2), and float in N
        `records.Plant`.
    y, mode, clock : arrays (8,), (3,) and (2,)
        `records.State`, updated in place.
    end : float, s
        End of the integration on the clock.
    tolerance : float
        First neglected Taylor term, relative to the impact.
    max_work : int
        Budget of flights, contact steps and evaluations of event functions together.
    grid, rows, events, filled, work : arrays (n,), (n, 6), (m, 5), (6,) and (4,)
        `records.Output`, filled in place.

    Returns
    -------
    int
        A `layout.Outcome`. After SQUEEZED the next step is one of `squeezed.creep`. If it is none of DONE,
        EVENTS_FULL, WORK_USED and SQUEEZED, `rows` holds nothing of the segment that failed.
    """
    tables = Tables(c, f, at, size, row, Start(start_c, start_f))
    plant, state = Plant(given, bodies, pairs, coulomb), State(y, mode, clock)
    settings = new_settings(tolerance, row.shape[0] - 1, given)
    out = Output(grid, rows, events, filled, work)
    begin_interval(plant, state, out)
    idle = 0
    before = energy_level(plant, state, 0.0)
    while True:
        reached = write_reached(state, out)
        span = until(state.clock, end)
        outcome = may_go_on(span, max_work, out)
        if outcome != Outcome.GO_ON:
            return outcome
        settle_resting(plant, state, out)
        leave_together(plant, state, settings)
        clamped = is_clamped(state.mode)
        if must_start(state):
            t = start_segment(tables, plant, state, settings, span, out)
        elif state.mode[LEFT] == Pair.CONTACT or state.mode[RIGHT] == Pair.CONTACT:
            if is_squeezed(plant, state, span, out):
                return Outcome.SQUEEZED
            t = contact_segment(tables, plant, state, settings, span, out)
        else:
            t = flight_segment(tables, plant, state, settings, span, out)
        idle = 0 if t > 0.0 else idle + 1
        after = energy_level(plant, state, t)
        outcome = check_segment(plant, state, settings, before, after, t, idle, clamped)
        if outcome != Outcome.GO_ON:
            out.filled[Filled.OUTPUTS] = reached
            return outcome
        before = after

"""The event-driven integrator: closed-form flights and Taylor contacts, joined at the transitions of `modes`.

Within a segment the mode of both pairs is frozen. A segment ends at its first event in (t, t + h], at the end of
the span, or after one Taylor step; events closer to each other than a few roundings happen together.
"""

from __future__ import annotations

import math
from typing import Any

from grasp_ros.exact.automaton.modes import make_transitions, settle_pairs
from grasp_ros.exact.compensated import tick, until, write_penetrations
from grasp_ros.exact.compilation.jit import door, inlined
from grasp_ros.exact.contact.segment import cut_step, move_by_step, state_in_step, step_ends
from grasp_ros.exact.contact.step_unit import new_settings, within_decay
from grasp_ros.exact.contact.taylor_step import take_step
from grasp_ros.exact.driver.callback import REST, notify, tell
from grasp_ros.exact.driver.energy_check import check_segment, energy_level
from grasp_ros.exact.driver.intervals import answer_end, close_interval, enter_interval, open_interval, rest
from grasp_ros.exact.driver.outputs import due, may_go_on, write_reached, write_row
from grasp_ros.exact.driver.rest import SINCE, keep_scale, rests
from grasp_ros.exact.flight.segment import flight_ends, fly_free, move_by_flight, state_in_flight
from grasp_ros.exact.records import (
    Array,
    Ends,
    Integers,
    Level,
    Loop,
    Output,
    Plant,
    Segment,
    Settings,
    State,
    Tables,
    plant_of,
    state_of,
    tables_of,
)
from grasp_ros.physics.layout import LEFT, RIGHT, Cursor, Filled, Kind, Outcome, Pair

plant_in, state_in, tables_in = inlined(plant_of), inlined(state_of), inlined(tables_of)


@inlined
def next_segment(tables: Tables, plant: Plant, state: State, settings: Settings, span: float, work: Integers
                 ) -> tuple[Segment, Ends]:
    """The motion to its first event, to the end of the span, or as far as it is known; t: nan where a search fails."""
    if state.mode[LEFT] == Pair.CONTACT or state.mode[RIGHT] == Pair.CONTACT:
        span = within_decay(plant, state.mode, span)
        segment = take_step(tables, plant, state, settings, span, work)
        ends = step_ends(tables, plant, state, segment, work)
        return cut_step(tables, plant, state, segment, ends, span), ends
    segment = fly_free(plant, state, span, work)
    ends = flight_ends(tables.row, plant, state, segment, work)
    return Segment(segment.kind, ends.end, ends.end, segment.step, segment.flights), ends


@inlined
def move(tables: Tables, plant: Plant, segment: Segment, state: State) -> None:
    """Move the state on to the end of a segment."""
    if segment.kind == Kind.FLIGHT:
        move_by_flight(plant, segment, state)
    else:
        move_by_step(tables, plant, segment, state)
    write_penetrations(state)


@inlined
def deliver(tables: Tables, plant: Plant, segment: Segment, state: State, settings: Settings, out: Output) -> None:
    """Write the states at the output times before the end of a segment."""
    expanded = -1.0
    tau = due(state, out)
    while tau < segment.t:
        row = out.filled[Filled.OUTPUTS]
        if segment.kind == Kind.FLIGHT:
            expanded = state_in_flight(tables, plant, segment, settings, tau, expanded)
            write_row(out, row, tables.at)
        else:
            state_in_step(tables, segment, tau, out.rows[row])
        out.filled[Filled.OUTPUTS] = row + 1
        tau = due(state, out)


@inlined
def end_segment(tables: Tables, plant: Plant, state: State, settings: Settings, segment: Segment, ends: Ends,
                out: Output) -> None:
    """Move on to the end of a segment, write what it leaves behind, and make the transitions of its events."""
    move(tables, plant, segment, state)
    deliver(tables, plant, segment, state, settings, out)
    tick(state.clock, segment.t)
    notify(out.observer, segment)
    make_transitions(plant, state, ends, segment.s, out)


@door
def advance(
    block: Array, order: int, plant_block: Array, state_block: Array, mode: Integers, tolerance: float, max_work: int,
    grid: Array, rows: Array, events: Array, filled: Integers, work: Integers, observer: Integers,
    driven: tuple[Any, ...],
) -> int:
    """Integrate interval by interval, each segment by segment, from where the loop and the clock stand.

    Parameters
    ----------
    block, order : array and int
        Workspace, `records.tables_of`, for series up to an order.
    plant_block, state_block, mode : arrays
        `records.plant_of` and `records.state_of`, updated in place.
    tolerance : float
        First neglected Taylor term, relative to the impact.
    max_work : int
        Budget of flights, contact steps and evaluations of event functions together.
    grid, rows, events, filled, work, observer : arrays (n,), (n, 6), (m, 5), (2,), (4,) and (2,)
        `records.Output`, filled in place; output times in s from the begin of their interval.
    driven : tuple
        Fields of a `records.Loop`, updated in place; as a tuple, because numba takes 4 us to recognise a record.

    Returns
    -------
    int
        Value of a `layout.Outcome`, because an enum member would cost a microsecond. If it is none of DONE,
        EVENTS_FULL, WORK_BUDGET and NO_COMMAND, `rows` holds nothing of the segment that failed.
    """
    tables, plant, state = tables_in(block, order), plant_in(plant_block), state_in(state_block, mode)
    settings, loop = new_settings(tolerance, order, plant.given), Loop(*driven)
    out = Output(grid, rows, events, filled, work, observer)
    if loop.lengths.shape[0] == 0:
        return answer_end(state, loop).value
    end, idle, before, enters = 0.0, 0, Level(0.0, 0.0, 0.0, 0.0), True
    while True:
        if enters:
            if not open_interval(plant, state, loop):
                return Outcome.NO_COMMAND.value
            end, out = loop.lengths[loop.cursor[Cursor.INTERVAL]], enter_interval(plant, state, loop, out, grid)
            idle, before, enters = 0, energy_level(plant, state, 0.0), False
            keep_scale(state, before)
        reached = write_reached(state, out)
        span = until(state.clock, end)
        outcome = may_go_on(span, max_work, out)
        enters = outcome == Outcome.DONE and close_interval(loop)
        if enters:
            continue
        if outcome != Outcome.GO_ON:
            return outcome.value
        settle_pairs(plant, state, settings, out)
        if rests(plant, state):
            tell(out.observer, REST, span)
            rest(state, loop)
            continue
        state.rest[SINCE] = math.inf  # a segment moves on
        modes = (state.mode[LEFT], state.mode[RIGHT])
        segment, ends = next_segment(tables, plant, state, settings, span, out.work)
        if math.isnan(segment.t):
            return Outcome.STALLED.value
        end_segment(tables, plant, state, settings, segment, ends, out)
        idle = 0 if segment.t > 0.0 else idle + 1
        after = energy_level(plant, state, segment.t)
        outcome = check_segment(plant, state, settings, before, after, segment.t, idle, modes)
        if outcome != Outcome.GO_ON:
            out.filled[Filled.OUTPUTS] = reached
            return outcome.value
        before = after

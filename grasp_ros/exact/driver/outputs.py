"""What a run writes, states at the output times and events, and the budgets that limit it."""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import until
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.records import Array, Output, State
from grasp_ros.physics.layout import Body, Entry, Filled, Outcome, Transition, Work

SPARE = 8  # events that one segment can have: three per pair, and two of the object
STATES = 6  # columns of an output: x and v of each body


@kernel
def record(state: State, body: Body, kind: Transition, u: float, d: float, out: Output) -> None:
    """Append a row to the events."""
    n = out.filled[Filled.EVENTS]
    out.filled[Filled.EVENTS] = n + 1
    row = out.events[n]
    row[Entry.TIME] = (state.clock[0] + state.clock[1]) + state.clock[2]
    row[Entry.BODY] = body.value
    row[Entry.KIND] = kind.value
    row[Entry.U] = u
    row[Entry.RATE] = d


@inlined
def write_row(out: Output, row: int, y: Array) -> None:
    """Write positions and velocities to a row of the outputs."""
    for column in range(STATES):
        out.rows[row, column] = y[column]


@inlined
def due(state: State, out: Output) -> float:
    """Seconds from now to the next output time; inf if there is none."""
    row = out.filled[Filled.OUTPUTS]
    return until(state.clock, out.grid[row]) if row < out.grid.shape[0] else math.inf


@inlined
def write_reached(state: State, out: Output) -> int:
    """Write the state at all output times that are reached; returns the number of rows in use."""
    while due(state, out) <= 0.0:
        write_row(out, out.filled[Filled.OUTPUTS], state.y)
        out.filled[Filled.OUTPUTS] += 1
    return out.filled[Filled.OUTPUTS]


@inlined
def may_go_on(span: float, max_work: int, out: Output) -> Outcome:
    """Whether there is time left, room for events, and work to spend."""
    work = out.work
    if not span > 0.0:
        return Outcome.DONE
    if out.filled[Filled.EVENTS] + SPARE > out.events.shape[0]:
        return Outcome.EVENTS_FULL
    if work[Work.FLIGHTS] + work[Work.CONTACT_STEPS] + work[Work.ROOT_ITERATIONS] >= max_work:
        return Outcome.WORK_BUDGET
    return Outcome.GO_ON

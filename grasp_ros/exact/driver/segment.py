"""What is done with a segment, whatever it is: the outputs within it, and the state at its end."""

from __future__ import annotations

from grasp_ros.exact.compensated import keep_together, write_penetrations
from grasp_ros.exact.compilation.jit import inlined
from grasp_ros.exact.contact.segment import move_by_step, state_in_step
from grasp_ros.exact.driver.outputs import due, write_row
from grasp_ros.exact.flight.segment import move_by_flight, state_in_flight
from grasp_ros.exact.records import Output, Plant, Segment, Settings, State, Tables
from grasp_ros.physics.layout import LEFT, RIGHT, Filled, Kind, Pair


@inlined
def move(tables: Tables, plant: Plant, segment: Segment, state: State) -> None:
    """Move the state on to the end of a segment."""
    if segment.kind == Kind.FLIGHT:
        move_by_flight(plant, segment, state)
    else:
        move_by_step(tables, segment, state)
        for side in (LEFT, RIGHT):
            if state.mode[side] == Pair.RESTING:
                keep_together(state, side)
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

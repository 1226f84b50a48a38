"""Many runs in one call: rows of plants, each integrated to its end as `Integrator` does it, without the interpreter.

`driver.advance` is called by its address, because a second copy of its machine code would take as long to
compile as the first. What is out of the ordinary is left to `Integrator`: a row that ends otherwise than at the end of
its horizon is only marked.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numba.core import types

from grasp_ros.exact.compensated import write_penetrations
from grasp_ros.exact.compilation.jit import address_of_code, door, kernel
from grasp_ros.exact.driver.advance import advance
from grasp_ros.exact.driver.callback import ADDRESS, FINISH, tell
from grasp_ros.exact.driver.workspace import workspace
from grasp_ros.exact.integrator import BREATH, compile_kernels
from grasp_ros.exact.records import COULOMB, Array, Integers, Loop, Output, Plant, State, new_run, one_interval
from grasp_ros.observe.observer import BEGIN, RunObserver
from grasp_ros.observe.record import UNDECIDED, Memory, Seen, Switch, Wanted
from grasp_ros.physics.layout import Cursor, Entry, Filled, Of, Outcome, Pair, Transition, Work


class Rows(NamedTuple):
    """Plants of n rows, and what becomes of them."""

    which: Integers  # (k,) rows that are to be integrated
    loop: Array  # (n, 3, 4) bodies with the feedback
    own: Array  # (n, 3, 4) by themselves
    gains: Array  # (n, 2, 2)
    pairs: Array  # (n, 2, 2)
    coulomb: Array  # (n,)
    state: Array  # (n, 6); that at the end, afterwards
    seen: Array  # (n, k) what the observer remembers
    touches: Array  # (n, 2)
    outcome: Integers  # (n,) `Outcome`; DONE, or why the row is left to `Integrator`


class Room(NamedTuple):
    """Where one row at a time is computed: arguments of `advance`, and the records in their blocks."""

    block: Array  # of the workspace
    order: int
    plant_block: Array
    state_block: Array
    plant: Plant
    state: State
    out: Output  # without output times


class Limits(NamedTuple):
    """What bounds a row."""

    tolerance: float
    max_events: int
    max_work: int
    stop: Integers  # (1,) not 0: return after the row
    settled: float  # part of the largest displacement within which a row counts as settled
    horizons: int  # that a row may go on until V_c decides whether it has settled


@cache
class Advance(types.WrapperAddressProtocol):
    """`advance`, compiled where it has not been, for a call by its address."""

    def __init__(self) -> None:
        compile_kernels()
        dispatcher: Any = advance
        self._result = next(  # it may have been compiled for read-only arrays, too
            result for result in dispatcher.overloads.values() if all(
                kind.layout == "C" and kind.mutable for kind in result.signature.args if isinstance(kind, types.Array)))

    def __wrapper_address__(self) -> int:
        """Address of its machine code."""
        return address_of_code(self._result)

    def signature(self) -> Any:
        """Types of its arguments and of its result."""
        return self._result.signature


@kernel
def load_row(rows: Rows, i: int, room: Room, memory: Memory) -> None:
    """Put one row where it is computed."""
    for body in range(3):
        for column in range(4):
            value = rows.loop[i, body, column]
            memory.loop[body, column] = memory.base[body, column] = value
            memory.own[body, column] = rows.own[i, body, column]
            room.plant.given[body, column] = 1.0 if column == Of.MASS and value == 0.0 else value
    for side in range(2):
        for column in range(2):
            memory.gains[side, column] = rows.gains[i, side, column]
            room.plant.pairs[side, column] = rows.pairs[i, side, column]
    for column in range(6):
        room.state.y[column] = rows.state[i, column]
    room.plant_block[COULOMB] = rows.coulomb[i]
    state, out = room.state, room.out
    state.mode[:], state.clock[:], state.low[:], state.rest[:] = Pair.UNKNOWN.value, 0.0, 0.0, 0.0
    out.filled[:], out.work[:] = 0, 0
    write_penetrations(state)


@kernel
def run_row(move: Any, driven: tuple[Any, ...], rows: Rows, i: int, room: Room, limits: Limits) -> int:
    """Integrate a row over the interval of the loop, and count its touches; why it ended."""
    cursor = Loop(*driven).cursor
    cursor[Cursor.INTERVAL] = cursor[Cursor.BEGUN] = 0
    outcome, events, out = np.int64(Outcome.EVENTS_FULL.value), 0, room.out
    while outcome == Outcome.EVENTS_FULL and events <= limits.max_events:
        outcome = move(
            room.block, room.order, room.plant_block, room.state_block, room.state.mode, limits.tolerance,
            limits.max_work, out.grid, out.rows, out.events, out.filled, out.work, out.observer, driven)
        for k in range(out.filled[Filled.EVENTS]):
            if out.events[k, Entry.KIND] == Transition.TOUCH.value:
                rows.touches[i, int(out.events[k, Entry.BODY])] += 1.0
        events += out.filled[Filled.EVENTS]
        out.filled[Filled.EVENTS] = 0
    return int(outcome if events <= limits.max_events else Outcome.EVENTS_FULL.value)


@kernel
def go_on(move: Any, driven: tuple[Any, ...], rows: Rows, i: int, room: Room, memory: Memory, limits: Limits) -> int:
    """Go on with a row as `observer.settle` does, until V_c decides; why it ended."""
    seen, outcome, done, loop = memory.seen, Outcome.DONE.value, 1, Loop(*driven)
    wanted, memory.switches[Switch.WANTED] = memory.switches[Switch.WANTED], Wanted.SETTLING.value
    left, right = rows.touches[i, 0], rows.touches[i, 1]
    while seen[Seen.SETTLED] == UNDECIDED and done < limits.horizons and outcome == Outcome.DONE:
        loop.begins[0] = done * loop.lengths[0]
        outcome = run_row(move, driven, rows, i, room, limits)
        tell(room.out.observer, FINISH, 0.0)
        done += 1
    loop.begins[0] = 0.0
    rows.touches[i, 0], rows.touches[i, 1] = left, right
    if seen[Seen.SETTLED] == UNDECIDED:
        seen[Seen.SETTLED] = math.inf
    memory.switches[Switch.WANTED] = wanted
    return int(outcome)


@door
def run_rows(move: Any, driven: tuple[Any, ...], rows: Rows, room: Room, memory: Memory, limits: Limits) -> None:
    """Integrate the rows, or fewer if `limits.stop` is set meanwhile."""
    for i in rows.which:
        if limits.stop[0] != 0:
            break
        load_row(rows, i, room, memory)
        tell(room.out.observer, BEGIN, limits.settled)
        outcome = run_row(move, driven, rows, i, room, limits)
        for column in range(6):
            rows.state[i, column] = room.state.y[column]
        if room.out.observer[ADDRESS] != 0:
            tell(room.out.observer, FINISH, 0.0)
            if outcome == Outcome.DONE and memory.switches[Switch.WANTED] & Wanted.SETTLING.value:
                outcome = go_on(move, driven, rows, i, room, memory, limits)
            for column in range(memory.seen.shape[0]):
                rows.seen[i, column] = memory.seen[column]
        rows.outcome[i] = outcome


def integrate_rows(rows: Rows, duration: float, wanted: Wanted, limits: Limits) -> None:
    """Integrate rows of one length, a duration in s, under continuous feedback; they are updated in place.

    What takes longer than `BREATH` is left to `Integrator`, too. Another thread may set `Limits.stop`.
    """
    run = new_run()
    run_observer = RunObserver(*run[2:], wanted)
    driven = tuple(one_interval(duration, 0.0, 0))
    run_observer.memory.switches[Switch.CERTAIN] = 1
    limits = limits._replace(max_work=min(limits.max_work, BREATH))
    with workspace(limits.tolerance) as (block, order, tables, events):
        observer = run_observer.attach(tables) if wanted else np.zeros(2, dtype=np.int64)
        room = Room(block, order, *run, Output(
            np.zeros(0), np.zeros((0, 6)), events, np.zeros(len(Filled), dtype=np.int64),
            np.zeros(len(Work), dtype=np.int64), observer))
        run_rows(Advance(), driven, rows, room, run_observer.memory, limits)

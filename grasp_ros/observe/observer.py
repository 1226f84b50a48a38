"""The observer of a run: what it remembers after each segment, what follows at the end, and its memory."""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import door, inlined, kernel
from grasp_ros.exact.driver.callback import FINISH, REST, Observer, address_of, call
from grasp_ros.exact.impact import elastic_force, stored_energy
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Array, Plant, State
from grasp_ros.observe.extremes import extremes_of, may_exceed, owner, weights, write_ranges
from grasp_ros.observe.losses import add_losses
from grasp_ros.observe.record import (
    QUANTITIES,
    SEEN,
    STATES,
    UNDECIDED,
    Memory,
    Quantity,
    Seen,
    SegmentRecord,
    Switch,
    Wanted,
    memory_at,
    memory_of,
)
from grasp_ros.observe.settling import settled_from, watch_bound
from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of, Pair, U, X

BEGIN = -2  # in place of a kind of segment


@kernel
def level(loop: Array, pairs: Array, y: Array) -> float:
    """V_c of a state, J."""
    total = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        row, lane = loop[body], velocity_lane(body)
        x, v = y[lane - 1], y[lane]
        total += row[Of.MASS] * v * v
        if row[Of.STIFFNESS] > 0.0:
            away = x - row[Of.FORCE] / row[Of.STIFFNESS]
            total += row[Of.STIFFNESS] * away * away
        else:
            total -= 2.0 * row[Of.FORCE] * x
    for side in (LEFT, RIGHT):
        if pairs[side, Law.HERTZIAN] > 0.0:
            total += 2.0 * stored_energy(pairs[side, Law.HERTZIAN], max(y[U.L + side], 0.0))
    return total


@inlined
def is_wanted(segment: SegmentRecord, q: int, wanted: int) -> bool:
    """Whether the extremes of a quantity are kept; those of an impact only while there is one."""
    if q < U.L:
        return wanted & Wanted.MOTION.value != 0
    if q >= Quantity.INPUT_L:
        return wanted & Wanted.INPUTS.value != 0
    return wanted & Wanted.IMPACTS.value != 0 and segment.m.mode[q % 2] == Pair.CONTACT


@inlined
def keep(seen: Array, q: int, low: float, high: float) -> None:
    """Keep the least and the largest value of a quantity."""
    seen[Seen.LOW + q] = min(seen[Seen.LOW + q], low)
    seen[Seen.HIGH + q] = max(seen[Seen.HIGH + q], high)


@inlined
def watch_quantities(segment: SegmentRecord, seen: Array, wanted: int) -> None:
    """Keep the extremes of what is wanted, where its range may hold new ones."""
    for q in range(QUANTITIES):
        if is_wanted(segment, q, wanted) and may_exceed(segment, q, seen[Seen.LOW + q], seen[Seen.HIGH + q]):
            keep(seen, q, *extremes_of(segment, q))


@kernel
def watch_rest(segment: SegmentRecord, seen: Array, wanted: int) -> None:
    """The same where nothing moves: a run may begin so, and under other inputs than before."""
    y, pairs = segment.m.y, segment.m.pairs
    for q in range(QUANTITIES):
        if is_wanted(segment, q, wanted):
            if q < Quantity.IMPACT_L:
                value = y[q]
            elif q < Quantity.INPUT_L:
                value = elastic_force(pairs[q % 2, Law.HERTZIAN], y[U.L + q % 2])
            else:
                (a, b, c), lane = weights(segment, q), velocity_lane(owner(q))
                value = a * y[lane - 1] + b * y[lane] + c
            keep(seen, q, value, value)


@kernel
def begin(m: Memory, bound: float) -> None:
    """Forget the last run, and remember the state at which this one begins."""
    seen, y = m.seen, m.y
    for place in range(SEEN):
        seen[place] = 0.0
    for q in range(QUANTITIES):
        seen[Seen.LOW + q], seen[Seen.HIGH + q] = math.inf, -math.inf
    for side in (LEFT, RIGHT):  # a pair may begin closed without force
        if m.pairs[side, Law.HERTZIAN] > 0.0 and y[U.L + side] > 0.0:
            seen[Seen.HIGH + U.L + side] = y[U.L + side]
    for place in range(STATES):
        m.before[place] = y[place]
    seen[Seen.LEVEL] = seen[Seen.LEAST] = level(m.loop, m.pairs, y)
    seen[Seen.BOUND], seen[Seen.SETTLED] = bound * max(abs(y[X.L]), abs(y[X.O]), abs(y[X.R])), math.nan
    for body in (LEFT, OBJECT, RIGHT):
        if abs(y[velocity_lane(body) - 1]) > seen[Seen.BOUND]:
            seen[Seen.OUTSIDE + body] = math.inf


@door
def observe(address: int, kind: int, t: float, s: float, unit: float, degree: int) -> int:
    """Remember what is wanted of a segment of t s, which has just ended; called by `callback.notify`.

    Before a run it is called with BEGIN and the part of the largest displacement that counts as settled; after it with
    FINISH, and with REST where nothing moves.
    """
    m = memory_at(address)
    segment, seen, wanted = SegmentRecord(kind, t, s, degree, m), m.seen, m.switches[Switch.WANTED]
    if kind == BEGIN:
        begin(m, t)
        return 0
    if kind == FINISH:
        if wanted & Wanted.BOUND.value:
            for body in (LEFT, OBJECT, RIGHT):
                seen[Seen.LAST_OUTSIDE + body] = seen[Seen.OUTSIDE + body]
        if m.switches[Switch.CERTAIN] != 0:
            seen[Seen.SETTLED] = settled_from(m, level(m.loop, m.pairs, m.y))
        return 0
    if kind == REST:
        watch_rest(segment, seen, wanted)
        return 0
    if not math.isfinite(m.y.sum() + t):
        return 0
    bound = wanted & (Wanted.SETTLING.value | Wanted.BOUND.value)
    if bound or wanted & (Wanted.MOTION.value | Wanted.IMPACTS.value | Wanted.INPUTS.value):
        write_ranges(segment)
        watch_quantities(segment, seen, wanted)
    if bound:
        watch_bound(segment, seen, m.clock[2] + (m.clock[0] + m.clock[1]))
    if m.switches[Switch.LOSSES] != 0:
        call(m.switches[Switch.LOSSES], address, kind, t, s, unit, degree)
    if wanted & Wanted.RISE.value:
        seen[Seen.LEVEL] = level(m.loop, m.pairs, m.y)
        seen[Seen.RISE] = max(seen[Seen.RISE], seen[Seen.LEVEL] - seen[Seen.LEAST])
        seen[Seen.LEAST] = min(seen[Seen.LEAST], seen[Seen.LEVEL])
    for place in range(STATES):
        m.before[place] = m.y[place]
    return 0


@door
def observe_losses(address: int, kind: int, t: float, s: float, unit: float, degree: int) -> int:
    """Add the losses of a segment; a function of its own, so that only who asks for them waits for its compilation."""
    m = memory_at(address)
    add_losses(SegmentRecord(kind, t, s, degree, m), m.base, m.seen)
    return 0


class RunObserver(Observer):
    """Watches the runs that use the arrays of one plant and one state, one run after the other.

    Parameters
    ----------
    plant, state : Plant and State
        Of the runs; their arrays stay where they are.
    wanted : Wanted

    Attributes
    ----------
    memory : Memory
        `loop`, `own`, `base`, `gains` and the switch CERTAIN are to be filled before a run.
    seen : array, see `record.Seen`
        What is remembered.
    """

    TABLES = "c", "size"

    def __init__(self, plant: Plant, state: State, wanted: Wanted) -> None:
        super().__init__(observe, memory_of(plant, state))
        self.seen, switches = self.memory.seen, self.memory.switches
        switches[Switch.WANTED] = wanted
        switches[Switch.LOSSES] = address_of(observe_losses) if wanted & Wanted.LOSSES else 0


def settle(integrator: Integrator, run_observer: RunObserver, stretch: float, horizons: int) -> None:
    """Continue an observed run by `stretch` seconds at a time until V_c decides whether it has settled.

    SETTLED is nan if the run stops before, at its budget say.
    """
    run_observer.memory.switches[: Switch.CERTAIN] = Wanted.SETTLING, 0
    seen, done = run_observer.seen, 1
    while seen[Seen.SETTLED] == UNDECIDED and done < horizons:
        integrator.advance(stretch, start=done * stretch)
        if integrator.status is not Status.DONE:
            seen[Seen.SETTLED] = np.nan
            return
        run_observer.finish()
        done += 1
    if seen[Seen.SETTLED] == UNDECIDED:
        seen[Seen.SETTLED] = np.inf


def watch(integrator: Integrator, wanted: Wanted, bound: float) -> RunObserver:
    """Watch a run from here on; `bound` is the part of the largest displacement that counts as settled."""
    run_observer, system = RunObserver(integrator.plant, integrator.records, wanted), integrator.system
    memory = run_observer.memory
    memory.loop[:], memory.own[:], memory.base[:] = system.closed_loop, system.bodies, system.bodies
    if integrator.continuous:
        memory.base[:], memory.switches[Switch.CERTAIN] = memory.loop, not system.caveats
        memory.gains[:] = system.law_rows[:, : Column.SET_POINT]
    run_observer.tell(BEGIN, float(bound))
    integrator.observer = run_observer
    return run_observer

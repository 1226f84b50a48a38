"""The observer of a run: what it remembers after each segment, what follows at the end, and its memory."""

from __future__ import annotations

import math

import numpy as np

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import door, kernel
from grasp_ros.exact.driver.callback import FINISH, REST, Observer
from grasp_ros.exact.impact import stored_energy
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.exact.records import Array, Plant, State
from grasp_ros.observe.extremes import watch_extremes, watch_rest, write_ranges
from grasp_ros.observe.losses import add_losses
from grasp_ros.observe.record import UNDECIDED, Memory, Seen, SegmentRecord, Switch, Wanted, memory_at, memory_of
from grasp_ros.observe.settling import settled_from, watch_bound
from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Law, Of, U, X

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


@kernel
def begin(m: Memory, bound: float) -> None:
    """Forget the last run, and remember the state at which this one begins."""
    seen, y = m.seen, m.y
    seen[:], seen[Seen.LOW : Seen.HIGH], seen[Seen.HIGH : Seen.DAMPERS] = 0.0, math.inf, -math.inf
    for side in (LEFT, RIGHT):  # a pair may begin closed without force
        if m.pairs[side, Law.HERTZIAN] > 0.0 and y[U.L + side] > 0.0:
            seen[Seen.HIGH + U.L + side] = y[U.L + side]
    for i in range(y.shape[0]):
        m.before[i] = y[i]
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
        watch_extremes(segment, seen, wanted)
    if bound:
        watch_bound(segment, seen, m.clock[2] + (m.clock[0] + m.clock[1]))
    if wanted & Wanted.LOSSES.value:
        add_losses(segment)
    if wanted & Wanted.RISE.value:
        seen[Seen.LEVEL] = level(m.loop, m.pairs, m.y)
        seen[Seen.RISE] = max(seen[Seen.RISE], seen[Seen.LEVEL] - seen[Seen.LEAST])
        seen[Seen.LEAST] = min(seen[Seen.LEAST], seen[Seen.LEVEL])
    for i in range(m.y.shape[0]):
        m.before[i] = m.y[i]
    return 0


class RunObserver(Observer):
    """Watches the runs that use the arrays of one plant and one state, which stay where they are, one after the other.

    Of `memory` the arrays `loop`, `own`, `base`, `gains` and the switch CERTAIN are to be filled before a run. `seen`
    is what is remembered, see `record.Seen`.
    """

    TABLES = "c", "size"

    def __init__(self, plant: Plant, state: State, wanted: Wanted) -> None:
        super().__init__(observe, memory_of(plant, state))
        self.seen = self.memory.seen
        self.memory.switches[Switch.WANTED] = wanted


def settle(integrator: Integrator, run_observer: RunObserver, stretch: float, horizons: int) -> None:
    """Continue an observed run by `stretch` seconds at a time until V_c decides whether it has settled.

    SETTLED is nan if the run stops before, at its budget say.
    """
    run_observer.memory.switches[Switch.WANTED] = Wanted.SETTLING
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

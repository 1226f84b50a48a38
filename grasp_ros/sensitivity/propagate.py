"""The tangents of a run, carried along: a segment callback that moves them over each segment when it has ended.

The impact law is continuous at u = 0 and at u' = -1/p, so that a tangent passes a touch, a release, a clamp and a
re-entry as it is: the saltation matrix is the identity. What jumps is the force of dry friction. An object that stops
to stick loses the tangent of its velocity; one that turns has it multiplied by the ratio of its accelerations.

Source: R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems (Springer 2004), chapter
7: the saltation matrix.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import allocating, kernel
from grasp_ros.exact.impact import damping_factor, elastic_force, elastic_slope
from grasp_ros.exact.kinematics import approach
from grasp_ros.exact.records import Array
from grasp_ros.physics.layout import EPS, LEFT, OBJECT, RIGHT, Body, Kind, Law, Of, Pair, Slide, U, V, X
from grasp_ros.sensitivity.contact import expand_tangents, step_tangents, touches, variable_at
from grasp_ros.sensitivity.flight import fly_tangent, rest_tangent
from grasp_ros.sensitivity.held import act, enter_tick
from grasp_ros.sensitivity.tangents import Count, Motion, Number, Outputs, Rates, Tangents, put, tangents_at

FINISH = -1  # in place of a kind of segment
GAP = 64.0 * EPS  # of the time: what is longer was rest, of which no segment tells
UNSEEN = -1  # slide before the first segment


@kernel
def impact_now(motion: Motion, side: Body) -> float:
    """Impact force of a pair at the begin of a segment, N."""
    if motion.mode[side] != Pair.CONTACT:
        return 0.0
    u, d = max(motion.before[U.L + side], 0.0), approach(motion.before, side)
    return elastic_force(motion.pairs[side, Law.HERTZIAN], u) * damping_factor(motion.pairs[side, Law.DISSIPATION], d)


@kernel
def scale_object(moved: Array, factor: float) -> None:
    """Multiply the tangents of the object's velocity."""
    for j in range(moved.shape[1]):
        moved[V.O, j] *= factor


@kernel
def turning_ratio(motion: Motion, old: Array) -> float:
    """Acceleration of an object after it turns, by that before, with its row (4,) before; nan: it had none."""
    push, new = impact_now(motion, LEFT) - impact_now(motion, RIGHT), motion.bodies[OBJECT]
    push -= new[Of.STIFFNESS] * motion.before[X.O] + new[Of.DAMPING] * motion.before[V.O]
    first = push + old[Of.FORCE]
    return (push + new[Of.FORCE]) / first if first != 0.0 else math.nan


@kernel
def pass_friction(motion: Motion, moved: Array, outputs: Outputs) -> None:
    """The jump of the tangents where the mode of an object under dry friction has changed."""
    before, now = outputs.counts[Count.SLIDE], motion.mode[OBJECT]
    if now == Slide.FREE or now == before:
        return
    factor = 1.0
    if now == Slide.STUCK:
        factor = 0.0
    elif before == Slide.RIGHTWARD or before == Slide.LEFTWARD:
        factor = turning_ratio(motion, outputs.numbers[Number.OBJECT :])
    elif before == UNSEEN and motion.before[V.O] == 0.0:
        for j in range(moved.shape[1]):
            if moved[V.O, j] != 0.0:
                factor = math.nan
    if math.isnan(factor):  # the one-sided derivatives differ
        outputs.numbers[Number.CORNER] = min(outputs.numbers[Number.CORNER], outputs.numbers[Number.TIME])
    else:
        scale_object(moved, factor)


@kernel
def write_output(motion: Motion, outputs: Outputs, rates: Rates) -> None:
    """Write what stands in `at` to the next output, and the forces that act."""
    row, n = outputs.counts[Count.FILLED], rates.x.shape[1]
    for body in (LEFT, RIGHT, OBJECT):
        outputs.forces[row, body, n] = motion.bodies[body, Of.FORCE]
        for j in range(n):
            outputs.forces[row, body, j] = rates.acting[body, Of.FORCE, j]
    put(outputs.out[row], rates.at)
    outputs.counts[Count.FILLED] = row + 1


@kernel
def is_due(outputs: Outputs, time: float) -> bool:
    """Whether an output is due up to a time."""
    row = outputs.counts[Count.FILLED]
    return bool(row < outputs.grid.shape[0] and outputs.grid[row] <= time)


@kernel
def since(outputs: Outputs, begin: float, span: float) -> float:
    """Time from a begin to the next output, within a span."""
    return min(max(outputs.grid[outputs.counts[Count.FILLED]] - begin, 0.0), span)


@kernel
def rest_until(t: Tangents, time: float) -> None:
    """Go on to a time at rest, if no segment has led there."""
    now = t.outputs.numbers[Number.TIME]
    if time - now <= GAP * time:
        return
    if t.motion.mode[OBJECT] != Slide.FREE:
        scale_object(t.rates.x, 0.0)
    act(t.motion.mode, t.rates, t.inputs)
    due = True
    while due:
        due = is_due(t.outputs, time)
        rest_tangent(t.motion, t.rates, t.matrices, since(t.outputs, now, time - now) if due else time - now)
        if due:
            write_output(t.motion, t.outputs, t.rates)
    put(t.rates.x, t.rates.at)
    t.outputs.numbers[Number.TIME] = time


@kernel
def arrive(t: Tangents, interval: float, time: float) -> None:
    """Take the ticks up to the begin of an interval, each at its time, and go on to a time."""
    counts, period = t.outputs.counts, t.outputs.numbers[Number.PERIOD]
    last = math.floor(interval / period + 0.5) if counts[Count.DRIVEN] else counts[Count.TICK]
    while True:
        ticks = counts[Count.TICK] < last
        rest_until(t, (counts[Count.TICK] + 1) * period if ticks else time)
        if not ticks:
            return
        counts[Count.TICK] += 1
        enter_tick(t.inputs, t.motion.before, t.rates.x, counts[Count.TICK])


@kernel
def add_neglected(motion: Motion, moved: Array, side: Body, span: float) -> None:
    """Add the slope of the force of a pair that begins or leaves: its impulse is below rounding, its slope is not."""
    u, after, arm = motion.before[U.L + side], motion.y[U.L + side], velocity_lane(side)
    turn = 0.125 * span * (approach(motion.before, side) - approach(motion.y, side))
    middle = max(0.5 * (u + after) + turn, 0.0)
    root = (math.sqrt(max(u, 0.0)) + 4.0 * math.sqrt(middle) + math.sqrt(max(after, 0.0))) / 6.0
    impulse = span * elastic_slope(motion.pairs[side, Law.HERTZIAN], root * root)
    arm_mass, mass = motion.bodies[side, Of.MASS], motion.bodies[OBJECT, Of.MASS]
    for j in range(moved.shape[1]):
        apart = moved[arm - 1, j] - moved[X.O, j]
        moved[arm, j] -= impulse * apart / arm_mass
        moved[V.O, j] += impulse * apart / mass


@kernel
def pass_segment(t: Tangents, kind: int, begin: float, span: float, s: float, n: int) -> None:
    """Move the tangents over a segment, and write the outputs on the way."""
    motion, rates, presses = t.motion, t.rates, kind != Kind.FLIGHT
    act(motion.mode, rates, t.inputs)
    if presses:
        expand_tangents(motion, rates, t.table, n)
    due = True
    while due:
        due = is_due(t.outputs, t.outputs.numbers[Number.TIME])
        tau = since(t.outputs, begin, span) if due else span
        for body in (LEFT, OBJECT, RIGHT):
            if not (presses and touches(motion, body)):
                fly_tangent(motion, rates, t.matrices, body, tau)
        if presses:
            step_tangents(motion, rates, t.table, n, variable_at(motion.c, n, s, tau) if due else s)
        if due:
            write_output(t.motion, t.outputs, rates)
    put(rates.x, rates.at)
    for side in (LEFT, RIGHT):
        if motion.mode[side] == Pair.BEGINNING or motion.mode[side] == Pair.LEAVING:
            add_neglected(motion, rates.x, side, span)


@kernel
def remember(t: Tangents) -> None:
    """Keep what the next segment begins with."""
    t.outputs.counts[Count.SLIDE] = t.motion.mode[OBJECT]
    for column in range(4):
        t.outputs.numbers[Number.OBJECT + column] = t.motion.bodies[OBJECT, column]
    for place in range(t.motion.y.shape[0]):
        t.motion.before[place] = t.motion.y[place]


@allocating
def propagate(address: int, kind: int, span: float, s: float, degree: int) -> int:
    """Carry the tangents over a segment, which has just ended; called by `callback.notify`.

    After a run it is called with FINISH and the time of its end.
    """
    t = tangents_at(address)
    clock, ends = t.motion.clock, kind == FINISH
    begin = span if ends else (clock[0] + clock[1] - span) + clock[2]
    if not math.isfinite(span):
        return 0
    if not ends:
        pass_friction(t.motion, t.rates.x, t.outputs)
    arrive(t, span * (1.0 - GAP) if ends else clock[2], begin)
    if ends:
        put(t.rates.at, t.rates.x)
        while is_due(t.outputs, math.inf):
            write_output(t.motion, t.outputs, t.rates)
        return 0
    t.outputs.numbers[Number.TIME] = (clock[0] + clock[1]) + clock[2]
    pass_segment(t, kind, begin, span, s, degree)
    remember(t)
    return 0

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
from grasp_ros.exact.compilation.jit import door, kernel
from grasp_ros.exact.compilation.vectors import load, store
from grasp_ros.exact.driver.callback import FINISH, REST
from grasp_ros.exact.driver.intervals import feedback, is_due, measured
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.exact.kinematics import approach, arm_of, own_acceleration, surface_factor
from grasp_ros.exact.numerics.polynomial import invert_time
from grasp_ros.exact.numerics.roots import value_and_rate
from grasp_ros.exact.records import Array, Order, Step
from grasp_ros.exact.tolerances import SURFACE
from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, Law, Of, Pair, Slide, U, V, X
from grasp_ros.sensitivity.contact import add_neglected, exact_length, expand_tangents, step_tangents, touches
from grasp_ros.sensitivity.flight import fly_tangent, rest_tangent, write_flow_at_rest, write_flows
from grasp_ros.sensitivity.tangents import (
    UNSEEN,
    Corner,
    Count,
    Number,
    Tangents,
    copy_matrix,
    note_corner,
    tangents_at,
)

SAME = 16.0 * EPS  # of the time: steps that differ by less are equal, and the sum of the differences stays below


@kernel
def act(t: Tangents) -> None:
    """Write how the directions change what acts on the bodies in a segment."""
    for body in (LEFT, RIGHT, OBJECT):
        copy_matrix(t.acting[body], t.given[body])
        for j in range(t.force.shape[1]):
            t.acting[body, Of.FORCE, j] += t.force[body, j]
    slide = t.mode[OBJECT]
    if slide in (Slide.RIGHTWARD, Slide.LEFTWARD):
        against = -1.0 if slide == Slide.RIGHTWARD else 1.0
        for j in range(t.force.shape[1]):
            t.acting[OBJECT, Of.FORCE, j] += against * t.coulomb[j]


@kernel
def answer(t: Tangents, side: Body, tick: int, j: int) -> tuple[float, bool]:
    """Derivative of what a sampled controller answers to the state of a tick, N by the unit of a direction.

    Beyond its limit an actuator hands on nothing of the state. Just at it one-sided derivatives differ: the second
    answer.
    """
    row, rates, lane = t.control[side], t.control_rates[side], velocity_lane(side)
    normals = t.normals[side, min(tick, t.normals.shape[1] - 1)]
    x, v = measured(row, normals, t.before[lane - 1], t.before[lane])
    force = feedback(row, x, v)
    limited = math.copysign(1.0, force) * rates[Column.LIMIT, j] if force != 0.0 else 0.0
    if abs(force) > row[Column.LIMIT] or row[Column.LIMIT] == 0.0:
        return limited, False
    away = t.x[lane - 1, j] + rates[Column.POSITION_NOISE, j] * normals[0] - rates[Column.SET_POINT, j]
    faster = t.x[lane, j] + rates[Column.VELOCITY_NOISE, j] * normals[1]
    free = (rates[Column.FEED_FORWARD, j] - row[Column.POSITION_GAIN] * away - row[Column.VELOCITY_GAIN] * faster
            - rates[Column.POSITION_GAIN, j] * (x - row[Column.SET_POINT]) - rates[Column.VELOCITY_GAIN, j] * v)
    return free, abs(force) == row[Column.LIMIT] and free != limited


@kernel
def enter_tick(t: Tangents, tick: int) -> bool:
    """Let the inputs of a control period act, answers that arrive and external forces; whether one is at its limit."""
    corner, delay = False, t.waiting.shape[0]
    slot = tick % delay if delay > 0 else 0
    for body in (LEFT, RIGHT, OBJECT):
        for j in range(t.force.shape[1]):
            force = 0.0
            if body != OBJECT and is_due(t.control[body], tick):
                t.held[body, j], edge = answer(t, body, tick, j)
                corner = corner or edge
            if body != OBJECT:
                force = t.held[body, j]
            if delay > 0 and body != OBJECT:
                force, t.waiting[slot, body, j] = t.waiting[slot, body, j], force
            if tick < t.external.shape[0]:
                force += t.external[tick, body, j]
            t.force[body, j] = force
    return corner


@kernel
def impact_now(t: Tangents, side: Body) -> float:
    """Impact force of a pair at the begin of a segment, N."""
    if t.mode[side] != Pair.CONTACT:
        return 0.0
    u, d = max(t.before[U.L + side], 0.0), approach(t.before, side)
    return elastic_force(t.pairs[side, Law.HERTZIAN], u) * damping_factor(t.pairs[side, Law.DISSIPATION], d)


@kernel
def pass_friction(t: Tangents, at_tick: bool) -> None:
    """The jump of the tangents where the mode of an object under dry friction has changed: v_o times a factor.

    Where the object turns, that is its acceleration after the turn by that before it. It is nan where the one-sided
    derivatives differ. Where an object stops just when inputs change, it is undecided which of them would act on it.
    """
    before, now, factor, why = t.counts[Count.SLIDE], t.mode[OBJECT], 1.0, Corner.TURN
    if now == Slide.FREE or now == before:
        return
    slid = before == Slide.RIGHTWARD or before == Slide.LEFTWARD
    if slid and at_tick:
        factor, why = math.nan, Corner.STOP
    elif now == Slide.STUCK:
        factor = 0.0
    elif slid:
        push, new = impact_now(t, LEFT) - impact_now(t, RIGHT), t.bodies[OBJECT]
        push -= new[Of.STIFFNESS] * t.before[X.O] + new[Of.DAMPING] * t.before[V.O]
        first = push + t.numbers[Number.FORCE]  # under the constant force before
        factor = (push + new[Of.FORCE]) / first if first != 0.0 else math.nan
    elif before == UNSEEN and t.before[V.O] == 0.0 and t.x[V.O].any():
        factor, why = math.nan, Corner.START
    if math.isnan(factor):
        note_corner(t, t.numbers[Number.TIME], why)
        return
    for j in range(t.x.shape[1]):
        t.x[V.O, j] *= factor


@kernel
def check_glide(t: Tangents) -> None:
    """Note a run that begins with a pair at u' = -1/p which nothing moves off: a change to one side has a force."""
    row, y = t.bodies[OBJECT], t.before
    pushed = (impact_now(t, LEFT) - impact_now(t, RIGHT)) / row[Of.MASS]
    for side in (LEFT, RIGHT):
        loss, d, arm = t.pairs[side, Law.DISSIPATION], approach(y, side), velocity_lane(side)
        x, v, sign = arm_of(y, side)
        if y[U.L + side] <= 0.0 or surface_factor(t.pairs, y, side, SURFACE) != 0.0:
            continue
        if own_acceleration(t.bodies[side], x, v) != own_acceleration(row, y[X.O], y[V.O]) + pushed:
            continue
        for j in range(t.x.shape[1]):
            faster = sign * (t.x[arm, j] - t.x[V.O, j])
            if t.law[side, Law.DISSIPATION, j] * d + loss * faster != 0.0:
                note_corner(t, 0.0, Corner.GLIDE)


@kernel
def write_output(t: Tangents) -> None:
    """Write what stands in `at` to the next output, and what acts on the bodies where it is wanted."""
    row = t.order[t.counts[Count.FILLED]]
    copy_matrix(t.out[row], t.at)
    t.counts[Count.FILLED] += 1
    row -= t.out.shape[0] - t.forces.shape[0]
    if row < 0:
        return
    for body in (LEFT, RIGHT, OBJECT):
        t.forces[row, body, 0] = t.bodies[body, Of.MASS]
        t.forces[row, body, 1] = t.bodies[body, Of.FORCE]
        for j in range(t.out.shape[2]):
            t.forces[row, body, 2 + j] = t.acting[body, Of.FORCE, j]


@kernel
def next_output(t: Tangents) -> float:
    """Time of the next output, s; inf: there is none."""
    row = t.counts[Count.FILLED]
    return t.grid[row] if row < t.grid.shape[0] else math.inf


@kernel
def since(t: Tangents, begin: float, span: float) -> float:
    """Time from a begin to the next output, within a span."""
    return min(max(next_output(t) - begin, 0.0), span)


@kernel
def fly_free(t: Tangents, presses: bool, tau: float) -> None:
    """Write the tangents of the bodies that touch nothing after tau s of a segment to `at`."""
    if presses and touches(t, LEFT) and touches(t, RIGHT):
        return
    write_flows(t, tau)
    for body in (LEFT, OBJECT, RIGHT):
        if not (presses and touches(t, body)):
            fly_tangent(t, body)


@kernel
def shift_table(c: Array, n: int, s: float) -> None:
    """Expand a Taylor table of degree n about s instead of 0, all lanes at a time, see `roots.shift`."""
    for first in range(n):
        above = load(c, LANES * n)
        for i in range(LANES * (n - 1), LANES * (first - 1), -LANES):
            above = load(c, i) + s * above
            store(c, i, above)


@kernel
def pass_step(t: Tangents, begin: float, span: float, s: float, unit: float, n: int) -> None:
    """Move the tangents over a Taylor step, in parts where their series end later than those of the run."""
    step = Step(Order(n, 0.0, 0), unit, touches(t, LEFT), touches(t, RIGHT))
    while True:
        expand_tangents(t, n)
        part = exact_length(t, n, s)
        ends = part == s
        reached = span if ends else value_and_rate(t.c[Lane.TIME :: LANES], n, part)[0]
        while next_output(t) < (t.numbers[Number.TIME] if ends else begin + reached):
            tau = since(t, begin, span)
            fly_free(t, True, tau)
            at = invert_time(t.c, t.products[0], step, tau, part, reached)
            step_tangents(t, n, at)
            write_output(t)
        if ends:
            fly_free(t, True, span)
            step_tangents(t, n, part)
            return
        copy_matrix(t.at, t.x)  # what flies stays at the begin
        step_tangents(t, n, part)
        copy_matrix(t.x, t.at)
        shift_table(t.c, n, part)
        s -= part


@kernel
def rest(t: Tangents, begin: float, span: float) -> None:
    """Move the tangents over a time at rest, from output to output: equal steps have one flow."""
    passed, step, end = 0.0, math.nan, t.numbers[Number.TIME]
    while next_output(t) <= end:
        left = since(t, begin, span) - passed
        if not abs(left - step) <= SAME * end:
            step = left
            write_flow_at_rest(t, step)
        rest_tangent(t)
        copy_matrix(t.x, t.at)
        write_output(t)
        passed += step
    write_flow_at_rest(t, span - passed)
    rest_tangent(t)


@kernel
def pass_segment(t: Tangents, kind: int, begin: float, span: float, s: float, unit: float, n: int) -> None:
    """Move the tangents over a segment, or over a time at rest, and write the outputs on the way."""
    end = t.numbers[Number.TIME]
    act(t)
    if kind == REST:
        rest(t, begin, span)
    elif kind == Kind.FLIGHT:
        while next_output(t) < end:
            fly_free(t, False, since(t, begin, span))
            write_output(t)
        fly_free(t, False, span)
    else:
        pass_step(t, begin, span, s, unit, n)
    while next_output(t) <= end:  # events are: each ends its segment
        write_output(t)
    copy_matrix(t.x, t.at)
    for side in (LEFT, RIGHT):
        if kind != REST and (t.mode[side] == Pair.BEGINNING or t.mode[side] == Pair.LEAVING):
            add_neglected(t, side, span)


@door
def propagate(address: int, kind: int, span: float, s: float, unit: float, degree: int) -> int:
    """Carry the tangents over a segment, which has just ended, or a rest, which begins; called by `callback.notify`.

    After a run it is called with FINISH.
    """
    t = tangents_at(address)
    if kind == FINISH:
        copy_matrix(t.at, t.x)
        while next_output(t) < math.inf:
            write_output(t)
        return 0
    if t.counts[Count.SLIDE] == UNSEEN:
        check_glide(t)
    now, interval = t.clock[0] + t.clock[1], t.clock[2]
    since_tick = now if kind == REST else now - span
    pass_friction(t, t.counts[Count.DRIVEN] != 0 and since_tick <= 0.0)
    counts, period = t.counts, t.numbers[Number.PERIOD]
    last = math.floor(interval / period + 0.5) if counts[Count.DRIVEN] else counts[Count.TICK]
    while counts[Count.TICK] < last:  # the ticks up to the begin of the interval
        counts[Count.TICK] += 1
        if enter_tick(t, counts[Count.TICK]):
            note_corner(t, counts[Count.TICK] * period, Corner.LIMIT)
    t.numbers[Number.TIME] = now + interval + (span if kind == REST else 0.0)
    pass_segment(t, kind, since_tick + interval, span, s, unit, degree)
    t.counts[Count.SLIDE], t.numbers[Number.FORCE] = t.mode[OBJECT], t.bodies[OBJECT, Of.FORCE]
    for i in range(t.y.shape[0]):
        t.before[i] = t.y[i]
    return 0

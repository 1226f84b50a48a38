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
from grasp_ros.exact.driver.callback import FINISH, REST
from grasp_ros.exact.impact import damping_factor, elastic_force, elastic_slope
from grasp_ros.exact.kinematics import approach, arm_of, own_acceleration, surface_factor
from grasp_ros.exact.numerics.polynomial import invert_time
from grasp_ros.exact.numerics.roots import value_and_rate
from grasp_ros.exact.records import Array, Order, Step
from grasp_ros.exact.tolerances import SURFACE
from grasp_ros.physics.impact_law import EXPONENT
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Kind, Lane, Law, Of, Pair, Slide, U, V, X
from grasp_ros.sensitivity.base_series import touches
from grasp_ros.sensitivity.contact import exact_length, expand_tangents, shift, step_tangents
from grasp_ros.sensitivity.flight import fly_tangent, rest_tangent, write_flows
from grasp_ros.sensitivity.held import act, enter_tick
from grasp_ros.sensitivity.tangents import (
    UNSEEN,
    Count,
    Number,
    TangentMotion,
    TangentOutputs,
    TangentRates,
    Tangents,
    copy_matrix,
    tangents_at,
)


@kernel
def impact_now(motion: TangentMotion, side: Body) -> float:
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
def turning_ratio(motion: TangentMotion, old: float) -> float:
    """Acceleration of an object after it turns, by that before, under its constant force before; nan: it had none."""
    push, new = impact_now(motion, LEFT) - impact_now(motion, RIGHT), motion.bodies[OBJECT]
    push -= new[Of.STIFFNESS] * motion.before[X.O] + new[Of.DAMPING] * motion.before[V.O]
    first = push + old
    return (push + new[Of.FORCE]) / first if first != 0.0 else math.nan


@kernel
def pass_friction(motion: TangentMotion, moved: Array, outputs: TangentOutputs, at_tick: bool) -> None:
    """The jump of the tangents where the mode of an object under dry friction has changed.

    Of one that stops just when inputs change nobody knows which of them would act on it.
    """
    before, now = outputs.counts[Count.SLIDE], motion.mode[OBJECT]
    if now == Slide.FREE or now == before:
        return
    factor, slid = 1.0, before == Slide.RIGHTWARD or before == Slide.LEFTWARD
    if slid and at_tick:
        factor = math.nan
    elif now == Slide.STUCK:
        factor = 0.0
    elif slid:
        factor = turning_ratio(motion, outputs.numbers[Number.FORCE])
    elif before == UNSEEN and motion.before[V.O] == 0.0:
        for j in range(moved.shape[1]):
            if moved[V.O, j] != 0.0:
                factor = math.nan
    if math.isnan(factor):  # the one-sided derivatives differ
        outputs.numbers[Number.CORNER] = min(outputs.numbers[Number.CORNER], outputs.numbers[Number.TIME])
    else:
        scale_object(moved, factor)


@kernel
def check_glide(motion: TangentMotion, rates: TangentRates, outputs: TangentOutputs) -> None:
    """Note a run that begins with a pair at u' = -1/p which nothing moves off: a change to one side has a force."""
    row, y = motion.bodies[OBJECT], motion.before
    pushed = (impact_now(motion, LEFT) - impact_now(motion, RIGHT)) / row[Of.MASS]
    for side in (LEFT, RIGHT):
        loss, d, arm = motion.pairs[side, Law.DISSIPATION], approach(y, side), velocity_lane(side)
        x, v, sign = arm_of(y, side)
        if y[U.L + side] <= 0.0 or surface_factor(motion.pairs, y, side, SURFACE) != 0.0:
            continue
        if own_acceleration(motion.bodies[side], x, v) != own_acceleration(row, y[X.O], y[V.O]) + pushed:
            continue
        for j in range(rates.x.shape[1]):
            faster = sign * (rates.x[arm, j] - rates.x[V.O, j])
            if rates.law[side, Law.DISSIPATION, j] * d + loss * faster != 0.0:
                outputs.numbers[Number.CORNER] = 0.0


@kernel
def write_output(motion: TangentMotion, outputs: TangentOutputs, rates: TangentRates) -> None:
    """Write what stands in `at` to the next output, and what acts on the bodies where it is wanted."""
    row = outputs.rows[outputs.counts[Count.FILLED]]
    copy_matrix(outputs.out[row], rates.at)
    outputs.counts[Count.FILLED] += 1
    row -= outputs.out.shape[0] - outputs.forces.shape[0]
    if row < 0:
        return
    for body in (LEFT, RIGHT, OBJECT):
        outputs.forces[row, body, 0] = motion.bodies[body, Of.MASS]
        outputs.forces[row, body, 1] = motion.bodies[body, Of.FORCE]
        for j in range(outputs.out.shape[2]):
            outputs.forces[row, body, 2 + j] = rates.acting[body, Of.FORCE, j]


@kernel
def next_output(outputs: TangentOutputs) -> float:
    """Time of the next output, s; inf: there is none."""
    row = outputs.counts[Count.FILLED]
    return outputs.grid[row] if row < outputs.grid.shape[0] else math.inf


@kernel
def since(outputs: TangentOutputs, begin: float, span: float) -> float:
    """Time from a begin to the next output, within a span."""
    return min(max(next_output(outputs) - begin, 0.0), span)


@kernel
def pass_rest(t: Tangents, span: float) -> None:
    """Move the tangents over a time at rest, and write the outputs on the way."""
    begin = t.outputs.numbers[Number.TIME]
    end = begin + span
    act(t.motion.mode, t.rates, t.inputs)
    while next_output(t.outputs) <= end:
        rest_tangent(t.motion, t.rates, t.matrices, since(t.outputs, begin, span))
        write_output(t.motion, t.outputs, t.rates)
    rest_tangent(t.motion, t.rates, t.matrices, span)
    copy_matrix(t.rates.x, t.rates.at)
    t.outputs.numbers[Number.TIME] = end


@kernel
def enter_ticks(t: Tangents, interval: float) -> None:
    """Take the ticks up to the begin of an interval, in s."""
    counts, period = t.outputs.counts, t.outputs.numbers[Number.PERIOD]
    last = math.floor(interval / period + 0.5) if counts[Count.DRIVEN] else counts[Count.TICK]
    while counts[Count.TICK] < last:
        counts[Count.TICK] += 1
        if enter_tick(t.inputs, t.motion.before, t.rates.x, counts[Count.TICK]):
            t.outputs.numbers[Number.CORNER] = min(t.outputs.numbers[Number.CORNER], counts[Count.TICK] * period)


@kernel
def add_neglected(motion: TangentMotion, moved: Array, side: Body, span: float) -> None:
    """Add the slope of the force of a pair that begins or leaves: its impulse is below rounding, its slope is not.

    It begins from u = 0, or leaves to it, by a power of the time.
    """
    u, after, arm = motion.before[U.L + side], motion.y[U.L + side], velocity_lane(side)
    deepest = max(u, after)
    if deepest <= 0.0:
        return
    rate = approach(motion.y if after > u else motion.before, side)
    factor = max(damping_factor(motion.pairs[side, Law.DISSIPATION], rate), 0.0)
    slope = elastic_slope(motion.pairs[side, Law.HERTZIAN], deepest)
    mean = slope / (1.0 + (EXPONENT - 1.0) * abs(rate) * span / deepest)  # for u = a t^n
    impulse = span * factor * mean
    arm_mass, mass = motion.bodies[side, Of.MASS], motion.bodies[OBJECT, Of.MASS]
    for j in range(moved.shape[1]):
        apart = moved[arm - 1, j] - moved[X.O, j]
        moved[arm, j] -= impulse * apart / arm_mass
        moved[V.O, j] += impulse * apart / mass


@kernel
def fly_free(t: Tangents, presses: bool, tau: float) -> None:
    """Write the tangents of the bodies that touch nothing after tau s of a segment to `at`."""
    if presses and touches(t.motion, LEFT) and touches(t.motion, RIGHT):
        return
    write_flows(t.motion, tau, t.flows)
    for body in (LEFT, OBJECT, RIGHT):
        if not (presses and touches(t.motion, body)):
            fly_tangent(t.motion, t.rates, t.flows, body)


@kernel
def pass_flight(t: Tangents, begin: float, span: float) -> None:
    """Move the tangents over a flight, and write the outputs on the way."""
    while next_output(t.outputs) < t.outputs.numbers[Number.TIME]:
        fly_free(t, False, since(t.outputs, begin, span))
        write_output(t.motion, t.outputs, t.rates)
    fly_free(t, False, span)


@kernel
def pass_step(t: Tangents, begin: float, span: float, s: float, unit: float, n: int) -> None:
    """Move the tangents over a Taylor step, in parts where their series end later than those of the run."""
    motion, rates, left = t.motion, t.rates, s
    step = Step(Order(n, 0.0, 0), unit, touches(motion, LEFT), touches(motion, RIGHT))
    while True:
        expand_tangents(motion, rates, t.table, n)
        part = exact_length(motion, t.table, n, left)
        ends = part == left
        reached = span if ends else value_and_rate(motion.c[Lane.TIME :: LANES], n, part)[0]
        while next_output(t.outputs) < (t.outputs.numbers[Number.TIME] if ends else begin + reached):
            tau = since(t.outputs, begin, span)
            fly_free(t, True, tau)
            at = invert_time(motion.c, t.table.products[0], step, tau, part, reached)
            step_tangents(motion, rates, t.table, n, at)
            write_output(motion, t.outputs, rates)
        if ends:
            fly_free(t, True, span)
            step_tangents(motion, rates, t.table, n, part)
            return
        copy_matrix(rates.at, rates.x)  # what flies stays at the begin
        step_tangents(motion, rates, t.table, n, part)
        copy_matrix(rates.x, rates.at)
        shift(motion.c, n, part)
        left -= part


@kernel
def pass_segment(t: Tangents, kind: int, begin: float, span: float, s: float, unit: float, n: int) -> None:
    """Move the tangents over a segment."""
    act(t.motion.mode, t.rates, t.inputs)
    if kind == Kind.FLIGHT:
        pass_flight(t, begin, span)
    else:
        pass_step(t, begin, span, s, unit, n)
    while next_output(t.outputs) <= t.outputs.numbers[Number.TIME]:  # events are: each ends its segment
        write_output(t.motion, t.outputs, t.rates)
    copy_matrix(t.rates.x, t.rates.at)
    for side in (LEFT, RIGHT):
        if t.motion.mode[side] == Pair.BEGINNING or t.motion.mode[side] == Pair.LEAVING:
            add_neglected(t.motion, t.rates.x, side, span)


@kernel
def remember(t: Tangents) -> None:
    """Keep what the next segment begins with."""
    t.outputs.counts[Count.SLIDE] = t.motion.mode[OBJECT]
    t.outputs.numbers[Number.FORCE] = t.motion.bodies[OBJECT, Of.FORCE]
    for place in range(t.motion.y.shape[0]):
        t.motion.before[place] = t.motion.y[place]


@door
def propagate(address: int, kind: int, span: float, s: float, unit: float, degree: int) -> int:
    """Carry the tangents over a segment, which has just ended, or a rest, which begins; called by `callback.notify`.

    After a run it is called with FINISH.
    """
    t = tangents_at(address)
    if kind == FINISH:
        copy_matrix(t.rates.at, t.rates.x)
        while next_output(t.outputs) < math.inf:
            write_output(t.motion, t.outputs, t.rates)
        return 0
    if t.outputs.counts[Count.SLIDE] == UNSEEN:
        check_glide(t.motion, t.rates, t.outputs)
    clock = t.motion.clock
    since_tick = clock[0] + clock[1] - (0.0 if kind == REST else span)
    pass_friction(t.motion, t.rates.x, t.outputs, t.outputs.counts[Count.DRIVEN] != 0 and since_tick <= 0.0)
    enter_ticks(t, clock[2])
    t.outputs.numbers[Number.TIME] = (clock[0] + clock[1]) + clock[2]
    if kind == REST:
        pass_rest(t, span)
    else:
        pass_segment(t, kind, (clock[0] + clock[1] - span) + clock[2], span, s, unit, degree)
    remember(t)
    return 0

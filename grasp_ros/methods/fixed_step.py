"""The classical Runge-Kutta method of order 4 with a fixed step, and three ways to treat contact.

`plain` leaves (6), (7) and (10) to the right-hand side. `paper` is the paper's section "Simulation Method", read
literally. `located` freezes the mode and finds each event to rounding. u^(3/2) has a kink in its second derivative
at u = 0: no way reaches order 4 through a touch. What is measured near it is order 2.5 at best.

The paper's method, in its own words and this reading of them:

* Contact is decided by (10) "at the beginning and the end of every time step". Within a step the condition is frozen.
* If it changes, time and "all state values" at the event come from linear interpolation over the step. The quantity
  that is interpolated is the one that changed sign: u, or u' + 1/p.
* "For the rest of this time step the response is calculated" under the new condition, with another Runge-Kutta step.
* Both sides in one step are "the mixture of the previous ones": the earlier event first, the other one in the rest.
  Each side changes at most once in a step; whatever happens after that is decided at the next beginning.

References
----------
Fukuda, Shoji, Inaba (1990), "Simulation Method". E. Hairer, S. P. Norsett, G. Wanner: Solving Ordinary Differential
Equations I, II.1 (method of Kutta), II.6 (Hermite interpolation).
"""

import math
from typing import Any

import numpy as np

from grasp_ros.exact.compilation.jit import allocating, kernel
from grasp_ros.exact.impact import damping_factor
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.equations import MAX_IDLE, SLIVER, Work, begun, condition, in_pieces, kind_of, rates, relative
from grasp_ros.physics.layout import EPS, LEFT, RIGHT, Body, Outcome, Pair

PLAIN, PAPER, LOCATED = 0, 1, 2
MOST_EVENTS = 10**6  # rows of memory, which is only taken where it is written


def solve(rule: int, problem: Problem) -> Solution:
    """Integrate with a fixed step; outputs between the steps by cubic Hermite interpolation."""
    q, y, out, work = begun(problem)
    events = np.empty((0 if rule == PLAIN else min(problem.max_events, MOST_EVENTS), 5))
    mode = np.array([Pair.CONTACT if rule == PLAIN else condition(q, y, side) for side in (LEFT, RIGHT)])
    pairs = mode, np.full(2, -1.0)
    outcome, (_, _, _, rows, found, _) = in_pieces(problem, (0.0, y, 0, 0, 0, 0), lambda reached, last: run(
        rule, q, problem.duration, problem.setting, problem.grid, out, events, work, pairs, reached, last))
    status = Status.EVENT_BUDGET if outcome == Outcome.EVENTS_FULL else Status[Outcome(outcome).name]
    return Solution(out[:rows], events[:found].copy(), work, status)


@kernel
def along(y: Any, h: float, f: Any) -> Any:
    """y + h f of six components."""
    return (
        y[0] + h * f[0], y[1] + h * f[1], y[2] + h * f[2], y[3] + h * f[3], y[4] + h * f[4], y[5] + h * f[5],
    )


@kernel
def change(events: Any, count: int, time: float, side: Body, mode: Any, after: Pair, y: Any) -> int:
    """Give a pair its next mode, and write it into the record of events; returns how many these are then."""
    u, d = relative(y, side)
    events[count, 0], events[count, 1], events[count, 2] = time, side.value, kind_of(mode[side], after).value
    events[count, 3], events[count, 4] = u, d
    mode[side] = after
    return count + 1


@kernel
def rk4(q: Any, push_l: bool, push_r: bool, y: Any, f: Any, h: float) -> Any:
    """One step of the classical method from y, where the slope is f."""
    k2 = rates(q, push_l, push_r, along(y, 0.5 * h, f))
    k3 = rates(q, push_l, push_r, along(y, 0.5 * h, k2))
    k4 = rates(q, push_l, push_r, along(y, h, k3))
    return along(along(along(along(y, h / 6.0, f), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4)


@kernel
def linear_fraction(q: Any, y: Any, z: Any, side: int, before: int, after: int) -> float:
    """Where between y and z one pair's condition changes, by linear interpolation of u or of u' + 1/p."""
    u, d = relative(y, side)
    u_end, d_end = relative(z, side)
    if before == Pair.OPEN or after == Pair.OPEN:
        first, last = u, u_end
    else:
        first, last = d + 1.0 / q[4 + 5 * side], d_end + 1.0 / q[4 + 5 * side]
    if first * last >= 0.0:  # already past it where the interpolation begins
        return 0.0
    return first / (first - last)


@kernel
def distance(q: Any, y: Any, side: int, mode: int, after: int) -> float:
    """Event function between two modes of one pair: negative before, positive after."""
    u, d = relative(y, side)
    if mode == Pair.OPEN:
        return u
    if after == Pair.OPEN:
        return -u
    rest = damping_factor(q[4 + 5 * side], d)
    return -rest if after == Pair.CLAMPED else rest


@kernel
def next_mode(q: Any, y: Any, side: int, mode: Pair) -> Pair:
    """Mode that a frozen pair should have at y; its own if nothing has happened."""
    other = Pair.CONTACT if mode != Pair.CONTACT else Pair.CLAMPED
    if mode != Pair.OPEN and distance(q, y, side, mode, Pair.OPEN) > 0.0:
        return Pair.OPEN
    return other if distance(q, y, side, mode, other) > 0.0 else mode


@kernel
def root_fraction(q: Any, y: Any, f: Any, h: float, mode: Any, side: int, after: int, work: Any) -> float:
    """Shortest part of a step that carries one pair past its event: Illinois, with Runge-Kutta steps as function."""
    low, high = 0.0, 1.0
    at_low = distance(q, y, side, mode[side], after)
    if at_low >= 0.0:
        return 0.0
    z = rk4(q, mode[LEFT] == Pair.CONTACT, mode[RIGHT] == Pair.CONTACT, y, f, h)
    at_high = distance(q, z, side, mode[side], after)
    kept = 0  # end of the bracket that stayed last time
    for k in range(200):
        theta = high - at_high * (high - low) / (at_high - at_low)
        if k % 4 == 3 or not low < theta < high:
            theta = 0.5 * (low + high)
        if high - low <= 4.0 * EPS * high or not low < theta < high:
            break
        z = rk4(q, mode[LEFT] == Pair.CONTACT, mode[RIGHT] == Pair.CONTACT, y, f, theta * h)
        work[Work.RIGHT_HAND_SIDES] += 3
        work[Work.EVENT_EVALUATIONS] += 1
        value = distance(q, z, side, mode[side], after)
        if value > 0.0:
            high, at_high = theta, value
            at_low = 0.5 * at_low if kept == -1 else at_low
            kept = -1
        else:
            low, at_low = theta, value
            at_high = 0.5 * at_high if kept == 1 else at_high
            kept = 1
    return high


@kernel
def first_transition(rule: int, q: Any, y: Any, f: Any, z: Any, h: float, mode: Any, free: Any, work: Any) -> Any:
    """Fraction, side and next mode of the first event in a step from y to z; a fraction of 2 if there is none."""
    best, where, then = 2.0, LEFT, Pair.OPEN
    for side in (LEFT, RIGHT):
        if not free[side]:
            continue
        after = condition(q, z, side) if rule == PAPER else next_mode(q, z, side, mode[side])
        same_force = rule == PAPER and after != Pair.CONTACT and mode[side] != Pair.CONTACT
        if after == mode[side] or same_force:
            continue
        if rule == PAPER:
            theta = linear_fraction(q, y, z, side, mode[side], after)
        else:
            theta = root_fraction(q, y, f, h, mode, side, after, work)
        if theta < best:
            best, where, then = theta, side, after
    return best, where, then


@kernel
def deliver(linear: bool, y: Any, f: Any, z: Any, g: Any, t: float, reached: float, grid: Any, out: Any,
            row: int) -> int:
    """Write the outputs in (t, reached] of a step from y (slope f) to z (slope g); returns the next row.

    By linear or by cubic Hermite interpolation, whose error is O(h^4).
    """
    h, way = reached - t, along(z, -1.0, y)
    while row < grid.shape[0] and grid[row] <= reached:
        theta = (grid[row] - t) / h
        a = theta if linear else theta * theta * (3.0 - 2.0 * theta)
        out[row] = along(y, a, way)
        if not linear:
            b, c = h * theta * (1.0 - theta) ** 2, h * theta * theta * (theta - 1.0)
            out[row] = along(along(out[row], b, f), c, g)
        row += 1
    return row


@allocating
def run(rule: int, q: Any, duration: float, step: float, grid: Any, out: Any, events: Any, work: Any, pairs: Any,
        reached: Any, last: int) -> Any:
    """The steps up to the last of a piece; returns the outcome, and what is reached.

    That is the time, the state, the steps done, how many rows of `out` and of `events` are filled, and how many events
    have come without progress. `pairs` has the modes of the pairs, and when each has changed last.

    The outcome is a number: Python code makes an enum of it, and a signal that has come meanwhile raises in that code.
    """
    (t, y, number, row, found, idle), (mode, changed) = reached, pairs
    free = np.ones(2, dtype=np.bool_)
    while row < grid.shape[0] and grid[row] <= 0.0:
        out[row] = y
        row += 1
    while t < duration:
        if number == last:
            return Outcome.GO_ON.value, (t, y, number, row, found, idle)
        number += 1
        end = min(number * step, duration)
        if duration - end < SLIVER * step:
            end = duration
        free[:] = rule != PLAIN
        for side in (LEFT, RIGHT):  # the paper's method evaluates (10) here
            after = condition(q, y, side) if rule == PAPER else mode[side]
            if after != mode[side] and changed[side] != t:  # one that changes here has u at a rounding of either sign
                if found == events.shape[0]:
                    return Outcome.EVENTS_FULL.value, (t, y, number, row, found, idle)
                found = change(events, found, t, side, mode, after, y)
        while t < end:
            h = end - t
            push_l, push_r = mode[LEFT] == Pair.CONTACT, mode[RIGHT] == Pair.CONTACT
            f = rates(q, push_l, push_r, y)
            z = rk4(q, push_l, push_r, y, f, h)
            work[Work.STEPS] += 1
            work[Work.RIGHT_HAND_SIDES] += 4
            theta, side, after = first_transition(rule, q, y, f, z, h, mode, free, work)
            until = end
            if theta <= 1.0:
                linear = along(y, theta, along(z, -1.0, y))
                z = linear if rule == PAPER else rk4(q, push_l, push_r, y, f, theta * h)
                until = min(t + theta * h, end)
            if row < grid.shape[0] and grid[row] <= until:
                g = rates(q, push_l, push_r, z)
                row = deliver(rule == PAPER and theta <= 1.0, y, f, z, g, t, until, grid, out, row)
            idle = 0 if until - t > SLIVER * step else idle + 1
            if idle > MAX_IDLE:
                return Outcome.STALLED.value, (t, y, number, row, found, idle)
            y, t = z, until
            if theta <= 1.0:
                if found == events.shape[0]:
                    return Outcome.EVENTS_FULL.value, (t, y, number, row, found, idle)
                found = change(events, found, t, side, mode, after, y)
                changed[side], free[side] = t, rule == LOCATED
        if not math.isfinite(y[0] + y[1] + y[2] + y[3] + y[4] + y[5]):
            return Outcome.NOT_FINITE.value, (t, y, number, row, found, idle)
    return Outcome.DONE.value, (t, y, number, row, found, idle)

"""Tangents of motions that obey linear equations: a body in free flight, and a grasp at rest.

In flight x'' = a - K x - C x' with K = k / m, C = c / m, a = f / m. The flow of (x, v, 1) is the exponential of a
matrix, and its derivatives by K and C are Frechet derivatives of that exponential: all of them come from scaling and
squaring, so that no case of damping is special.

Source: N. J. Higham, Functions of Matrices (SIAM 2008), sections 10.3 (scaling and squaring) and 10.6 (the derivative).
"""

from __future__ import annotations

import math
from enum import IntEnum

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.compilation.vectors import HALF, load_half, spread_half, store
from grasp_ros.exact.impact import elastic_force, elastic_slope
from grasp_ros.exact.numerics.polynomial import INVERSE
from grasp_ros.exact.numerics.powers_of_two import exponent, power_of_two
from grasp_ros.exact.records import Array
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, U, V
from grasp_ros.sensitivity.tangents import STATES, Tangents, copy_matrix

SERIES = 16  # terms of an exponential whose argument is below LARGEST_ARGUMENT
LARGEST_ARGUMENT = 0.25
FEW, SHORT = 10, 2.0**-9  # terms are enough for the derivatives, too, where the argument is below this
Linear = tuple[float, float, float]  # what one unit of x, of v and of a constant acceleration makes


class Flow(IntEnum):
    """Indices of the numbers of a body, each HALF behind the last: four of its flow, their derivatives by K and by C.

    The four are x by x, x by v, v by v and x by a constant acceleration. v by x is -K times the second, v by the
    acceleration is the second.
    """

    STIFFNESS = 12  # K itself, 1/s^2
    DAMPING = 13  # C, 1/s
    TIMES = 14  # how often the time was halved
    TIME = 15  # what is left of it, s


@kernel
def halvings(rate: float, span: float) -> int:
    """How often a time in s is halved until an exponential series of so few terms covers it."""
    return max(exponent(rate * span / LARGEST_ARGUMENT) + 1, 0)


@kernel
def write_flows(t: Tangents, span: float) -> None:
    """Write the flows of all bodies, but for as many halvings of `span` s as a series needs, to `flows`, see `Flow`.

    All of it follows from the answer q(t) to an acceleration of 1, q'' = 1 - K q - C q', and its derivatives.
    """
    longest = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        row, own = t.bodies[body], t.flows[body::HALF]
        own[Flow.STIFFNESS], own[Flow.DAMPING] = row[Of.STIFFNESS] / row[Of.MASS], row[Of.DAMPING] / row[Of.MASS]
        rate = max(math.sqrt(own[Flow.STIFFNESS]), abs(own[Flow.DAMPING]))
        times = halvings(rate, span)
        own[Flow.TIMES], own[Flow.TIME] = times, span * power_of_two(-times)
        longest = max(longest, rate * own[Flow.TIME])
    nothing, push, h = spread_half(0.0), spread_half(1.0), load_half(t.flows, HALF * Flow.TIME)
    stiffness, damping = load_half(t.flows, HALF * Flow.STIFFNESS), load_half(t.flows, HALF * Flow.DAMPING)
    x = v = x_k = v_k = x_c = v_c = nothing  # terms of q and q'
    q = s = q_k = s_k = q_c = s_c = nothing  # their sums
    for k in range(1, SERIES if longest > SHORT else FEW):
        share = INVERSE[k] * h
        x_k, v_k = share * v_k, share * (nothing - x - stiffness * x_k - damping * v_k)
        x_c, v_c = share * v_c, share * (nothing - v - stiffness * x_c - damping * v_c)
        x, v = share * v, share * (push - stiffness * x - damping * v)
        q, s, q_k, s_k, q_c, s_c = q + x, s + v, q_k + x_k, s_k + v_k, q_c + x_c, s_c + v_c
        push = nothing
    a, a_k, a_c = 1.0 - stiffness * q, nothing - q - stiffness * q_k, nothing - stiffness * q_c
    d, d_k, d_c = a - damping * s, a_k - damping * s_k, a_c - s - damping * s_c
    for i, number in enumerate((a, s, d, q, a_k, s_k, d_k, q_k, a_c, s_c, d_c, q_c)):
        store(t.flows, HALF * i, number)


@kernel
def fly_tangent(t: Tangents, body: Body) -> None:
    """Write the tangents of a body to `at`: its flow is squared as often as the time was halved."""
    f, v = t.flows[body::HALF], velocity_lane(body)
    stiffness = f[Flow.STIFFNESS]
    a, s, d, q, a_k, s_k, d_k, q_k, a_c, s_c, d_c, q_c = (
        f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8], f[9], f[10], f[11])
    for _ in range(int(f[Flow.TIMES])):
        both, bend, square = a + d, 2.0 * stiffness * s, s * s
        q_k, q_c = q_k + a * q_k + q * a_k + 2.0 * s * s_k, q_c + a * q_c + q * a_c + 2.0 * s * s_c
        q = q + a * q + square
        s_k, s_c, later_k, later_c = s_k * both + s * (a_k + d_k), s_c * both + s * (a_c + d_c), bend * s_k, bend * s_c
        a_k, d_k = 2.0 * a * a_k - square - later_k, 2.0 * d * d_k - square - later_k
        a_c, d_c = 2.0 * a * a_c - later_c, 2.0 * d * d_c - later_c
        a, d, s = a * a - stiffness * square, d * d - stiffness * square, s * both
    write_tangent(t, body, v - 1, (a, s, q), (a_k, s_k, q_k), (a_c, s_c, q_c))
    write_tangent(t, body, v, (-stiffness * s, d, s), (-s - stiffness * s_k, d_k, s_k),
                  (-stiffness * s_c, d_c, s_c))


@kernel
def write_tangent(t: Tangents, body: Body, lane: int, flow: Linear, stiffer: Linear, slower: Linear) -> None:
    """Write the tangents of one lane: its flow, from x, v and a constant acceleration, and derivatives by K and C."""
    row, own, v = t.bodies[body], t.acting[body], velocity_lane(body)
    mass, x_0, v_0 = row[Of.MASS], t.before[v - 1], t.before[v]
    stiffness, damping, steady = row[Of.STIFFNESS] / mass, row[Of.DAMPING] / mass, row[Of.FORCE] / mass
    by_x, by_v, by_steady = flow[0], flow[1], flow[2] / mass
    by_k = (stiffer[0] * x_0 + stiffer[1] * v_0 + stiffer[2] * steady) / mass
    by_c = (slower[0] * x_0 + slower[1] * v_0 + slower[2] * steady) / mass
    by_mass = by_k * stiffness + by_c * damping + by_steady * steady
    for first in range(0, t.x.shape[1], HALF):
        moved = by_x * load_half(t.x[v - 1], first) + by_v * load_half(t.x[v], first)
        stiffened = by_k * load_half(own[Of.STIFFNESS], first) + by_c * load_half(own[Of.DAMPING], first)
        driven = by_steady * load_half(own[Of.FORCE], first) - by_mass * load_half(own[Of.MASS], first)
        store(t.at[lane], first, moved + stiffened + driven)


@kernel
def couple(t: Tangents, side: Body, a: Array) -> float:
    """Add the slope of the impact force of a pair in contact at rest to the matrix; returns a bound of its rates."""
    u, hertzian, loss = t.before[U.L + side], t.pairs[side, Law.HERTZIAN], t.pairs[side, Law.DISSIPATION]
    slope, drag = elastic_slope(hertzian, max(u, 0.0)), loss * elastic_force(hertzian, max(u, 0.0))
    arm, middle = velocity_lane(side), velocity_lane(OBJECT)
    for body in (side, OBJECT):
        own, inverse = velocity_lane(body), 1.0 / t.bodies[body, Of.MASS]
        other = arm + middle - own
        a[own, own - 1] -= slope * inverse
        a[own, own] -= drag * inverse
        a[own, other - 1] += slope * inverse
        a[own, other] += drag * inverse
    lightest = 1.0 / min(t.bodies[side, Of.MASS], t.bodies[OBJECT, Of.MASS])
    return max(math.sqrt(2.0 * slope * lightest), 2.0 * drag * lightest)


@kernel
def product_6x6(a: Array, b: Array, out: Array) -> None:
    """Write the product of two matrices (6, 6) to a third one."""
    for i in range(STATES):
        for j in range(STATES):
            total = 0.0
            for k in range(STATES):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@kernel
def rate_at_rest(t: Tangents, a: Array) -> float:
    """Write the matrix of the tangents' equations at rest; returns a bound of its rates, 1/s."""
    a[:] = 0.0
    rate = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        row, v = t.bodies[body], velocity_lane(body)
        a[v - 1, v] = 1.0
        a[v, v - 1], a[v, v] = -row[Of.STIFFNESS] / row[Of.MASS], -row[Of.DAMPING] / row[Of.MASS]
        rate = max(rate, math.sqrt(-a[v, v - 1]), abs(a[v, v]))
    for side in (LEFT, RIGHT):
        if t.mode[side] == Pair.CONTACT:
            rate += couple(t, side, a)
    return rate


@kernel
def drive_at_rest(t: Tangents, body: Body, j: int) -> float:
    """What accelerates the tangent of a body at rest by itself, m/s^2 by the unit of a direction."""
    row, v = t.acting[body], velocity_lane(body)
    push = row[Of.FORCE, j] - row[Of.STIFFNESS, j] * t.before[v - 1]
    for side in (LEFT, RIGHT):
        if t.mode[side] == Pair.CONTACT and body in (side, OBJECT):
            sign = (1.0 if side == LEFT else -1.0) * (1.0 if body == OBJECT else -1.0)
            push += sign * elastic_force(t.law[side, Law.HERTZIAN, j], max(t.before[U.L + side], 0.0))
    return push / t.bodies[body, Of.MASS]


@kernel
def write_drift_at_rest(t: Tangents) -> None:
    """Write what accelerates the tangents by itself makes of them in a time at rest, whose flow is there."""
    integral = t.matrices[2]
    for j in range(t.x.shape[1]):
        left, right = drive_at_rest(t, LEFT, j), drive_at_rest(t, RIGHT, j)
        middle = drive_at_rest(t, OBJECT, j)
        for i in range(STATES):
            t.drift[i, j] = integral[i, V.L] * left + integral[i, V.O] * middle + integral[i, V.R] * right


@kernel
def write_flow_at_rest(t: Tangents, span: float) -> None:
    """Write the flow of `span` s at rest and its integral to the second and third of `matrices`, and the drift."""
    a, flow, integral, term, spare = t.matrices[0], t.matrices[1], t.matrices[2], t.matrices[3], t.matrices[4]
    times = halvings(rate_at_rest(t, a), span)
    h = span * power_of_two(-times)
    flow[:] = integral[:] = term[:] = 0.0  # exp(a t) and its integral
    for i in range(STATES):
        flow[i, i] = term[i, i] = 1.0
        integral[i, i] = h
    for k in range(1, SERIES):
        product_6x6(a, term, spare)
        for i in range(STATES):
            for j in range(STATES):
                term[i, j] = spare[i, j] * h / k
                flow[i, j] += term[i, j]
                integral[i, j] += term[i, j] * h / (k + 1)
    for _ in range(times):
        product_6x6(flow, integral, spare)
        for i in range(STATES):
            for j in range(STATES):
                integral[i, j] += spare[i, j]
        product_6x6(flow, flow, spare)
        copy_matrix(flow, spare)
    write_drift_at_rest(t)


@kernel
def rest_tangent(t: Tangents) -> None:
    """Write the tangents after a time at rest, whose flow and drift are there, to `at`."""
    flow = t.matrices[1]
    for first in range(0, t.x.shape[1], HALF):
        for i in range(STATES):
            total = load_half(t.drift[i], first)
            for k in range(STATES):
                total = total + flow[i, k] * load_half(t.x[k], first)
            store(t.at[i], first, total)

"""Tangents of motions that obey linear equations: a body in free flight, and a grasp at rest.

In flight x'' = a - K x - C x' with K = k / m, C = c / m, a = f / m. The flow of (x, v, 1) is the exponential of a
matrix, and its derivatives by K and C are Frechet derivatives of that exponential: all of them come from scaling and
squaring, so that no case of damping is special.

Source: N. J. Higham, Functions of Matrices (SIAM 2008), sections 10.3 (scaling and squaring) and 10.6 (the derivative).
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.compilation.vectors import HALF, load_half, store
from grasp_ros.exact.impact import elastic_force, elastic_slope
from grasp_ros.exact.records import Array
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Body, Law, Of, Pair, U, V
from grasp_ros.sensitivity.tangents import STATES, TangentMotion, TangentRates, copy_matrix

SERIES = 16  # terms of an exponential whose argument is below LARGEST_ARGUMENT
LARGEST_ARGUMENT = 0.25
SMALL = 1e-20  # terms of a flow behind which those of its derivatives are below rounding, too
FLOW, BY_STIFFNESS, BY_DAMPING, NEXT, SPARE = range(5)  # matrices
STEADY = 2  # column of what a constant acceleration of 1 m/s^2 does


@kernel
def halvings(rate: float, t: float) -> int:
    """How often a time in s is halved until an exponential series of so few terms covers it."""
    reach = rate * t / LARGEST_ARGUMENT
    return max(math.ceil(math.log2(reach)), 0) if reach > 1.0 else 0


@kernel
def product_2x3(a: Array, b: Array, out: Array, steady: float) -> None:
    """Add a b to out, for affine maps (2, 3) of the plane; `steady` is the last row's own entry of b."""
    for i in range(2):
        for j in range(3):
            out[i, j] += a[i, 0] * b[0, j] + a[i, 1] * b[1, j]
        out[i, STEADY] += steady * a[i, STEADY]


@kernel
def write_map(out: Array, x: tuple[float, float, float], v: tuple[float, float, float]) -> None:
    """Write an affine map of the plane, (2, 3): its rows for x and for v."""
    for j in range(3):
        out[0, j], out[1, j] = x[j], v[j]


@kernel
def flow_of_body(stiffness: float, damping: float, t: float, m: Array) -> None:
    """Write the flow of a body over t s and its derivatives by K and C to the matrices (5, 6, 6), (2, 3) of each.

    All of it follows from the answer q(t) to an acceleration of 1, q'' = 1 - K q - C q', and its derivatives.
    """
    times = halvings(max(math.sqrt(stiffness), abs(damping)), t)
    h = t / 2.0**times
    x = v = x_k = v_k = x_c = v_c = 0.0  # terms of q and q'
    q = s = q_k = s_k = q_c = s_c = 0.0  # their sums
    push = 1.0
    for k in range(1, SERIES):
        share = h / k
        x_k, v_k = share * v_k, share * (-x - stiffness * x_k - damping * v_k)
        x_c, v_c = share * v_c, share * (-v - stiffness * x_c - damping * v_c)
        x, v = share * v, share * (push - stiffness * x - damping * v)
        q, s, q_k, s_k, q_c, s_c = q + x, s + v, q_k + x_k, s_k + v_k, q_c + x_c, s_c + v_c
        push = 0.0
        if abs(v) <= SMALL * h and abs(x) <= SMALL * h * h and k > 4:
            break
    bend = stiffness * q + damping * s
    bend_k, bend_c = q + stiffness * q_k + damping * s_k, s + stiffness * q_c + damping * s_c
    write_map(m[FLOW], (1.0 - stiffness * q, s, q), (-stiffness * s, 1.0 - bend, s))
    write_map(m[BY_STIFFNESS], (-q - stiffness * q_k, s_k, q_k), (-s - stiffness * s_k, -bend_k, s_k))
    write_map(m[BY_DAMPING], (-stiffness * q_c, s_c, q_c), (-stiffness * s_c, -bend_c, s_c))
    for _ in range(times):
        for which in (BY_DAMPING, BY_STIFFNESS, FLOW):
            m[NEXT, :2, :3] = 0.0
            product_2x3(m[which], m[FLOW], m[NEXT], 1.0)
            if which != FLOW:
                product_2x3(m[FLOW], m[which], m[NEXT], 0.0)
            copy_matrix(m[which], m[NEXT, :2, :3])


@kernel
def fly_tangent(motion: TangentMotion, rates: TangentRates, m: Array, body: Body, span: float) -> None:
    """Write the tangents of a body after `span` s of flight to `at`."""
    row, own, v = motion.bodies[body], rates.acting[body], velocity_lane(body)
    mass, x_0, v_0 = row[Of.MASS], motion.before[v - 1], motion.before[v]
    stiffness, damping, steady = row[Of.STIFFNESS] / mass, row[Of.DAMPING] / mass, row[Of.FORCE] / mass
    flow_of_body(stiffness, damping, span, m)
    for i in range(2):
        by_x, by_v, by_steady = m[FLOW, i, 0], m[FLOW, i, 1], m[FLOW, i, STEADY] / mass
        by_k = (m[BY_STIFFNESS, i, 0] * x_0 + m[BY_STIFFNESS, i, 1] * v_0 + m[BY_STIFFNESS, i, STEADY] * steady) / mass
        by_c = (m[BY_DAMPING, i, 0] * x_0 + m[BY_DAMPING, i, 1] * v_0 + m[BY_DAMPING, i, STEADY] * steady) / mass
        by_mass = by_k * stiffness + by_c * damping + by_steady * steady
        for first in range(0, rates.x.shape[1], HALF):
            moved = by_x * load_half(rates.x[v - 1], first) + by_v * load_half(rates.x[v], first)
            stiffer = by_k * load_half(own[Of.STIFFNESS], first) + by_c * load_half(own[Of.DAMPING], first)
            driven = by_steady * load_half(own[Of.FORCE], first) - by_mass * load_half(own[Of.MASS], first)
            store(rates.at[v - 1 + i], first, moved + stiffer + driven)


@kernel
def couple(motion: TangentMotion, side: Body, a: Array) -> float:
    """Add the slope of the impact force of a pair in contact at rest to the matrix; returns a bound of its rates."""
    u, hertzian, loss = motion.before[U.L + side], motion.pairs[side, Law.HERTZIAN], motion.pairs[side, Law.DISSIPATION]
    slope, drag = elastic_slope(hertzian, max(u, 0.0)), loss * elastic_force(hertzian, max(u, 0.0))
    arm, middle = velocity_lane(side), velocity_lane(OBJECT)
    for body in (side, OBJECT):
        own, inverse = velocity_lane(body), 1.0 / motion.bodies[body, Of.MASS]
        other = arm + middle - own
        a[own, own - 1] -= slope * inverse
        a[own, own] -= drag * inverse
        a[own, other - 1] += slope * inverse
        a[own, other] += drag * inverse
    lightest = 1.0 / min(motion.bodies[side, Of.MASS], motion.bodies[OBJECT, Of.MASS])
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
def rate_at_rest(motion: TangentMotion, a: Array) -> float:
    """Write the matrix of the tangents' equations at rest; returns a bound of its rates, 1/s."""
    a[:] = 0.0
    rate = 0.0
    for body in (LEFT, OBJECT, RIGHT):
        row, v = motion.bodies[body], velocity_lane(body)
        a[v - 1, v] = 1.0
        a[v, v - 1], a[v, v] = -row[Of.STIFFNESS] / row[Of.MASS], -row[Of.DAMPING] / row[Of.MASS]
        rate = max(rate, math.sqrt(-a[v, v - 1]), abs(a[v, v]))
    for side in (LEFT, RIGHT):
        if motion.mode[side] == Pair.CONTACT:
            rate += couple(motion, side, a)
    return rate


@kernel
def drive_at_rest(motion: TangentMotion, rates: TangentRates, body: Body, j: int) -> float:
    """What accelerates the tangent of a body at rest by itself, m/s^2 by the unit of a direction."""
    row, v = rates.acting[body], velocity_lane(body)
    push = row[Of.FORCE, j] - row[Of.STIFFNESS, j] * motion.before[v - 1]
    for side in (LEFT, RIGHT):
        if motion.mode[side] == Pair.CONTACT and body in (side, OBJECT):
            sign = (1.0 if side == LEFT else -1.0) * (1.0 if body == OBJECT else -1.0)
            push += sign * elastic_force(rates.law[side, Law.HERTZIAN, j], max(motion.before[U.L + side], 0.0))
    return push / motion.bodies[body, Of.MASS]


@kernel
def rest_tangent(motion: TangentMotion, rates: TangentRates, m: Array, span: float) -> None:
    """Write the tangents after `span` s at rest to `at`."""
    a, flow, integral, term, spare = m[0], m[1], m[2], m[3], m[4]
    times = halvings(rate_at_rest(motion, a), span)
    h = span / 2.0**times
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
    for j in range(rates.x.shape[1]):
        left, right = drive_at_rest(motion, rates, LEFT, j), drive_at_rest(motion, rates, RIGHT, j)
        middle = drive_at_rest(motion, rates, OBJECT, j)
        for i in range(STATES):
            total = integral[i, V.L] * left + integral[i, V.O] * middle + integral[i, V.R] * right
            for k in range(STATES):
                total += flow[i, k] * rates.x[k, j]
            rates.at[i, j] = total


"""Tangents of a Taylor step in contact: a linear equation whose coefficients the step has already expanded.

At fixed time the tangents obey x' = v, m v' = -k x - c v -+ (dF/du u + dF/du' u'), with what a direction changes of
the numbers added. Times dt/ds of the step's own variable all coefficients are polynomials in w = sqrt(u), so that the
tangents are as smooth as the motion itself, through touch and release, and have its radius of convergence.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.contact.series import put
from grasp_ros.exact.numerics.polynomial import INVERSE
from grasp_ros.exact.records import Array
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Of, Pair, V, X, Z
from grasp_ros.sensitivity.series import NOTHING, WIDTH, combine, evaluate, multiply
from grasp_ros.sensitivity.tangents import STATES, Motion, Rates, Row, Table

MOST_HALVINGS = 200
NEGLECTED = 64.0 * EPS
FIRST = 6  # terms of a series, one of which is about its size


@kernel
def touches(motion: Motion, body: Body) -> bool:
    """Whether a body takes part in the contacts of a step; the others fly."""
    return body == OBJECT or motion.mode[body] == Pair.CONTACT


@kernel
def pair_series(motion: Motion, table: Table, n: int) -> None:
    """Write the series that both pairs bring, by side; without contact they are 0.

    With s = w dt/ds, a polynomial in w, and h = u s: s (1 + p u') gives dF/du, h gives dF/du', h u' the damping.
    """
    c, a, b, (first, second, third) = motion.c, table.factors[0], table.factors[1], table.products
    pace, pairs = table.rows[Row.PACE], motion.pairs
    loss_l, loss_r = pairs[LEFT, Law.DISSIPATION], pairs[RIGHT, Law.DISSIPATION]
    left, right = motion.mode[LEFT] == Pair.CONTACT, motion.mode[RIGHT] == Pair.CONTACT
    for k in range(n + 1):
        i = LANES * k
        w_l, w_r = c[i + Z.L] if left else 0.0, c[i + Z.R] if right else 0.0
        pace[k] = (k + 1) * c[i + LANES + Lane.TIME] if k < n else 0.0
        put(a, i, (w_l, w_r, w_l, w_r, 0.0, 0.0, 0.0, 0.0))
        put(b, i, (w_l, w_r, pace[k], pace[k], 0.0, 0.0, 0.0, 0.0))
    multiply(a, b, first, n)
    for k in range(n + 1):
        i, one = LANES * k, 1.0 if k == 0 else 0.0
        u_l, u_r, s_l, s_r = first[i], first[i + 1], first[i + 2], first[i + 3]
        e_l, e_r = one + loss_l * (c[i + V.L] - c[i + V.O]), one + loss_r * (c[i + V.O] - c[i + V.R])
        put(a, i, (s_l, s_r, u_l, u_r, 0.0, 0.0, 0.0, 0.0))
        put(b, i, (e_l, e_r, s_l, s_r, 0.0, 0.0, 0.0, 0.0))
    multiply(a, b, second, n)
    for k in range(n + 1):
        i, g, x_o = LANES * k, pace[k], c[LANES * k + X.O]
        put(a, i, (second[i + 2], second[i + 3], x_o + first[i], x_o, x_o - first[i + 1], c[i + V.L], c[i + V.O],
                   c[i + V.R]))
        put(b, i, (c[i + V.L] - c[i + V.O], c[i + V.O] - c[i + V.R], g, g, g, g, g, g))
    multiply(a, b, third, n)


@kernel
def base_series(motion: Motion, table: Table, n: int) -> None:
    """Write all series of the run that the tangents' equations need."""
    pair_series(motion, table, n)
    (_, second, third), rows = table.products, table.rows
    for side in (LEFT, RIGHT):
        hertzian, loss = motion.pairs[side, Law.HERTZIAN], motion.pairs[side, Law.DISSIPATION]
        slope, drag = rows[Row.SLOPE + side], rows[Row.DRAG + side]
        force, lost = rows[Row.FORCE + side], rows[Row.LOSS + side]
        for k in range(n + 1):
            i = LANES * k + side
            slope[k], drag[k] = 1.5 * hertzian * second[i], loss * hertzian * second[i + 2]
            force[k], lost[k] = hertzian * (second[i + 2] + loss * third[i]), hertzian * third[i]


@inlined
def close(table: Table, several: int, k: int) -> None:
    """Write coefficient k of u and u' of both pairs."""
    n, wide = several, table.wide
    f, out = table.series[table.stride * k :], table.closing[4 * wide * k :]
    for pair, front, back in ((0, X.L.value, X.O.value), (2, X.O.value, X.R.value)):
        for lane in range(2):
            first, second, apart = f[(front + lane) * n :], f[(back + lane) * n :], out[(pair + lane) * wide :]
            for j in range(n):
                apart[j] = first[j] - second[j]


@inlined
def impact(motion: Motion, law: Array, table: Table, side: Body, k: int) -> None:
    """Write coefficient k of the impact force of a pair, times dt/ds, to the total."""
    wide, rows = table.wide, table.rows
    force, lost, first = rows[Row.FORCE + side, k], rows[Row.LOSS + side, k], table.stride + side * wide
    per_hertz, columns = force / motion.pairs[side, Law.HERTZIAN], 2 * side * wide
    for column in range(0, wide, WIDTH):
        by_u = combine(table.closing, 4 * wide, columns + column, rows[Row.SLOPE + side], k, NOTHING)
        put(table.total, first + column,
            combine(table.closing, 4 * wide, columns + wide + column, rows[Row.DRAG + side], k, by_u))
    for j in range(law.shape[2]):
        table.total[first + j] += law[side, Law.HERTZIAN, j] * per_hertz + law[side, Law.DISSIPATION, j] * lost


@inlined
def advance_body(motion: Motion, acting: Array, table: Table, body: Body, k: int) -> None:
    """Write coefficient k + 1 of a body; the total has the products of the six numbers, and both impacts."""
    n, v, rates, row = acting.shape[2], velocity_lane(body), acting[body], motion.bodies[body]
    share, inverse, total, out = INVERSE[k + 1], 1.0 / row[Of.MASS], table.total, table.stride * (k + 1)
    stiffness, damping = row[Of.STIFFNESS] * inverse, row[Of.DAMPING] * inverse
    place = LANES * k + (3 if body == OBJECT else 2 + 2 * body)  # of its x, and of its v, among the products
    pace, way, speed = table.rows[Row.PACE, k], table.products[2, place], table.products[2, place + 3]
    gain = (k + 1) * motion.c[LANES * (k + 1) + v]
    left = 1.0 if body == OBJECT else (-1.0 if body == LEFT else 0.0)
    right = -1.0 if body == OBJECT else (1.0 if body == RIGHT else 0.0)
    on_left, on_right = total[table.stride :], total[table.stride + table.wide :]
    x, moved = total[(v - 1) * n :], total[v * n :]
    next_x, next_v = table.series[out + (v - 1) * n :], table.series[out + v * n :]
    mass, spring, damper, force = rates[Of.MASS], rates[Of.STIFFNESS], rates[Of.DAMPING], rates[Of.FORCE]
    for j in range(n):
        push = force[j] * pace - spring[j] * way - damper[j] * speed + left * on_left[j] + right * on_right[j]
        next_x[j] = share * moved[j]
        next_v[j] = share * (inverse * (push - mass[j] * gain) - (stiffness * x[j] + damping * moved[j]))


@kernel
def expand_tangents(motion: Motion, rates: Rates, table: Table, n: int) -> None:
    """Write the series of the tangents over a Taylor step of degree n."""
    base_series(motion, table, n)
    several, stride, series = rates.x.shape[1], table.stride, table.series
    series[: stride * (n + 1)] = 0.0
    for lane in range(STATES):
        for j in range(several):
            series[lane * several + j] = rates.x[lane, j]
    table.total[:] = 0.0
    begin = 0 if touches(motion, LEFT) else WIDTH * (X.O * several // WIDTH)
    end = stride if touches(motion, RIGHT) else X.R * several
    for k in range(n):
        close(table, several, k)
        for column in range(begin, end, WIDTH):
            put(table.total, column, combine(series, stride, column, table.rows[Row.PACE], k, NOTHING))
        for side in (LEFT, RIGHT):
            if motion.mode[side] == Pair.CONTACT:
                impact(motion, rates.law, table, side, k)
        for body in (LEFT, OBJECT, RIGHT):
            if touches(motion, body):
                advance_body(motion, rates.acting, table, body, k)


@kernel
def step_tangents(motion: Motion, rates: Rates, table: Table, n: int, s: float) -> None:
    """Write the tangents of the bodies in contact at s of a step, whose series are there, to `at`."""
    several = rates.x.shape[1]
    for column in range(0, table.stride, WIDTH):
        put(table.total, column, evaluate(table.series, table.stride, column, n, s))
    for body in (LEFT, OBJECT, RIGHT):
        if touches(motion, body):
            v = velocity_lane(body)
            for j in range(several):
                rates.at[v - 1, j], rates.at[v, j] = table.total[(v - 1) * several + j], table.total[v * several + j]


@kernel
def exact_length(table: Table, n: int, s: float) -> float:
    """The largest s 2^-k at which the last terms of all tangents are below NEGLECTED of their first ones.

    The step of the run is as long as its own motion allows, which may have died down where its tangents have not.
    """
    for _ in range(MOST_HALVINGS):
        fits, power = True, s ** (n - 1)
        for column in range(table.stride):
            last = power * (abs(table.series[table.stride * n + column]) * s
                            + abs(table.series[table.stride * (n - 1) + column]))
            if last > 0.0:
                largest, scale = 0.0, 1.0
                for k in range(FIRST):
                    largest = max(largest, scale * abs(table.series[table.stride * k + column]))
                    scale *= s
                fits = fits and last <= NEGLECTED * largest
        if fits:
            break
        s *= 0.5
    return s


@kernel
def shift(c: Array, n: int, s: float) -> None:
    """Expand the polynomials of all lanes about s, by Horner's scheme."""
    for first in range(n):
        for k in range(n - 1, first - 1, -1):
            for lane in range(LANES):
                c[LANES * k + lane] += s * c[LANES * (k + 1) + lane]


@kernel
def variable_at(c: Array, n: int, s: float, tau: float) -> float:
    """The s at which the time of a step is tau, which is within its length: by bisection and Newton's iteration."""
    low, high, at = 0.0, s, 0.5 * s
    for _ in range(MOST_HALVINGS):
        time, pace = 0.0, 0.0
        for k in range(n, -1, -1):
            pace = pace * at + time
            time = time * at + c[LANES * k + Lane.TIME]
        if time > tau:
            high = at
        else:
            low = at
        following = at + (tau - time) / pace if pace > 0.0 else math.inf
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - at) <= 4.0 * EPS * s:
            return following
        at = following
    return at

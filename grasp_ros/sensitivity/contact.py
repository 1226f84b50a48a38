"""Tangents of a Taylor step in contact: a linear equation whose coefficients the step has already expanded.

At fixed time the tangents obey x' = v, m v' = -k x - c v -+ (dF/du u + dF/du' u'), with what a direction changes of
the numbers added. Times dt/ds of the step's own variable all coefficients are polynomials in w = sqrt(u), so that the
tangents are as smooth as the motion itself, through touch and release, and have its radius of convergence.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.compilation.vectors import WIDTH, add_product, highest, larger, load, spread, store
from grasp_ros.exact.contact.series import put
from grasp_ros.exact.numerics.polynomial import INVERSE
from grasp_ros.exact.numerics.roots import value_and_rate
from grasp_ros.exact.records import Array
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Of, Pair, V, X, Z
from grasp_ros.sensitivity.tangents import BLOCK, STATES, STEP, Motion, Rates, Row, Table

MOST_HALVINGS = 200
NEGLECTED = 128.0 * EPS
FIRST = 6  # terms of a series, one of which is about its size


@kernel
def touches(motion: Motion, body: Body) -> bool:
    """Whether a body takes part in the contacts of a step; the others fly."""
    return body == OBJECT or motion.mode[body] == Pair.CONTACT


@kernel
def multiply(f: Array, g: Array, out: Array, n: int) -> None:
    """Write the products of eight series with eight others up to the order n; coefficients k stand from 8 k on.

    Four at a time: one sum alone would wait for each addition before the next. Behind n there must be room for three.
    """
    for k in range(0, n + 1, 4):
        a = b = c = d = spread(0.0)
        place = WIDTH * k
        for i in range(0, place + WIDTH, WIDTH):
            x, j = load(f, i), place - i
            a, b = add_product(a, x, load(g, j)), add_product(b, x, load(g, j + WIDTH))
            c, d = add_product(c, x, load(g, j + 2 * WIDTH)), add_product(d, x, load(g, j + 3 * WIDTH))
        x, y, z = load(f, place + WIDTH), load(f, place + 2 * WIDTH), load(f, place + 3 * WIDTH)
        first, second, third = load(g, 0), load(g, WIDTH), load(g, 2 * WIDTH)
        store(out, place, a)
        store(out, place + WIDTH, add_product(b, x, first))
        store(out, place + 2 * WIDTH, add_product(add_product(c, x, second), y, first))
        store(out, place + 3 * WIDTH, add_product(add_product(add_product(d, x, third), y, second), z, first))


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
        stiffer, lost = rows[Row.HERTZIAN + side], rows[Row.LOSS + side]
        for k in range(n + 1):
            i = LANES * k + side
            slope[k], drag[k] = 1.5 * hertzian * second[i], loss * hertzian * second[i + 2]
            stiffer[k], lost[k] = second[i + 2] + loss * third[i], hertzian * third[i]


@inlined
def impact(law: Array, table: Table, at: tuple[int, int], side: Body, sums: tuple[Array, Array]) -> Array:
    """Coefficient k of the impact force of a pair, times dt/ds, from the sums of what u and u' change of it."""
    (block, k), rows = at, table.rows
    hertzian, loss = load(law[side, Law.HERTZIAN], WIDTH * block), load(law[side, Law.DISSIPATION], WIDTH * block)
    stiffer = add_product(sums[0] + sums[1], hertzian, rows[Row.HERTZIAN + side, k])
    return add_product(stiffer, loss, rows[Row.LOSS + side, k])


@inlined
def advance_body(motion: Motion, acting: Array, table: Table, at: tuple[int, int], body: Body,
                 sums: tuple[Array, Array], push: Array) -> None:
    """Write coefficient k + 1 of a body, from coefficients k of x dt/ds, v dt/ds and the impacts on it."""
    (block, k), (x, moved) = at, sums
    v, row, rates, first = velocity_lane(body), motion.bodies[body], acting[body], WIDTH * block
    share, inverse = INVERSE[k + 1], 1.0 / row[Of.MASS]
    place = LANES * k + (3 if body == OBJECT else 2 + 2 * body)  # of its x, and of its v, among the products
    pace, way, speed = table.rows[Row.PACE, k], table.products[2, place], table.products[2, place + 3]
    gain = (k + 1) * motion.c[LANES * (k + 1) + v]
    driven = pace * load(rates[Of.FORCE], first) - gain * load(rates[Of.MASS], first)
    slowed = way * load(rates[Of.STIFFNESS], first) + speed * load(rates[Of.DAMPING], first)
    held = row[Of.STIFFNESS] * inverse * x + row[Of.DAMPING] * inverse * moved
    place = BLOCK * block + STEP * (k + 1) + WIDTH * (v - 1)
    store(table.series, place, share * moved)
    store(table.series, place + WIDTH, share * (inverse * (push + driven - slowed) - held))


@inlined
def advance_block(motion: Motion, rates: Rates, table: Table, at: tuple[int, int]) -> None:
    """Write coefficient k + 1 of all bodies in contact, of eight directions: one loop sums all products of series."""
    block, k = at
    f, rows, i = table.series, table.rows, BLOCK * block
    left, right = touches(motion, LEFT), touches(motion, RIGHT)
    x_l = v_l = x_o = v_o = x_r = v_r = spread(0.0)
    slope_l = drag_l = slope_r = drag_r = on_l = on_r = spread(0.0)
    for m in range(k, -1, -1):
        g, x, v = rows[Row.PACE, m], load(f, i + WIDTH * X.O), load(f, i + WIDTH * V.O)
        x_o, v_o = add_product(x_o, x, g), add_product(v_o, v, g)
        if left:
            arm, moved = load(f, i + WIDTH * X.L), load(f, i + WIDTH * V.L)
            x_l, v_l = add_product(x_l, arm, g), add_product(v_l, moved, g)
            slope_l = add_product(slope_l, arm - x, rows[Row.SLOPE + LEFT, m])
            drag_l = add_product(drag_l, moved - v, rows[Row.DRAG + LEFT, m])
        if right:
            arm, moved = load(f, i + WIDTH * X.R), load(f, i + WIDTH * V.R)
            x_r, v_r = add_product(x_r, arm, g), add_product(v_r, moved, g)
            slope_r = add_product(slope_r, x - arm, rows[Row.SLOPE + RIGHT, m])
            drag_r = add_product(drag_r, v - moved, rows[Row.DRAG + RIGHT, m])
        i += STEP
    if left:
        on_l = impact(rates.law, table, at, LEFT, (slope_l, drag_l))
        advance_body(motion, rates.acting, table, at, LEFT, (x_l, v_l), spread(0.0) - on_l)
    if right:
        on_r = impact(rates.law, table, at, RIGHT, (slope_r, drag_r))
        advance_body(motion, rates.acting, table, at, RIGHT, (x_r, v_r), on_r)
    advance_body(motion, rates.acting, table, at, OBJECT, (x_o, v_o), on_l - on_r)


@kernel
def expand_tangents(motion: Motion, rates: Rates, table: Table, n: int) -> None:
    """Write the series of the tangents over a Taylor step of degree n."""
    base_series(motion, table, n)
    blocks = rates.x.shape[1] // WIDTH
    for block in range(blocks):
        for lane in range(STATES):
            store(table.series, BLOCK * block + WIDTH * lane, load(rates.x[lane], WIDTH * block))
    for k in range(n):
        for block in range(blocks):  # none of which waits for another
            advance_block(motion, rates, table, (block, k))


@kernel
def step_tangents(motion: Motion, rates: Rates, table: Table, n: int, s: float) -> None:
    """Write the tangents of the bodies in contact at s of a step, whose series are there, to `at`."""
    for block in range(rates.x.shape[1] // WIDTH):
        for body in (LEFT, OBJECT, RIGHT):
            if touches(motion, body):
                lane, x, v = velocity_lane(body) - 1, spread(0.0), spread(0.0)
                for k in range(n, -1, -1):
                    place = BLOCK * block + STEP * k + WIDTH * lane
                    x, v = load(table.series, place) + s * x, load(table.series, place + WIDTH) + s * v
                store(rates.at[lane], WIDTH * block, x)
                store(rates.at[lane + 1], WIDTH * block, v)


@kernel
def ends_within(series: Array, first: int, n: int, s: float) -> bool:
    """Whether the last terms of eight series at s are below NEGLECTED of their first ones."""
    nothing, power = spread(0.0), s ** (n - 1)
    last = larger(load(series, first + STEP * (n - 1)), nothing) + s * larger(load(series, first + STEP * n), nothing)
    largest, scale = nothing, 1.0
    for k in range(FIRST):
        largest, scale = larger(largest, scale * load(series, first + STEP * k)), scale * s
    return not highest(power * last - NEGLECTED * largest) > 0.0


@kernel
def exact_length(motion: Motion, table: Table, n: int, s: float) -> float:
    """The largest s 2^-k at which the last terms of all tangents are below NEGLECTED of their first ones.

    The step of the run is as long as its own motion allows, which may have died down where its tangents have not.
    """
    for block in range(table.series.shape[0] // BLOCK):
        for body in (LEFT, OBJECT, RIGHT):
            first, halvings = BLOCK * block + WIDTH * (velocity_lane(body) - 1), 0
            while touches(motion, body) and halvings < MOST_HALVINGS and not (
                ends_within(table.series, first, n, s) and ends_within(table.series, first + WIDTH, n, s)
            ):
                s, halvings = 0.5 * s, halvings + 1
    return s


@kernel
def shift(c: Array, n: int, s: float) -> None:
    """Expand the polynomials of all lanes about s, by Horner's scheme."""
    for first in range(n):
        above = load(c, LANES * n)
        for i in range(LANES * (n - 1), LANES * first - 1, -LANES):
            above = load(c, i) + s * above
            store(c, i, above)


@inlined
def time_at(c: Array, n: int, s: float) -> tuple[float, float]:
    """Time since the begin of a step at s, and its derivative by s."""
    time, pace, _ = value_and_rate(c[Lane.TIME :: LANES], n, s)
    return time, pace


@kernel
def variable_at(c: Array, n: int, s: float, tau: float) -> float:
    """The s at which the time of a step is tau, which is within its length: by bisection and Newton's iteration."""
    low, high, at = 0.0, s, 0.5 * s
    for _ in range(MOST_HALVINGS):
        time, pace = time_at(c, n, at)
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

"""Series of a Taylor step of the run that the equations of its tangents need: one set for all directions."""

from __future__ import annotations

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.compilation.vectors import HALF, add_product, load_half, spread_half, store
from grasp_ros.exact.records import Array
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Pair, V, X, Z
from grasp_ros.sensitivity.tangents import WEIGHTS, Motion, Row, Table, Weight


@kernel
def touches(motion: Motion, body: Body) -> bool:
    """Whether a body takes part in the contacts of a step; the others fly."""
    return body == OBJECT or motion.mode[body] == Pair.CONTACT


@kernel
def multiply(f: Array, g: Array, out: Array, n: int) -> None:
    """Write the products of four series with four others up to the order n; coefficients k stand from 4 k on.

    Four orders at a time: one sum alone would wait for each addition before the next. Behind n there must be room for
    three.
    """
    for k in range(0, n + 1, 4):
        a = b = c = d = spread_half(0.0)
        place = HALF * k
        for i in range(0, place + HALF, HALF):
            x, j = load_half(f, i), place - i
            a, b = add_product(a, x, load_half(g, j)), add_product(b, x, load_half(g, j + HALF))
            c, d = add_product(c, x, load_half(g, j + 2 * HALF)), add_product(d, x, load_half(g, j + 3 * HALF))
        x, y, z = load_half(f, place + HALF), load_half(f, place + 2 * HALF), load_half(f, place + 3 * HALF)
        first, second, third = load_half(g, 0), load_half(g, HALF), load_half(g, 2 * HALF)
        store(out, place, a)
        store(out, place + HALF, add_product(b, x, first))
        store(out, place + 2 * HALF, add_product(add_product(c, x, second), y, first))
        store(out, place + 3 * HALF, add_product(add_product(add_product(d, x, third), y, second), z, first))


@inlined
def put(table: Array, k: int, left: float, right: float, next_left: float, next_right: float) -> None:
    """Store coefficient k of four series."""
    i = HALF * k
    table[i], table[i + 1], table[i + 2], table[i + 3] = left, right, next_left, next_right


@kernel
def pair_series(motion: Motion, table: Table, n: int) -> None:
    """Write the series that both pairs bring, by side; without contact they are 0.

    With s = w dt/ds, a polynomial in w, and h = u s: s (1 + p u') gives dF/du, h gives dF/du', h u' the damping.
    """
    c, a, b, (first, second, third) = motion.c, table.factors[0], table.factors[1], table.products
    pace, pairs = table.rows[Row.PACE], motion.pairs
    loss_l, loss_r = pairs[LEFT, Law.DISSIPATION], pairs[RIGHT, Law.DISSIPATION]
    left, right = touches(motion, LEFT), touches(motion, RIGHT)
    for k in range(n + 1):
        i = LANES * k
        w_l, w_r = c[i + Z.L] if left else 0.0, c[i + Z.R] if right else 0.0
        pace[k] = (k + 1) * c[i + LANES + Lane.TIME] if k < n else 0.0
        put(a, k, w_l, w_r, w_l, w_r)
        put(b, k, w_l, w_r, pace[k], pace[k])
    multiply(a, b, first, n)
    for k in range(n + 1):
        i, j, one = LANES * k, HALF * k, 1.0 if k == 0 else 0.0
        u_l, u_r, s_l, s_r = first[j], first[j + 1], first[j + 2], first[j + 3]
        put(a, k, s_l, s_r, u_l, u_r)
        put(b, k, one + loss_l * (c[i + V.L] - c[i + V.O]), one + loss_r * (c[i + V.O] - c[i + V.R]), s_l, s_r)
    multiply(a, b, second, n)
    for k in range(n + 1):
        i, j = LANES * k, HALF * k
        put(a, k, second[j + 2], second[j + 3], c[i + X.O] + first[j], c[i + X.O] - first[j + 1])
        put(b, k, c[i + V.L] - c[i + V.O], c[i + V.O] - c[i + V.R], pace[k], pace[k])
    multiply(a, b, third, n)


@kernel
def base_series(motion: Motion, table: Table, n: int) -> None:
    """Write all series of the run that the tangents' equations need."""
    pair_series(motion, table, n)
    (first, second, third), rows, weights, c = table.products, table.rows, table.weights, motion.c
    for side in (LEFT, RIGHT):
        if not touches(motion, side):
            continue
        hertzian, loss = motion.pairs[side, Law.HERTZIAN], motion.pairs[side, Law.DISSIPATION]
        sign, v = 1.0 if side == LEFT else -1.0, velocity_lane(side)
        for k in range(n):
            i, j = LANES * (k + 1), HALF * k + side
            store(weights, WEIGHTS * (Weight.SLOPE + side) + HALF * k, spread_half(1.5 * hertzian * second[j]))
            store(weights, WEIGHTS * (Weight.DRAG + side) + HALF * k, spread_half(loss * hertzian * second[j + 2]))
            rows[Row.HERTZIAN + side, k] = second[j + 2] + loss * third[j]
            rows[Row.LOSS + side, k] = hertzian * third[j]
            rows[Row.WAY + side, k] = third[j + 2]
            rows[Row.SPEED + side, k] = (k + 1) * (c[i + X.O] + sign * first[j + HALF])
            rows[Row.GAIN + side, k] = (k + 1) * c[i + v]
    for k in range(n):
        i = LANES * (k + 1)
        store(weights, HALF * k, spread_half(rows[Row.PACE, k]))
        rows[Row.SPEED + OBJECT, k], rows[Row.GAIN + OBJECT, k] = (k + 1) * c[i + X.O], (k + 1) * c[i + V.O]

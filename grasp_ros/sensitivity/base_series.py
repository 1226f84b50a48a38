"""Series of a Taylor step of the run that the equations of its tangents need: one set for all directions."""

from __future__ import annotations

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.compilation.vectors import HALF, add_product, load_half, spread_half, store
from grasp_ros.exact.records import Array
from grasp_ros.physics.impact_law import EXPONENT
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Pair, V, X, Z
from grasp_ros.sensitivity.tangents import AHEAD, WEIGHTS, Row, Tangents, Weight


@kernel
def touches(t: Tangents, body: Body) -> bool:
    """Whether a body takes part in the contacts of a step; the others fly."""
    return body == OBJECT or t.mode[body] == Pair.CONTACT


@kernel
def multiply(f: Array, g: Array, out: Array, n: int) -> None:
    """Write the products of four series with four others up to the order n.

    Coefficients k stand from 4 k on, those of g behind zeros. Eight orders at a time: one sum alone would wait for each
    addition before the next, and where its last products are over, the others go on with zeros.
    """
    for k in range(0, n + 1, AHEAD):
        a_0 = a_1 = a_2 = a_3 = a_4 = a_5 = a_6 = a_7 = spread_half(0.0)
        for i in range(k + AHEAD):
            x, j = load_half(f, HALF * i), HALF * (AHEAD + k - i)
            a_0, a_1 = add_product(a_0, x, load_half(g, j)), add_product(a_1, x, load_half(g, j + HALF))
            a_2, a_3 = add_product(a_2, x, load_half(g, j + 2 * HALF)), add_product(a_3, x, load_half(g, j + 3 * HALF))
            a_4, a_5 = add_product(a_4, x, load_half(g, j + 4 * HALF)), add_product(a_5, x, load_half(g, j + 5 * HALF))
            a_6, a_7 = add_product(a_6, x, load_half(g, j + 6 * HALF)), add_product(a_7, x, load_half(g, j + 7 * HALF))
        for order, total in enumerate((a_0, a_1, a_2, a_3, a_4, a_5, a_6, a_7)):
            store(out, HALF * (k + order), total)


@inlined
def put(table: Array, k: int, left: float, right: float, next_left: float, next_right: float) -> None:
    """Store coefficient k of four series."""
    i = HALF * k
    table[i], table[i + 1], table[i + 2], table[i + 3] = left, right, next_left, next_right


@kernel
def pair_series(t: Tangents, n: int) -> None:
    """Write the series that both pairs bring, by side; without contact they are 0.

    With s = w dt/ds, a polynomial in w, and h = u s: s (1 + p u') gives dF/du, h gives dF/du', h u' the damping.
    """
    c, a, b, (first, second, third) = t.c, t.factors[0], t.factors[1], t.products
    pace, pairs = t.rows[Row.PACE], t.pairs
    loss_l, loss_r = pairs[LEFT, Law.DISSIPATION], pairs[RIGHT, Law.DISSIPATION]
    left, right = touches(t, LEFT), touches(t, RIGHT)
    for k in range(n + 1):
        i = LANES * k
        w_l, w_r = c[i + Z.L] if left else 0.0, c[i + Z.R] if right else 0.0
        pace[k] = (k + 1) * c[i + LANES + Lane.TIME] if k < n else 0.0
        put(a, k, w_l, w_r, w_l, w_r)
        put(b, AHEAD + k, w_l, w_r, pace[k], pace[k])
    multiply(a, b, first, n)
    for k in range(n + 1):
        i, j, one = LANES * k, HALF * k, 1.0 if k == 0 else 0.0
        u_l, u_r, s_l, s_r = first[j], first[j + 1], first[j + 2], first[j + 3]
        put(a, k, s_l, s_r, u_l, u_r)
        put(b, AHEAD + k, one + loss_l * (c[i + V.L] - c[i + V.O]), one + loss_r * (c[i + V.O] - c[i + V.R]), s_l, s_r)
    multiply(a, b, second, n)
    for k in range(n + 1):
        i, j = LANES * k, HALF * k
        put(a, k, second[j + 2], second[j + 3], c[i + X.O] + first[j], c[i + X.O] - first[j + 1])
        put(b, AHEAD + k, c[i + V.L] - c[i + V.O], c[i + V.O] - c[i + V.R], pace[k], pace[k])
    multiply(a, b, third, n)


@kernel
def base_series(t: Tangents, n: int) -> None:
    """Write all series of the run that the tangents' equations need."""
    pair_series(t, n)
    (first, second, third), rows, weights, c = t.products, t.rows, t.weights, t.c
    for side in (LEFT, RIGHT):
        if not touches(t, side):
            continue
        hertzian, loss = t.pairs[side, Law.HERTZIAN], t.pairs[side, Law.DISSIPATION]
        sign, v = 1.0 if side == LEFT else -1.0, velocity_lane(side)
        for k in range(n):
            i, j = LANES * (k + 1), HALF * k + side
            store(weights, WEIGHTS * (Weight.SLOPE + side) + HALF * k, spread_half(EXPONENT * hertzian * second[j]))
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

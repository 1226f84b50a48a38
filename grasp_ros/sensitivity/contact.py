"""Tangents of a Taylor step in contact: a linear equation whose coefficients the step has already expanded.

At fixed time the tangents obey x' = v, m v' = -k x - c v -+ (dF/du u + dF/du' u'), with what a direction changes of
the numbers added. Times dt/ds of the step's own variable all coefficients are polynomials in w = sqrt(u), so that the
tangents are as smooth as the motion itself, through touch and release, and have its radius of convergence. The
polynomials of the run are one set for all directions.
"""

from __future__ import annotations

from grasp_ros.exact.compensated import velocity_lane
from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.compilation.vectors import HALF, add_product, highest, larger, load_half, spread_half, store
from grasp_ros.exact.impact import damping_factor, elastic_slope
from grasp_ros.exact.kinematics import approach
from grasp_ros.exact.numerics.polynomial import INVERSE
from grasp_ros.exact.records import Array
from grasp_ros.physics.impact_law import EXPONENT
from grasp_ros.physics.layout import EPS, LANES, LEFT, OBJECT, RIGHT, Body, Lane, Law, Of, Pair, U, V, X, Z
from grasp_ros.sensitivity.tangents import AHEAD, BLOCK, STATES, STEP, WEIGHTS, Row, Tangents, Weight

MOST_HALVINGS = 200
NEGLECTED = 4096.0 * EPS  # 1e-12 for a step; one digit more costs 5 %, as more steps are made in parts
FIRST = 6  # terms of a series, one of which is about its size
Sums = tuple[Array, Array, Array, Array]  # of a pair, times dt/ds: x and v of the arm, v of the object, impact force


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


@inlined
def apart(side: Body, arm: Array, middle: Array) -> Array:
    """What changes of x of an arm and the object make of u, or changes of v of u'."""
    return arm - middle if side == LEFT else middle - arm


@inlined
def sum_products(t: Tangents, block: int, k: int, side: Body) -> tuple[Sums, Sums]:
    """Sum the products of series for coefficients k and k + 1 that a pair in contact brings, of four directions.

    Two orders share what they take from memory, which is what takes the time; the product with coefficient k + 1, which
    is not known yet, is left to `add_newest`.
    """
    f, weights, i, arm = t.series, t.weights, BLOCK * block, HALF * velocity_lane(side)
    to_slope, to_drag = WEIGHTS * (Weight.SLOPE + side), WEIGHTS * (Weight.DRAG + side)
    x_0 = v_0 = o_0 = slope_0 = drag_0 = x_1 = v_1 = o_1 = slope_1 = drag_1 = spread_half(0.0)
    for m in range(HALF * k, -1, -HALF):
        pace, later = load_half(weights, m), load_half(weights, m + HALF)
        x, v, v_o = load_half(f, i + arm - HALF), load_half(f, i + arm), load_half(f, i + HALF * V.O)
        x_0, x_1 = add_product(x_0, x, pace), add_product(x_1, x, later)
        v_0, v_1 = add_product(v_0, v, pace), add_product(v_1, v, later)
        o_0, o_1 = add_product(o_0, v_o, pace), add_product(o_1, v_o, later)
        u, rate = apart(side, x, load_half(f, i + HALF * X.O)), apart(side, v, v_o)
        slope_0 = add_product(slope_0, u, load_half(weights, to_slope + m))
        slope_1 = add_product(slope_1, u, load_half(weights, to_slope + m + HALF))
        drag_0 = add_product(drag_0, rate, load_half(weights, to_drag + m))
        drag_1 = add_product(drag_1, rate, load_half(weights, to_drag + m + HALF))
        i += STEP
    return (x_0, v_0, o_0, slope_0 + drag_0), (x_1, v_1, o_1, slope_1 + drag_1)


@inlined
def add_newest(t: Tangents, block: int, k: int, side: Body, sums: Sums) -> Sums:
    """Sums of a pair for coefficient k with the products with the coefficients k, which have just been found."""
    f, weights, i, arm = t.series, t.weights, BLOCK * block + STEP * k, HALF * velocity_lane(side)
    pace, slope = load_half(weights, 0), load_half(weights, WEIGHTS * (Weight.SLOPE + side))
    drag = load_half(weights, WEIGHTS * (Weight.DRAG + side))
    x, v, v_o = load_half(f, i + arm - HALF), load_half(f, i + arm), load_half(f, i + HALF * V.O)
    push = add_product(sums[3], apart(side, x, load_half(f, i + HALF * X.O)), slope)
    return (add_product(sums[0], x, pace), add_product(sums[1], v, pace), add_product(sums[2], v_o, pace),
            add_product(push, apart(side, v, v_o), drag))


@inlined
def impact(t: Tangents, block: int, k: int, side: Body, total: Array) -> Array:
    """Coefficient k of the change of the impact force of a pair, times dt/ds."""
    law, first, rows = t.law[side], HALF * block, t.rows
    total = add_product(total, load_half(law[Law.HERTZIAN], first), rows[Row.HERTZIAN + side, k])
    return add_product(total, load_half(law[Law.DISSIPATION], first), rows[Row.LOSS + side, k])


@inlined
def advance_body(t: Tangents, block: int, k: int, body: Body, x: Array, v: Array, push: Array) -> None:
    """Write coefficient k + 1 of a body, from those of its x and v times dt/ds and of the impacts on it."""
    rows, row, own = t.rows, t.bodies[body], t.acting[body]
    share, inverse, first = INVERSE[k + 1], 1.0 / row[Of.MASS], HALF * block
    driven = rows[Row.PACE, k] * load_half(own[Of.FORCE], first)
    driven = driven - rows[Row.GAIN + body, k] * load_half(own[Of.MASS], first)
    slowed = rows[Row.WAY + body, k] * load_half(own[Of.STIFFNESS], first)
    slowed = slowed + rows[Row.SPEED + body, k] * load_half(own[Of.DAMPING], first)
    held = row[Of.STIFFNESS] * inverse * x + row[Of.DAMPING] * inverse * v
    first = BLOCK * block + STEP * (k + 1) + HALF * (velocity_lane(body) - 1)
    store(t.series, first, share * v)
    store(t.series, first + HALF, share * (inverse * (push + driven - slowed) - held))


@inlined
def advance(t: Tangents, block: int, k: int, of_left: Sums, of_right: Sums) -> None:
    """Write coefficients k + 1 of the bodies in contact from the sums of the pairs for coefficients k."""
    on_left = on_right = v_o = nothing = spread_half(0.0)
    if touches(t, LEFT):
        x, v, v_o, push = of_left
        on_left = impact(t, block, k, LEFT, push)
        advance_body(t, block, k, LEFT, x, v, nothing - on_left)
    if touches(t, RIGHT):
        x, v, v_o, push = of_right
        on_right = impact(t, block, k, RIGHT, push)
        advance_body(t, block, k, RIGHT, x, v, on_right)
    advance_body(t, block, k, OBJECT, nothing, v_o, on_left - on_right)  # no spring holds it


@kernel
def expand_tangents(t: Tangents, n: int) -> None:
    """Write the series of the tangents over a Taylor step of even degree n."""
    base_series(t, n)
    nothing = spread_half(0.0)
    for block in range(t.x.shape[1] // HALF):
        for lane in range(STATES):
            store(t.series, BLOCK * block + HALF * lane, load_half(t.x[lane], HALF * block))
        for k in range(0, n, 2):
            left_0 = left_1 = right_0 = right_1 = (nothing, nothing, nothing, nothing)
            if touches(t, LEFT):
                left_0, left_1 = sum_products(t, block, k, LEFT)
            if touches(t, RIGHT):
                right_0, right_1 = sum_products(t, block, k, RIGHT)
            advance(t, block, k, left_0, right_0)
            if touches(t, LEFT):
                left_1 = add_newest(t, block, k + 1, LEFT, left_1)
            if touches(t, RIGHT):
                right_1 = add_newest(t, block, k + 1, RIGHT, right_1)
            advance(t, block, k + 1, left_1, right_1)


@kernel
def step_tangents(t: Tangents, n: int, s: float) -> None:
    """Write the tangents of the bodies in contact at s of a step, whose series are there, to `at`."""
    for block in range(t.x.shape[1] // HALF):
        for body in (LEFT, OBJECT, RIGHT):
            lane, x, v = velocity_lane(body), spread_half(0.0), spread_half(0.0)
            if not touches(t, body):
                continue
            for i in range(BLOCK * block + STEP * n + HALF * lane, BLOCK * block + HALF * lane - 1, -STEP):
                x = add_product(load_half(t.series, i - HALF), x, s)
                v = add_product(load_half(t.series, i), v, s)
            store(t.at[lane - 1], HALF * block, x)
            store(t.at[lane], HALF * block, v)


@kernel
def ends_within(series: Array, first: int, n: int, s: float) -> bool:
    """Whether the last terms of four series at s are below NEGLECTED of their first ones."""
    nothing, power = spread_half(0.0), s ** (n - 1)
    last = larger(load_half(series, first + STEP * (n - 1)), nothing)
    last = last + s * larger(load_half(series, first + STEP * n), nothing)
    largest, scale = nothing, 1.0
    for k in range(FIRST):
        largest, scale = larger(largest, scale * load_half(series, first + STEP * k)), scale * s
    return not highest(power * last - NEGLECTED * largest) > 0.0


@kernel
def exact_length(t: Tangents, n: int, s: float) -> float:
    """The largest s 2^-k at which the last terms of all tangents are below NEGLECTED of their first ones.

    The step of the run is as long as its own motion allows, which may have died down where its tangents have not.
    """
    for block in range(t.series.shape[0] // BLOCK):
        for body in (LEFT, OBJECT, RIGHT):
            first, halvings = BLOCK * block + HALF * (velocity_lane(body) - 1), 0
            while touches(t, body) and halvings < MOST_HALVINGS and not (
                ends_within(t.series, first, n, s) and ends_within(t.series, first + HALF, n, s)
            ):
                s, halvings = 0.5 * s, halvings + 1
    return s


@kernel
def add_neglected(t: Tangents, side: Body, span: float) -> None:
    """Add the slope of the force of a pair that begins or leaves: its impulse is below rounding, its slope is not.

    It begins from u = 0, or leaves to it, by a power of the time.
    """
    u, after, arm = t.before[U.L + side], t.y[U.L + side], velocity_lane(side)
    deepest = max(u, after)
    if deepest <= 0.0:
        return
    rate = approach(t.y if after > u else t.before, side)
    factor = max(damping_factor(t.pairs[side, Law.DISSIPATION], rate), 0.0)
    slope = elastic_slope(t.pairs[side, Law.HERTZIAN], deepest)
    mean = slope / (1.0 + (EXPONENT - 1.0) * abs(rate) * span / deepest)  # for u = a t^n
    impulse = span * factor * mean
    arm_mass, mass = t.bodies[side, Of.MASS], t.bodies[OBJECT, Of.MASS]
    for j in range(t.x.shape[1]):
        apart = t.x[arm - 1, j] - t.x[X.O, j]
        t.x[arm, j] -= impulse * apart / arm_mass
        t.x[V.O, j] += impulse * apart / mass

"""Contact in regularised variables, integrated by Taylor series of high order.

u^(3/2) is only once differentiable at a touch. With w = sqrt(u) and a new independent variable s,

    dt = 2 G ds,   dw/ds = (G / w) u',   d(.)/ds = 2 G d(.)/dt,   G = w, or w_l w_r with both sides in contact,

every right-hand side is a polynomial in w, the positions and the velocities: the solution is analytic through
touch and release, and w simply crosses zero at release. Its Taylor coefficients follow from recurrences whose
only nonlinear operation is the product of two series (Cauchy product), so one step is one loop over the order.
The coefficients are also the dense output, and bounds on them prove where an event function has no root.

With g = H w^4, or H w_l^4 w_r, the impulse of (6) per 2 ds is g (1 + p u'). An order waits only for the newest
coefficients of the velocities, and they pass through one product; w, u = w^2 and g are known one order ahead.
"""


import numpy as np

from grasp_ros.exact.compilation.jit import inlined, kernel, whole
from grasp_ros.exact.compilation.vectors import add_product, fma, load, numbers_of, spread
from grasp_ros.exact.numerics.polynomial import product
from grasp_ros.exact.numerics.powers_of_two import exponent, power_of_two
from grasp_ros.exact.records import FACTORS, Array, Lanes, PerMass
from grasp_ros.physics.layout import LANES, LEFT, OBJECT, RIGHT, Lane, Law, Of, V, X, Z

SECOND = 16  # where the second factors of an order begin
LARGEST = 960  # binary exponent of a unit
FIRST, UPPER, ONE, TWO = (whole(number) for number in (0, 8, 1, 2))  # typed, or `convolve` is compiled for each


@kernel
def convolve(f: Array, k: int, lane: int, skip: int) -> Lanes:
    """Coefficients k of eight products of series, without the terms that hold a coefficient below `skip`.

    f has FACTORS numbers for each order. The caller adds the terms that are left out: they hold the newest
    coefficients, which have just been stored one by one, and reading those as a vector would wait. The others are added
    in two sums, as each addition waits for the one before, and from the middle coefficients to the newest.
    """
    low, high, half = spread(0.0), spread(0.0), (k + 1) // 2
    for i in range(1, half + 1 - skip):
        j = half - i
        low = add_product(low, load(f, FACTORS * j + lane), load(f, FACTORS * (k - j) + SECOND + lane))
        high = add_product(high, load(f, FACTORS * (k - j) + lane), load(f, FACTORS * j + SECOND + lane))
    total = low + high
    if k % 2 == 0 and half >= skip:
        total = add_product(total, load(f, FACTORS * half + lane), load(f, FACTORS * half + SECOND + lane))
    return numbers_of(total)


@kernel
def per_mass(body: Array) -> PerMass:
    """Inverse mass, k / m, c / m and f / m of a body."""
    inverse = 1.0 / body[Of.MASS]
    return inverse, body[Of.STIFFNESS] * inverse, body[Of.DAMPING] * inverse, body[Of.FORCE] * inverse


@kernel
def accelerations(bodies: tuple[PerMass, PerMass, PerMass], one: float, x_o: float, u: tuple[float, float],
                  v: tuple[float, float, float]) -> tuple[float, float, float]:
    """A coefficient of the accelerations of left arm, object and right arm without impact, (1) to (3).

    `one` is 1 in order 0, then 0.
    """
    left, middle, right = bodies
    return (
        fma(-left[2], v[0], fma(-left[1], x_o + u[0], one * left[3])),
        fma(-middle[2], v[1], fma(-middle[1], x_o, one * middle[3])),
        fma(-right[2], v[2], fma(-right[1], x_o - u[1], one * right[3])),
    )


@kernel
def store_eight(table: Array, i: int, x: Lanes) -> None:
    """Store eight neighbouring numbers."""
    table[i], table[i + 1], table[i + 2], table[i + 3] = x[0], x[1], x[2], x[3]
    table[i + 4], table[i + 5], table[i + 6], table[i + 7] = x[4], x[5], x[6], x[7]


@kernel
def with_ends(total: float, a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> float:
    """A sum of `convolve` with its four outer terms, of coefficients 0, 1, n - 1 and n of both series.

    That with coefficient n of the first series, the newest number, comes last.
    """
    return fma(a[3], b[0], fma(a[0], b[3], total) + fma(a[2], b[1], a[1] * b[2]))


@inlined
def scale_of(unit: float) -> float:
    """The power of two of a unit; 1 above 2^LARGEST, where only numbers near the limits of doubles move."""
    e = exponent(unit)
    return power_of_two(e) if e <= LARGEST else 1.0


@inlined
def expand_one(c: Array, f: Array, bodies: Array, pairs: Array, side: int, unit: float, n: int) -> None:
    """Fill the Taylor table c from its order 0, with one side in contact: G = w. The series are in s / unit.

    Products: w v_o, w u' of the open side, w a_l, w a_r, w a_o, w w, u u, g (1 + p u'). Their terms with coefficients 0
    and 1 are added here. The term of a coefficient with itself occurs once, all others twice: so the constants that
    multiply the newest coefficients are set, or doubled, after the order of that term.
    """
    hertzian, loss = pairs[side, Law.HERTZIAN], pairs[side, Law.DISSIPATION]
    left, middle, right = per_mass(bodies[LEFT]), per_mass(bodies[OBJECT]), per_mass(bodies[RIGHT])
    on_left = side == LEFT
    push_l, push_r, push_o = (left[0], 0.0, middle[0]) if on_left else (0.0, right[0], -middle[0])
    x_o, v_l, v_o, v_r = c[X.O], c[V.L], c[V.O], c[V.R]
    w, gap = (c[Z.L], c[Z.R]) if on_left else (c[Z.R], c[Z.L])
    w_0, g_0, w_end, u_end = w, hertzian * ((w * w) * (w * w)), w, w * w  # w_end, u_end multiply the newest w, u
    w_1 = g_1 = w_next = u_next = w_before = u_before = g_before = 0.0
    first = second = before = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(np.uint64(n)):
        gv, gd, gl, gr, go, u, q, z = convolve(f, k, FIRST, TWO)
        u = fma(w_end, w, fma(w_next, w_before, u))
        q = fma(u_end, u, fma(u_next, u_before, q))
        g = hertzian * q  # H w^4: the elastic force H w^3, times the w of dt = 2 w ds
        u_l, u_r = (u, gap) if on_left else (gap, u)
        one = 1.0 if k == 0 else 0.0
        a_l, a_o, a_r = accelerations((left, middle, right), one, x_o, (u_l, u_r), (v_l, v_o, v_r))
        d, d_open = (v_l - v_o, v_o - v_r) if on_left else (v_o - v_r, v_l - v_o)
        e = fma(loss, d, one)  # 1 + p u'
        now = (v_o, d_open, a_l, a_r, a_o, e)
        # The impact law (6) per 2 ds: H w^4 (1 + p u').
        z = with_ends(z, (first[5], second[5], before[5], e), (g_0, g_1, g_before, g))
        ends = (w_0, w_1, w_before, w)
        gv = with_ends(gv, (first[0], second[0], before[0], v_o), ends)
        gd = with_ends(gd, (first[1], second[1], before[1], d_open), ends)
        gl = with_ends(gl, (first[2], second[2], before[2], a_l), ends)
        gr = with_ends(gr, (first[3], second[3], before[3], a_r), ends)
        go = with_ends(go, (first[4], second[4], before[4], a_o), ends)
        store_eight(f, FACTORS * k, (v_o, d_open, a_l, a_r, a_o, w, u, e))
        store_eight(f, FACTORS * k + SECOND, (w, w, w, w, w, w, u, g))
        if k == 0:
            first, w_end, u_end = now, 2.0 * w, 2.0 * u
        elif k == 1:
            w_1, g_1, w_next, u_next = w, g, w, u
        elif k == 2:
            second, w_next, u_next = before, 2.0 * w_next, 2.0 * u_next
        before, w_before, u_before, g_before = now, w, u, g
        step = unit / (k + 1)
        c[LANES * k + Lane.CHECK] = u
        time, w = 2.0 * step * w, step * d
        x_o, gap = 2.0 * step * gv, 2.0 * step * gd
        v_l, v_r = 2.0 * step * fma(-push_l, z, gl), 2.0 * step * fma(push_r, z, gr)
        v_o = 2.0 * step * fma(push_o, z, go)
        z_l, z_r = (w, gap) if on_left else (gap, w)
        store_eight(c, LANES * (k + 1), (time, v_l, x_o, v_o, 0.0, v_r, z_l, z_r))


@inlined
def expand_both(c: Array, f: Array, bodies: Array, pairs: Array, unit: float, n: int) -> None:
    """Fill the Taylor table c from its order 0, with both sides in contact: G = w_l w_r. The series are in s / unit.

    The power of two of the unit is a part of G here: in shallow contacts products of G alone with accelerations would
    underflow.

    Products: G v_o, G a_l, G a_r, G a_o, w_l w_r, w_r u_l', w_l u_r'; then for each side w w, u u, w^4 w of the other
    side, g (1 + p u'). The sum of w_l w_r has the same roundings in a mirrored grasp.
    """
    hertz_l, loss_l = pairs[LEFT, Law.HERTZIAN], pairs[LEFT, Law.DISSIPATION]
    hertz_r, loss_r = pairs[RIGHT, Law.HERTZIAN], pairs[RIGHT, Law.DISSIPATION]
    left, middle, right = per_mass(bodies[LEFT]), per_mass(bodies[OBJECT]), per_mass(bodies[RIGHT])
    x_o, v_l, v_o, v_r, w_l, w_r = c[X.O], c[V.L], c[V.O], c[V.R], c[Z.L], c[Z.R]
    scale = scale_of(unit)
    unit /= scale
    s_l, s_r = scale * w_l, scale * w_r
    b = (w_l * s_r, s_l, s_r, hertz_l * ((w_l * w_l) * (w_l * w_l) * s_r),
         hertz_r * ((w_r * w_r) * (w_r * w_r) * s_l))
    w_end_l, w_end_r, u_end_l, u_end_r = w_l, w_r, w_l * w_l, w_r * w_r
    a = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(np.uint64(n)):
        gv, gl, gr, go, wd_l, wd_r, ww, _ = convolve(f, k, FIRST, ONE)
        u_l, u_r, q_l, q_r, g_l, g_r, z_l, z_r = convolve(f, k, UPPER, ONE)
        u_l, u_r = fma(w_end_l, w_l, u_l), fma(w_end_r, w_r, u_r)
        q_l, q_r = fma(u_end_l, u_l, q_l), fma(u_end_r, u_r, q_r)
        g_l, g_r = hertz_l * fma(q_l, b[2], fma(a[7], s_r, g_l)), hertz_r * fma(q_r, b[1], fma(a[8], s_l, g_r))
        ww += w_l * b[2] + a[6] * s_r
        one = 1.0 if k == 0 else 0.0
        a_l, a_o, a_r = accelerations((left, middle, right), one, x_o, (u_l, u_r), (v_l, v_o, v_r))
        d_l, d_r = v_l - v_o, v_o - v_r
        e_l, e_r = fma(loss_l, d_l, one), fma(loss_r, d_r, one)
        # The impact law (6) per 2 ds, of each side: H w^4 (1 + p u') times the other side's w.
        z_l, z_r = fma(e_l, b[3], fma(a[9], g_l, z_l)), fma(e_r, b[4], fma(a[10], g_r, z_r))
        wd_l, wd_r = fma(d_l, b[2], fma(a[4], s_r, wd_l)), fma(d_r, b[1], fma(a[5], s_l, wd_r))
        gv, gl = fma(v_o, b[0], fma(a[0], ww, gv)), fma(a_l, b[0], fma(a[1], ww, gl))
        gr, go = fma(a_r, b[0], fma(a[2], ww, gr)), fma(a_o, b[0], fma(a[3], ww, go))
        store_eight(f, FACTORS * k, (v_o, a_l, a_r, a_o, d_l, d_r, w_l, 0.0))
        store_eight(f, FACTORS * k + 8, (w_l, w_r, u_l, u_r, q_l, q_r, e_l, e_r))
        store_eight(f, FACTORS * k + SECOND, (ww, ww, ww, ww, s_r, s_l, s_r, 0.0))
        store_eight(f, FACTORS * k + SECOND + 8, (w_l, w_r, u_l, u_r, s_r, s_l, g_l, g_r))
        if k == 0:
            a = (v_o, a_l, a_r, a_o, d_l, d_r, w_l, q_l, q_r, e_l, e_r)
            w_end_l, w_end_r, u_end_l, u_end_r = 2.0 * w_l, 2.0 * w_r, 2.0 * u_l, 2.0 * u_r
        step = unit / (k + 1)
        twice = 2.0 * step
        c[LANES * k + Lane.CHECK] = ww
        w_l, w_r, x_o = step * wd_l, step * wd_r, twice * gv
        s_l, s_r = scale * w_l, scale * w_r
        v_l, v_r = twice * fma(-left[0], z_l, gl), twice * fma(right[0], z_r, gr)
        v_o = twice * fma(middle[0], z_l - z_r, go)
        store_eight(c, LANES * (k + 1), (twice * ww, v_l, x_o, v_o, 0.0, v_r, w_l, w_r))


@kernel
def expand_force(c: Array, pairs: Array, side: int, n: int, room: Array) -> None:
    """Write the series of an impact force, H w^3 (1 + p u') in N, of a finished table to the begin of `room`.

    That has room for four series; those behind the force are scratch.
    """
    hertzian, loss = pairs[side, Law.HERTZIAN], pairs[side, Law.DISSIPATION]
    force, w, square, e = room[: n + 1], room[n + 1 : 2 * n + 2], room[2 * n + 2 : 3 * n + 3], room[3 * n + 3 :]
    front, back = (V.L, V.O) if side == LEFT else (V.O, V.R)
    for k in range(n + 1):
        w[k] = c[LANES * k + Z.L + side]
        e[k] = loss * (c[LANES * k + front] - c[LANES * k + back])
    e[FIRST] += 1.0
    product(w, w, square, n)
    product(square, w, force, n)
    product(force, e, square, n)
    for k in range(n + 1):
        force[k] = hertzian * square[k]

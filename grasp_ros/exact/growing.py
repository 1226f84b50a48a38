"""The series of a step in which one pair still comes from rest beside another one that pushes it.

Its u grows with a power of t that is no whole number, t^3.5 beside a new impact: series in the variable of `series`
reach a part of its age, however long nothing else happens. With z = sqrt(u) of this pair

    dt = 2 P ds,   P = u / u',   so that   dz/ds = z:

s is the logarithm of z. Powers of t are exponential functions of it, whose series converge everywhere, and whose terms
have one sign: they may be large on the way, unlike those of a relaxation.
"""

from __future__ import annotations

from grasp_ros.exact.fused import fma
from grasp_ros.exact.jit import kernel
from grasp_ros.exact.kinematics import other
from grasp_ros.exact.records import Array
from grasp_ros.exact.series import FACTORS, FIRST, ONE, SECOND, UPPER, accelerations, convolve, per_mass, put
from grasp_ros.physics.layout import (
    CHECK,
    DISSIPATION,
    HERTZIAN,
    LANES,
    LEFT,
    OBJECT,
    RIGHT,
    V_L,
    V_O,
    V_R,
    X_O,
    Z_L,
    Z_R,
    Body,
)

Two = tuple[float, float]
Three = tuple[float, float, float]
Four = tuple[float, float, float, float]
Five = tuple[float, float, float, float, float]


@kernel
def ends(total: float, a: float, b_0: float, a_0: float, b: float) -> float:
    """A sum of `convolve` with its outer terms; a_0 is 0 in order 0, where they are one."""
    return fma(a, b_0, fma(a_0, b, total))


@kernel
def next_motion(c: Array, k: int, twice: float, masses: Three, moved: Five, impacts: Two, z: Two) -> Four:
    """Store the coefficients k of all lanes; returns those of x_o, v_l, v_o, v_r.

    masses: the inverse ones of the left arm, the right arm and the object. moved: without impacts, P, P v_o and P times
    the accelerations in that order.
    """
    p, gv, gl, gr, go = moved
    y_l, y_r = impacts
    x_o, v_o = twice * gv, twice * fma(masses[2], y_l - y_r, go)
    v_l, v_r = twice * fma(-masses[0], y_l, gl), twice * fma(masses[1], y_r, gr)
    put(c, LANES * k, twice * p, v_l, x_o, v_o, 0.0, v_r, z[0], z[1])
    return x_o, v_l, v_o, v_r


@kernel
def expand_growing(c: Array, f: Array, bodies: Array, pairs: Array, side: Body, unit: float, n: int) -> None:
    """Fill the Taylor table c from its order 0, with both sides in contact; `side` grows. The series are in s / unit.

    P and Q = dw/ds of the other pair are quotients, from P d = u with d = u' and from Q w = P u' of the other pair. z
    and z^3 are exponential functions.

    Products: P v_o, P a_l, P a_r, P a_o, P u' of the other pair, P d, Q w, H z^3 P; then of the other pair w w, u w,
    H w^3 P, and both impact laws per 2 ds.
    """
    on_left, pair, beside = side == LEFT, pairs[side], pairs[other(side)]
    left, right, middle = per_mass(bodies[LEFT]), per_mass(bodies[RIGHT]), per_mass(bodies[OBJECT])
    x_o, v_l, v_o, v_r = c[X_O], c[V_L], c[V_O], c[V_R]
    z, w = (c[Z_L], c[Z_R]) if on_left else (c[Z_R], c[Z_L])
    v, cube = z * z, pair[HERTZIAN] * (z * z * z)
    d_0 = v_l - v_o if on_left else v_o - v_r
    p = v / d_0
    b = (p, w, d_0, beside[HERTZIAN] * (w * w * w * p), cube * p)
    a = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(n):
        gv, gl, gr, go, pw, pd, qw, g_z = convolve(f, k, FIRST, ONE)
        u, uw, g_w, y_w, y_z, _, _, _ = convolve(f, k, UPPER, ONE)
        u = ends(u, w, b[1], a[8], w)
        uw = ends(uw, u, b[1], a[9], w)
        d_l, d_r = v_l - v_o, v_o - v_r
        d, d_w = (d_l, d_r) if on_left else (d_r, d_l)
        p = (v - fma(a[5], d, pd)) / b[2]
        q = (ends(pw, d_w, b[0], a[4], p) - fma(a[6], w, qw)) / b[1]
        g_w, g_z = beside[HERTZIAN] * ends(g_w, uw, b[0], a[10], p), ends(g_z, cube, b[0], a[7], p)
        one = 1.0 if k == 0 else 0.0
        u_l, u_r = (v, u) if on_left else (u, v)
        a_l, a_r, a_o = accelerations(left, right, middle, one, x_o, u_l, u_r, v_l, v_o, v_r)
        e, e_w = fma(pair[DISSIPATION], d, one), fma(beside[DISSIPATION], d_w, one)
        y_w, y_z = ends(y_w, e_w, b[3], a[11], g_w), ends(y_z, e, b[4], a[12], g_z)
        gv, gl = ends(gv, v_o, b[0], a[0], p), ends(gl, a_l, b[0], a[1], p)
        gr, go = ends(gr, a_r, b[0], a[2], p), ends(go, a_o, b[0], a[3], p)
        put(f, FACTORS * k, v_o, a_l, a_r, a_o, d_w, p, q, cube)
        put(f, FACTORS * k + 8, w, u, uw, e_w, e, 0.0, 0.0, 0.0)
        put(f, FACTORS * k + SECOND, p, p, p, p, p, d, w, p)
        put(f, FACTORS * k + SECOND + 8, w, w, p, g_w, g_z, 0.0, 0.0, 0.0)
        if k == 0:
            a = (v_o, a_l, a_r, a_o, d_w, p, q, cube, w, u, uw, e_w, e)
        c[LANES * k + CHECK] = p
        step = unit / (k + 1)
        w, z, v, cube = step * q, step * z, 2.0 * step * v, 3.0 * step * cube
        x_o, v_l, v_o, v_r = next_motion(
            c, k + 1, 2.0 * step, (left[0], right[0], middle[0]), (p, gv, gl, gr, go),
            (y_z, y_w) if on_left else (y_w, y_z), (z, w) if on_left else (w, z))

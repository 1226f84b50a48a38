"""Contact in regularised variables, integrated by Taylor series of high order.

u^(3/2) is only once differentiable at a touch. With w = sqrt(u) and a new independent variable s,

    dt = 2 G ds,   dw/ds = (G / w) u',   d(.)/ds = 2 G d(.)/dt,   G = w, or w_l w_r with both sides in contact,

every right-hand side is a polynomial in w, the positions and the velocities: the solution is analytic through
touch and release, and w simply crosses zero at release. Its Taylor coefficients follow from recurrences whose
only nonlinear operation is the product of two series (Cauchy product), so one step is one loop over the order.
The coefficients are also the dense output, and bounds on them prove where an event function has no root.

Source of step size and order: A. Jorba, M. Zou, A software package for the numerical integration of ODEs by
means of high-order Taylor methods, Experimental Mathematics 14 (2005), sections 3.1 and 3.2.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.jit import kernel
from grasp_ros.physics.layout import (
    DAMPING,
    DISSIPATION,
    FORCE,
    HERTZ,
    LEFT,
    MASS,
    OBJECT,
    RIGHT,
    STIFFNESS,
    U_L,
    U_R,
    V_L,
    V_O,
    V_R,
    X_O,
)
from grasp_ros.physics.polynomial import evaluate

# Rows of the coefficient table. x_o, v_l, ..., u_r stand in their places of the state y (x_l and x_r follow from
# them); then time, w, G, u' and 1 + p u'.
TIME, W_L, W_R, G, D_L, D_R, E_L, E_R, ROWS = range(8, 17)
CACHE_LINE = 64  # bytes
LANES = 16  # products of series in one step, see `convolve`

TAIL = 5  # at a touch with p = 0 only every fifth coefficient differs from zero


def series_order(tolerance: float) -> int:
    """Order that costs least for a tolerance.

    Jorba and Zou derive -ln(tolerance) / 2 + 1 from a work that grows with the square of the order. Here the work
    per order is nearly constant, because a product is one short loop over vectors: the measured optimum is higher.
    """
    return math.ceil(-0.8 * math.log(tolerance)) + 4


@kernel
def convolve(f: Any, k: int, lane: int) -> Any:
    """Coefficients k of eight products of series, without the two terms that hold a coefficient 0.

    f (n + 1, 2, LANES) holds the two factors side by side. Eight sums in one loop, written out, become one vector
    instruction each; unsigned indices spare the test for negative ones. The newest coefficients are left out
    because reading them as a vector would wait for their scalar stores.
    """
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
    o = np.uint64(lane)
    end = np.uint64(k)
    for j in range(np.uint64(1), end):
        a, b = f[j, 0], f[end - j, 1]
        s0 += a[o] * b[o]
        s1 += a[o + np.uint64(1)] * b[o + np.uint64(1)]
        s2 += a[o + np.uint64(2)] * b[o + np.uint64(2)]
        s3 += a[o + np.uint64(3)] * b[o + np.uint64(3)]
        s4 += a[o + np.uint64(4)] * b[o + np.uint64(4)]
        s5 += a[o + np.uint64(5)] * b[o + np.uint64(5)]
        s6 += a[o + np.uint64(6)] * b[o + np.uint64(6)]
        s7 += a[o + np.uint64(7)] * b[o + np.uint64(7)]
    return s0, s1, s2, s3, s4, s5, s6, s7


@kernel
def linear_part(c: Any, bodies: Any, k: int, x: Any) -> Any:
    """Coefficient k of v_o, u_l', u_r' and of the arms' forces without contact, (1), (2), from that of the state x."""
    x_o, u_l, u_r, v_l, v_o, v_r = x
    a_l = -bodies[LEFT, STIFFNESS] * (x_o + u_l) - bodies[LEFT, DAMPING] * v_l
    a_r = -bodies[RIGHT, STIFFNESS] * (x_o - u_r) - bodies[RIGHT, DAMPING] * v_r
    if k == 0:
        a_l += bodies[LEFT, FORCE]
        a_r += bodies[RIGHT, FORCE]
    c[D_L, k] = v_l - v_o
    c[D_R, k] = v_o - v_r
    return v_o, v_l - v_o, v_o - v_r, a_l, a_r


@kernel
def next_coefficients(c: Any, inverse_mass: Any, step: float, k: int, g: float, weighted: Any, gf_l: float,
                      gf_r: float) -> Any:
    """Coefficients k + 1 of time and of the state from coefficient k of their rates, (1) to (3).

    Returned as well as stored: reading them back would wait for the stores.
    """
    gv_o, gd_l, gd_r, ga_l, ga_r = weighted
    x = (
        step * gv_o,
        step * gd_l,
        step * gd_r,
        step * inverse_mass[LEFT] * (ga_l - gf_l),
        step * inverse_mass[OBJECT] * (gf_l - gf_r),
        step * inverse_mass[RIGHT] * (ga_r + gf_r),
    )
    c[TIME, k + 1] = step * g
    c[X_O, k + 1], c[U_L, k + 1], c[U_R, k + 1], c[V_L, k + 1], c[V_O, k + 1], c[V_R, k + 1] = x
    return x


@kernel
def expand_one(c: Any, f: Any, bodies: Any, pairs: Any, side: int, unit: float, n: int) -> None:
    """Fill the Taylor table c (ROWS, n + 1) from its column 0, with one side in contact: G = w.

    The series are in s / unit.

    w fw = H u^2 (1 + p u'), (6), is the product of H u and u (1 + p u'). Each product is the sum of `convolve` and
    of its two outer terms; what does not need the newest coefficient is added first, because each order waits for
    the one before.
    """
    hertz, loss = pairs[side, HERTZ], pairs[side, DISSIPATION]
    inverse_mass = (1.0 / bodies[LEFT, MASS], 1.0 / bodies[RIGHT, MASS], 1.0 / bodies[OBJECT, MASS])
    x = (c[X_O, 0], c[U_L, 0], c[U_R, 0], c[V_L, 0], c[V_O, 0], c[V_R, 0])
    w = c[W_L + side, 0]
    w0 = e0 = q0 = 0.0
    a0 = f[0, 0]
    for k in range(np.uint64(n)):
        v_o, d_l, d_r, a_l, a_r = linear_part(c, bodies, k, x)
        u = x[1] if side == LEFT else x[2]
        d = d_l if side == LEFT else d_r
        e = loss * d + (1.0 if k == 0 else 0.0)
        gv_o, gd_l, gd_r, ga_l, ga_r, ue, uq, _ = convolve(f, k, 0)
        a, b = f[k, 0], f[k, 1]
        a[0], a[1], a[2], a[3], a[4], a[5], a[6] = v_o, d_l, d_r, a_l, a_r, u, hertz * u
        q = (ue + u * e0) + a0[5] * e
        z = (uq + hertz * u * q0) + a0[6] * q
        b[0], b[1], b[2], b[3], b[4], b[5], b[6] = w, w, w, w, w, e, q
        weighted = (
            gv_o + a0[0] * w + v_o * w0,
            gd_l + a0[1] * w + d_l * w0,
            gd_r + a0[2] * w + d_r * w0,
            ga_l + a0[3] * w + a_l * w0,
            ga_r + a0[4] * w + a_r * w0,
        )
        if k == 0:
            w0, e0, q0 = w, e, q
        c[E_L + side, k] = e
        step = unit / (k + 1)
        x = next_coefficients(c, inverse_mass, 2.0 * step, k, w, weighted, z if side == LEFT else 0.0,
                              0.0 if side == LEFT else z)
        w = step * d
        c[W_L + side, k + 1] = w


@kernel
def expand_both(c: Any, f: Any, bodies: Any, pairs: Any, unit: float, n: int) -> None:
    """Fill the Taylor table c (ROWS, n + 1) from its column 0, with both sides in contact: G = w_l w_r.

    The series are in s / unit. w_l w_r is summed in both orders, so that a mirrored grasp has mirrored roundings.
    """
    hertz_l, loss_l = pairs[LEFT, HERTZ], pairs[LEFT, DISSIPATION]
    hertz_r, loss_r = pairs[RIGHT, HERTZ], pairs[RIGHT, DISSIPATION]
    inverse_mass = (1.0 / bodies[LEFT, MASS], 1.0 / bodies[RIGHT, MASS], 1.0 / bodies[OBJECT, MASS])
    x = (c[X_O, 0], c[U_L, 0], c[U_R, 0], c[V_L, 0], c[V_O, 0], c[V_R, 0])
    w_l, w_r = c[W_L, 0], c[W_R, 0]
    a0, b0 = f[0, 0], f[0, 1]
    b0[:] = 0.0
    for k in range(np.uint64(n)):
        v_o, d_l, d_r, a_l, a_r = linear_part(c, bodies, k, x)
        u_l, u_r = x[1], x[2]
        one = 1.0 if k == 0 else 0.0
        e_l = loss_l * d_l + one
        e_r = loss_r * d_r + one
        gv_o, gd_l, gd_r, ga_l, ga_r, ue_l, uq_l, _ = convolve(f, k, 0)
        ue_r, uq_r, ww, wd_r, wd_l, wz_l, wz_r, ww_mirrored = convolve(f, k, 8)
        a, b = f[k, 0], f[k, 1]
        a[0], a[1], a[2], a[3], a[4], a[5], a[6] = v_o, d_l, d_r, a_l, a_r, u_l, hertz_l * u_l
        a[8], a[9], a[10], a[11], a[12], a[13], a[14] = u_r, hertz_r * u_r, w_l, w_l, w_r, w_r, w_l
        a[15] = w_r
        g0 = b0[0]
        g = 0.5 * ((ww + (w_l * b0[10] + a0[10] * w_r)) + (ww_mirrored + (w_r * b0[15] + a0[15] * w_l)))
        q_l = (ue_l + u_l * b0[5]) + a0[5] * e_l
        q_r = (ue_r + u_r * b0[8]) + a0[8] * e_r
        z_l = (uq_l + hertz_l * u_l * b0[6]) + a0[6] * q_l
        z_r = (uq_r + hertz_r * u_r * b0[9]) + a0[9] * q_r
        force_l = (wz_l + w_r * b0[13]) + a0[13] * z_l
        force_r = (wz_r + w_l * b0[14]) + a0[14] * z_r
        weighted = (
            gv_o + a0[0] * g + v_o * g0,
            gd_l + a0[1] * g + d_l * g0,
            gd_r + a0[2] * g + d_r * g0,
            ga_l + a0[3] * g + a_l * g0,
            ga_r + a0[4] * g + a_r * g0,
        )
        step = unit / (k + 1)
        w_l = step * ((wd_l + w_r * b0[12]) + a0[12] * d_l)
        w_r = step * ((wd_r + a[11] * b0[11]) + a0[11] * d_r)
        b[0], b[1], b[2], b[3], b[4], b[5], b[6] = g, g, g, g, g, e_l, q_l
        b[8], b[9], b[10], b[11], b[12], b[13], b[14] = e_r, q_r, a[12], d_r, d_l, z_l, z_r
        b[15] = a[10]
        c[G, k], c[E_L, k], c[E_R, k] = g, e_l, e_r
        c[W_L, k + 1], c[W_R, k + 1] = w_l, w_r
        x = next_coefficients(c, inverse_mass, 2.0 * step, k, g, weighted, force_l, force_r)


@kernel
def step_size(c: Any, left: bool, right: bool, w_l: float, w_r: float, v: float, n: int, tolerance: float) -> float:
    """Step in s / unit at which the first neglected term is `tolerance` times the scales of the impact.

    The radius of convergence is estimated from the last TAIL coefficients of w and of the velocities. A state at
    rest gives inf.
    """
    inverse_radius = 0.0
    for k in range(n - TAIL + 1, n + 1):
        size = max(abs(c[V_L, k]), abs(c[V_O, k]), abs(c[V_R, k])) / v
        if left:
            size = max(size, abs(c[W_L, k]) / w_l)
        if right:
            size = max(size, abs(c[W_R, k]) / w_r)
        inverse_radius = max(inverse_radius, size ** (1.0 / k))
    return tolerance ** (1.0 / (n + 1)) / inverse_radius


@kernel
def state_at(c: Any, n: int, s: float, left: bool, right: bool, y: Any) -> None:
    """Write the state y (8,) at s; the penetration of a side in contact is w^2, never negative."""
    for row in (X_O, V_L, V_O, V_R, U_L, U_R):
        y[row] = evaluate(c[row], n, s)
    if left:
        y[U_L] = evaluate(c[W_L], n, s) ** 2
    if right:
        y[U_R] = evaluate(c[W_R], n, s) ** 2
    y[0] = y[X_O] + y[U_L]
    y[4] = y[X_O] - y[U_R]


class Tables(NamedTuple):
    """Workspace of one caller: Taylor coefficients (ROWS, n + 1), factors of the products (n + 1, 2, LANES)."""

    c: NDArray[np.float64]
    f: NDArray[np.float64]


def new_tables(order: int) -> Tables:
    """Workspace for steps of one order; the factors begin at a cache line, which vector loads want."""
    size = (order + 1) * 2 * LANES
    line = CACHE_LINE // 8
    room = np.zeros(size + line)
    begin = -(room.ctypes.data // 8) % line
    return Tables(np.zeros((ROWS, order + 1)), room[begin : begin + size].reshape(order + 1, 2, LANES))

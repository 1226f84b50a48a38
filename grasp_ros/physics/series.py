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

from grasp_ros.physics.flight import EPS, MAX_ITERATIONS, safe_step
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

# Rows of the coefficient table. x_o, v_l, ..., u_r stand in their places of the state y (x_l and x_r follow from
# them); then time, w, G, u', 1 + p u', and an event function.
TIME, W_L, W_R, G, D_L, D_R, E_L, E_R, EVENT, ROWS = range(8, 18)
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
def evaluate(a: Any, n: int, s: float) -> float:
    """Polynomial of degree n at s (Horner)."""
    total = a[n]
    for k in range(n - 1, -1, -1):
        total = total * s + a[k]
    return total


@kernel
def evaluate_rate(a: Any, n: int, s: float) -> float:
    """Derivative of a polynomial of degree n at s."""
    total = n * a[n]
    for k in range(n - 1, 0, -1):
        total = total * s + k * a[k]
    return total


@kernel
def linear_part(c: Any, bodies: Any, k: int) -> Any:
    """Coefficient k of v_o, u_l', u_r' and of the arms' forces without contact, (1), (2)."""
    x_o, v_l, v_o, v_r = c[X_O, k], c[V_L, k], c[V_O, k], c[V_R, k]
    a_l = -bodies[LEFT, STIFFNESS] * (x_o + c[U_L, k]) - bodies[LEFT, DAMPING] * v_l
    a_r = -bodies[RIGHT, STIFFNESS] * (x_o - c[U_R, k]) - bodies[RIGHT, DAMPING] * v_r
    if k == 0:
        a_l += bodies[LEFT, FORCE]
        a_r += bodies[RIGHT, FORCE]
    d_l = v_l - v_o
    d_r = v_o - v_r
    c[D_L, k] = d_l
    c[D_R, k] = d_r
    return v_o, d_l, d_r, a_l, a_r


@kernel
def integrate_coefficients(c: Any, inverse_mass: Any, k: int, g: float, gv_o: float, gd_l: float, gd_r: float,
                           ga_l: float, ga_r: float, gf_l: float, gf_r: float) -> None:
    """Coefficients k + 1 of time, positions and velocities from coefficient k of their rates, (1) to (3)."""
    step = 2.0 / (k + 1)
    c[TIME, k + 1] = step * g
    c[X_O, k + 1] = step * gv_o
    c[U_L, k + 1] = step * gd_l
    c[U_R, k + 1] = step * gd_r
    c[V_L, k + 1] = step * inverse_mass[LEFT] * (ga_l - gf_l)
    c[V_O, k + 1] = step * inverse_mass[OBJECT] * (gf_l - gf_r)
    c[V_R, k + 1] = step * inverse_mass[RIGHT] * (ga_r + gf_r)


@kernel
def expand_one(c: Any, f: Any, bodies: Any, pairs: Any, side: int, n: int) -> None:
    """Fill the Taylor table c (ROWS, n + 1) from its column 0, with one side in contact: G = w.

    w fw = H u^2 (1 + p u'), (6), is the product of u and u (1 + p u'). Each product is the sum of `convolve` and
    of its two outer terms.
    """
    hertz, loss = pairs[side, HERTZ], pairs[side, DISSIPATION]
    inverse_mass = (1.0 / bodies[LEFT, MASS], 1.0 / bodies[RIGHT, MASS], 1.0 / bodies[OBJECT, MASS])
    a0, b0 = f[0, 0], f[0, 1]
    b0[:] = 0.0
    for k in range(np.uint64(n)):
        v_o, d_l, d_r, a_l, a_r = linear_part(c, bodies, k)
        d = d_l if side == LEFT else d_r
        u, w = c[U_L + side, k], c[W_L + side, k]
        e = loss * d + (1.0 if k == 0 else 0.0)
        gv_o, gd_l, gd_r, ga_l, ga_r, ue, uq, _ = convolve(f, k, 0)
        a, b = f[k, 0], f[k, 1]
        if k == 0:
            a0[0], a0[1], a0[2], a0[3], a0[4], a0[5], a0[6] = v_o, d_l, d_r, a_l, a_r, u, u
        w0 = b0[0]
        q = ue + a0[5] * e + u * b0[5]
        z = hertz * (uq + a0[6] * q + u * b0[6])
        gv_o += a0[0] * w + v_o * w0
        gd_l += a0[1] * w + d_l * w0
        gd_r += a0[2] * w + d_r * w0
        ga_l += a0[3] * w + a_l * w0
        ga_r += a0[4] * w + a_r * w0
        a[0], a[1], a[2], a[3], a[4], a[5], a[6] = v_o, d_l, d_r, a_l, a_r, u, u
        b[0], b[1], b[2], b[3], b[4], b[5], b[6] = w, w, w, w, w, e, q
        c[E_L + side, k] = e
        c[W_L + side, k + 1] = d / (k + 1)
        integrate_coefficients(c, inverse_mass, k, w, gv_o, gd_l, gd_r, ga_l, ga_r, z if side == LEFT else 0.0,
                               0.0 if side == LEFT else z)


@kernel
def expand_both(c: Any, f: Any, bodies: Any, pairs: Any, n: int) -> None:
    """Fill the Taylor table c (ROWS, n + 1) from its column 0, with both sides in contact: G = w_l w_r."""
    inverse_mass = (1.0 / bodies[LEFT, MASS], 1.0 / bodies[RIGHT, MASS], 1.0 / bodies[OBJECT, MASS])
    a0, b0 = f[0, 0], f[0, 1]
    b0[:] = 0.0
    for k in range(np.uint64(n)):
        v_o, d_l, d_r, a_l, a_r = linear_part(c, bodies, k)
        u_l, u_r, w_l, w_r = c[U_L, k], c[U_R, k], c[W_L, k], c[W_R, k]
        unit = 1.0 if k == 0 else 0.0
        e_l = pairs[LEFT, DISSIPATION] * d_l + unit
        e_r = pairs[RIGHT, DISSIPATION] * d_r + unit
        gv_o, gd_l, gd_r, ga_l, ga_r, ue_l, uq_l, _ = convolve(f, k, 0)
        ue_r, uq_r, g, wd_r, wd_l, wz_l, wz_r, _ = convolve(f, k, 8)
        a, b = f[k, 0], f[k, 1]
        if k == 0:
            a0[0], a0[1], a0[2], a0[3], a0[4], a0[5], a0[6] = v_o, d_l, d_r, a_l, a_r, u_l, u_l
            a0[8], a0[9], a0[10], a0[11], a0[12], a0[13], a0[14] = u_r, u_r, w_l, w_l, w_r, w_r, w_l
        g += a0[10] * w_r + w_l * b0[10]
        g0 = b0[0] if k > 0 else 0.0
        q_l = ue_l + a0[5] * e_l + u_l * b0[5]
        q_r = ue_r + a0[8] * e_r + u_r * b0[8]
        z_l = pairs[LEFT, HERTZ] * (uq_l + a0[6] * q_l + u_l * b0[6])
        z_r = pairs[RIGHT, HERTZ] * (uq_r + a0[9] * q_r + u_r * b0[9])
        gv_o += a0[0] * g + v_o * g0
        gd_l += a0[1] * g + d_l * g0
        gd_r += a0[2] * g + d_r * g0
        ga_l += a0[3] * g + a_l * g0
        ga_r += a0[4] * g + a_r * g0
        wd_r += a0[11] * d_r + w_l * b0[11]
        wd_l += a0[12] * d_l + w_r * b0[12]
        wz_l += a0[13] * z_l + w_r * b0[13]
        wz_r += a0[14] * z_r + w_l * b0[14]
        a[0], a[1], a[2], a[3], a[4], a[5], a[6] = v_o, d_l, d_r, a_l, a_r, u_l, u_l
        a[8], a[9], a[10], a[11], a[12], a[13], a[14] = u_r, u_r, w_l, w_l, w_r, w_r, w_l
        b[0], b[1], b[2], b[3], b[4], b[5], b[6] = g, g, g, g, g, e_l, q_l
        b[8], b[9], b[10], b[11], b[12], b[13], b[14] = e_r, q_r, w_r, d_r, d_l, z_l, z_r
        c[G, k], c[E_L, k], c[E_R, k] = g, e_l, e_r
        c[W_L, k + 1] = wd_l / (k + 1)
        c[W_R, k + 1] = wd_r / (k + 1)
        integrate_coefficients(c, inverse_mass, k, g, gv_o, gd_l, gd_r, ga_l, ga_r, wz_l, wz_r)


@kernel
def impact_scales(contact: Any, m_a: float, m_o: float, u: float, d: float) -> Any:
    """Scales of sqrt(u) and u' of an impact that has the pair's present energy (O1 read backwards)."""
    mu = m_a * m_o / (m_a + m_o)
    energy = 0.5 * mu * d * d + 0.4 * contact[HERTZ] * u * u * math.sqrt(u)
    return (2.5 * energy / contact[HERTZ]) ** 0.2, math.sqrt(2.0 * energy / mu)


@kernel
def step_size(c: Any, left: bool, right: bool, scale_l: Any, scale_r: Any, n: int, tolerance: float) -> float:
    """Step at which the first neglected term is `tolerance` times the scales of the impact; inf for a state at rest.

    The radius of convergence is estimated from the last TAIL coefficients of w and of the velocities.
    """
    per_w_l = 1.0 / scale_l[0] if left else 0.0
    per_w_r = 1.0 / scale_r[0] if right else 0.0
    per_v = 1.0 / max(scale_l[1], scale_r[1])
    inverse_radius = 0.0
    for k in range(n - TAIL + 1, n + 1):
        size = per_v * max(abs(c[V_L, k]), abs(c[V_O, k]), abs(c[V_R, k]))
        if left:
            size = max(size, per_w_l * abs(c[W_L, k]))
        if right:
            size = max(size, per_w_r * abs(c[W_R, k]))
        inverse_radius = max(inverse_radius, size ** (1.0 / k))
    return tolerance ** (1.0 / (n + 1)) / inverse_radius


@kernel
def first_rise(f: Any, n: int, h: float, work: Any) -> float:
    """First s in (0, h] at which the polynomial f, with f(0) <= 0, rises through zero; inf if there is none.

    The positive coefficients bound f from above and the second derivative is bounded by sums of |f_k|, so the
    steps of `safe_step` cannot jump over a root.
    """
    upper = 0.0
    size = 0.0
    curvature = 0.0
    for k in range(n, 0, -1):
        upper = (upper + max(f[k], 0.0)) * h
        size = (size + abs(f[k])) * h
    if upper < -f[0]:
        return math.inf
    for k in range(n, 1, -1):
        curvature = curvature * h + k * (k - 1) * abs(f[k])
    noise = EPS * (abs(f[0]) + size)
    s = 0.0
    value = f[0]
    rate = f[1]
    for _ in range(MAX_ITERATIONS):
        work[3] += 1
        step = max(safe_step(min(value, 0.0), rate, curvature), 8.0 * EPS * h)
        s += step
        if not s <= h:
            return math.inf if s > h else math.nan
        value = evaluate(f, n, s)
        rate = evaluate_rate(f, n, s)
        if value >= -noise and rate > 0.0:
            return s
    return math.nan


@kernel
def invert_time(c: Any, g: Any, n: int, tau: float, low: float, high: float) -> float:
    """The s in [low, high] with time tau; time is an increasing polynomial there, its rate is 2 G."""
    s = high
    for _ in range(200):
        rest = evaluate(c[TIME], n, s) - tau
        if rest > 0.0:
            high = s
        else:
            low = s
        rate = 2.0 * evaluate(g, n - 1, s)
        following = s - rest / rate if rate > 0.0 else low
        if not low <= following <= high:
            following = 0.5 * (low + high)
        if abs(following - s) <= 2.0 * EPS * high:
            return following
        s = following
    return s


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
    """Workspace for steps of one order."""
    return Tables(np.zeros((ROWS, order + 1)), np.zeros((order + 1, 2, LANES)))

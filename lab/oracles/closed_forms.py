"""Exact relations that decide hard cases, in mpmath with 40 digits; nothing here calls a kernel.

docs/oracles.md defines O1 to O15: what each says and decides, the functions that compute it, and where it is used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import gmpy2
import numpy as np
from mpmath import mp, mpf

from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import LEFT, RIGHT, Law, Of
from grasp_ros.physics.model import Array, penetration
from grasp_ros.physics.system import COLUMN, System
from lab.reference.plant import Body, number
from lab.reference.run import EXPONENTS, precision

mp.dps = 40


def first_touch_from_rest(m: Any, stiffness: Any, damping: Any) -> Any:
    """O4, in s."""
    s = mpf(damping) / (2 * mpf(m))
    w = mp.sqrt(mpf(stiffness) / mpf(m) - s * s)
    return (mp.pi - mp.atan2(w, s)) / w


class Impact(NamedTuple):
    """What an impact law says about two free bodies."""

    depth: Any
    duration: Any
    restitution: Any


def reduced_mass(m1: Any, m2: Any) -> Any:
    """mu of two bodies."""
    return mpf(m1) * mpf(m2) / (mpf(m1) + mpf(m2))


def _exit(z: Any) -> Any:
    """p v_o for p v = z, (O2); the working precision covers what 1 + W0 loses for small z."""
    with mp.workdps(3 * mp.dps):
        return 1 + mp.lambertw(-(1 + z) * mp.exp(-(1 + z))).real


def impact(mu: Any, hertzian: Any, p: Any, speed: Any) -> Impact:
    """O1 and O2: depth and restitution from the first integral, the duration by quadrature."""
    mu, hertzian, p, speed = (mpf(value) for value in (mu, hertzian, p, speed))
    if p == 0:
        depth = (5 * mu * speed**2 / (4 * hertzian)) ** mpf("0.4")
        return Impact(depth, mpf("0.8") * mp.beta(mpf("0.4"), mpf("0.5")) * depth / speed, mpf(1))
    power = 5 * mu / (2 * hertzian)
    leave = _exit(p * speed) / p

    def depth_of(v: Any, delta: Any) -> Any:
        """u at a distance delta from the velocity v at which u = 0, from the conserved quantity."""
        return (power * (delta / p + mp.log1p(-p * delta / (1 + p * v)) / p**2)) ** mpf("0.4")

    def time_from(v: Any, sign: int) -> Any:
        """Time between u' = v, u = 0 and u' = 0; dt/dv ~ (distance)^(-3/5), so v = end - sign r^(5/2)."""

        def rate(r: Any) -> Any:
            delta = sign * r ** mpf("2.5")
            force = hertzian * depth_of(v, delta) ** mpf("1.5") * (1 + p * (v - delta))
            return mu / force * mpf("2.5") * r ** mpf("1.5")

        return mp.quad(rate, [0, abs(v) ** mpf("0.4")])

    return Impact(depth_of(speed, speed), time_from(speed, 1) + time_from(-leave, -1), leave / speed)


def creep(mu: Any, hertzian: Any, p: Any, speed: Any) -> Any:
    """Duration of an impact with p v >> 1, which creeps open at almost 1/p; where `impact` loses its exit.

    With y = 1 + p u' the first integral of (6) is y - 1 - ln y = R + const u^(5/2), so u' follows from u by the
    branches of Lambert's W, and the duration is the integral of du / u' over both ways.
    """
    mu, hertzian, p, speed = (mpf(value) for value in (mu, hertzian, p, speed))
    z = p * speed
    whole = z - mp.log1p(z)
    depth = (whole * 5 * mu / (2 * hertzian * p**2)) ** mpf("0.4")

    def way(branch: int) -> Any:
        def rate(r: Any) -> Any:
            u = depth - r * r
            rest = whole * (1 - (u / depth) ** mpf("2.5"))
            y = -mp.lambertw(-mp.exp(-1 - rest), branch).real
            return 2 * r * p / abs(y - 1)

        return mp.quad(rate, mp.linspace(0, mp.sqrt(depth), 5))

    return way(-1) + way(0)


LARGE = 20.0  # p v from which `impact` loses the end of the way back


def impact_numbers(m1: float, m2: float, hertzian: float, p: float, speed: float) -> tuple[float, float]:
    """Duration in s and restitution of an impact of two free bodies, in doubles, for any p."""
    loss = p * speed
    with mp.workdps(20 + (2 * math.ceil(-math.log10(loss)) if 0.0 < loss < 1.0 else 0)):  # what small losses cancel
        mu = reduced_mass(m1, m2)
        if loss > LARGE:
            return float(creep(mu, hertzian, p, speed)), float(_exit(mpf(loss)) / mpf(loss))
        law = impact(mu, hertzian, p, speed)
        return float(law.duration), float(law.restitution)


def chain_speeds(mass: Any, p: Any) -> tuple[float, float, float]:
    """O10: speeds behind the last impact of a separated chain 1 : mass : 1 whose first body comes with 1."""
    masses, v = [mpf(1), mpf(mass), mpf(1)], [mpf(1), mpf(0), mpf(0)]
    while (pair := next((i for i in (0, 1) if v[i] > v[i + 1]), None)) is not None:
        front, back = masses[pair : pair + 2]
        speed, momentum = v[pair] - v[pair + 1], front * v[pair] + back * v[pair + 1]
        leave = _exit(p * speed) / p if p else speed
        v[pair] = (momentum - back * leave) / (front + back)
        v[pair + 1] = v[pair] + leave
    return float(v[0]), float(v[1]), float(v[2])


def elastic_period(mass: Any, stiffness: Any, hertzian: Any, x: Any) -> Any:
    """O12: period of an undamped arm that is released at rest at distance x from an object that does not move."""
    mass, stiffness, hertzian, x = (mpf(value) for value in (mass, stiffness, hertzian, x))

    def missing(u: Any, v: Any) -> Any:
        """Square of the speed at the depth u, times the mass, if it is 0 at the depth v."""
        return stiffness * (v * v - u * u) + mpf("0.8") * hertzian * (v ** mpf("2.5") - u ** mpf("2.5"))

    depth = mp.findroot(lambda d: missing(0, d) - stiffness * x * x, (mpf(0), x), solver="anderson", tol=mp.eps**2)

    def rate(angle: Any) -> Any:
        """dt/d(angle) with u = depth cos(angle)^2, analytic at both ends."""
        u = depth * mp.cos(angle) ** 2
        return depth * mp.sin(2 * angle) / mp.sqrt(missing(u, depth) / mass)

    return mp.pi * mp.sqrt(mass / stiffness) + 2 * mp.quad(rate, [0, mp.pi / 2], method="gauss-legendre")


def tail_rate(damping: Any, stiffness: Any, hertzian: Any, mass: Any) -> Any:
    """O9: kappa in 1/(m s); the amplitude of the object's last swing tends to 1 / (kappa t)."""
    share = mp.beta(mpf("0.8"), mpf("1.5")) / mp.beta(mpf("0.4"), mpf("0.5"))
    return mpf("1.8") * mpf(damping) * mpf(hertzian) ** 2 / (mpf(stiffness) ** 2 * mpf(mass)) * share


def graze(overshoot: Any, deceleration: Any, hertzian: Any) -> tuple[float, float]:
    """O13: duration and impulse of an elastic contact so weak that the arm goes on along its own arc."""
    eps, a = mpf(overshoot), mpf(deceleration)
    return float(2 * mp.sqrt(2 * eps / a)), float(3 * mp.pi / 8 * mpf(hertzian) * eps**2 * mp.sqrt(2 / a))


def first_peak(x: float, mass: float, stiffness: float, damping: float) -> Any:
    """Where an under-damped arm that is released at rest at x first turns."""
    s = mpf(damping) / (2 * mpf(mass))
    return -mpf(x) * mp.exp(-s * mp.pi / mp.sqrt(mpf(stiffness) / mpf(mass) - s * s))


def flight(body: Sequence[Any], x: Any, v: Any, t: Any) -> tuple[Any, Any]:
    """Position and velocity after t, by the closed form of `lab.reference`; body is (m, k, c, f)."""
    with gmpy2.context(precision=precision(mp.dps), emax=EXPONENTS, emin=-EXPONENTS):
        m, k, c, f, x, v, t = (number(mp.nstr(mpf(value), mp.dps + 20)) for value in (*body, x, v, t))
        x, v = Body.of(m, k, c, f).drift(x, v, t)
        return mpf(str(x)), mpf(str(v))


def holding_force(stiffness: Sequence[Any], hertzian: Sequence[Any], overlap: Any) -> Any:
    """O14, in N."""
    K, H, d = [mpf(k) for k in stiffness], [mpf(h) for h in hertzian], mpf(overlap)

    def excess(f: Any) -> Any:
        return sum(f / k for k in K) + sum((f / h) ** (mpf(2) / 3) for h in H) - d

    return mp.findroot(excess, (d * min(K) / 8, d * min(K)), solver="anderson")


class Balance(NamedTuple):
    """Errors of the balances of momentum and energy at the ends of the segments between events."""

    momentum: Array  # relative to the largest of m, C, K times the largest speed, position and its integral
    energy: Array  # relative to V_c(0)


NODES = 40


def balance(system: System, duration: float, events: Sequence[float], solve: Callable[[Array], Array],
            parts: int = 16) -> Balance:
    """O3 along one trajectory with continuous feedback, from the times of all events.

    m_l v_l + m_o v_o + m_r v_r + sum of C x + integral of sum of (K x - f) is constant, and so is V_c + 2 W with W' the
    dissipation. Between events the integrands are analytic after t = middle - half cos(theta), because u^(3/2) becomes
    theta^3 times an analytic function; Gauss and Legendre do the rest. Each segment is cut into parts, many where
    bodies swing fast within one. `solve` gives states (n, 6) at ascending times.
    """
    bodies = system.closed_loop
    edges = sorted({0.0, duration, *events})
    edges = [a + (b - a) * j / parts for a, b in pairwise(edges) for j in range(parts)]
    edges.append(duration)
    x, weight = np.polynomial.legendre.leggauss(NODES)
    theta = 0.5 * np.pi * (x + 1.0)
    times, weights = [], []
    for a, b in pairwise(edges):
        times.append(np.concatenate([[a], 0.5 * (a + b) - 0.5 * (b - a) * np.cos(theta)]))
        weights.append(0.25 * np.pi * (b - a) * np.sin(theta) * weight)
    grid = np.append(np.concatenate(times), duration)
    # rounding may put the last node of a tiny segment a last digit behind its end
    states = solve(np.maximum.accumulate(grid))
    at_edges = states[:: NODES + 1]
    inside = np.delete(states[:-1].reshape(-1, NODES + 1, 6), 0, axis=1)

    def integral(values: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum((values * np.array(weights)).sum(axis=1))])

    momentum: Array = np.zeros(len(at_edges))
    force: Array = np.zeros(inside.shape[:2])
    scale = 0.0
    positions, speeds = ([COLUMN[body] + part for body in system.present] for part in (0, 1))
    farthest, fastest = float(np.abs(at_edges[:, positions]).max()), float(np.abs(at_edges[:, speeds]).max())
    for body in system.present:
        motion = at_edges[:, COLUMN[body]], at_edges[:, COLUMN[body] + 1]
        momentum = momentum + bodies[body, Of.MASS] * motion[1] + bodies[body, Of.DAMPING] * motion[0]
        force = force + bodies[body, Of.STIFFNESS] * inside[..., COLUMN[body]] - bodies[body, Of.FORCE]
        scale = max(scale, bodies[body, Of.MASS] * fastest, bodies[body, Of.DAMPING] * farthest)
    pushed = integral(force)
    P, scale = momentum + pushed, max(scale, float(np.abs(pushed).max()))
    V_c = energy(system, at_edges).V_c
    E = V_c + 2.0 * integral(_dissipation(system, inside))
    return Balance((P - P[0]) / scale, (E - E[0]) / V_c[0])


def _dissipation(system: System, y: Array) -> Array:
    """W' from the definition in O3 and not from `energy`."""
    total: Array = np.zeros(y.shape[:-1])
    for body in system.present:
        total = total + system.closed_loop[body, Of.DAMPING] * y[..., COLUMN[body] + 1] ** 2
    u_l, d_l, u_r, d_r = penetration(y)
    for side, u, d in ((LEFT, u_l, d_l), (RIGHT, u_r, d_r)):
        p, elastic = system.pairs[side, Law.DISSIPATION], system.pairs[side, Law.HERTZIAN] * np.maximum(u, 0.0) ** 1.5
        total = total + np.where(1.0 + p * d >= 0.0, p * elastic * d * d, -elastic * d)
    return total

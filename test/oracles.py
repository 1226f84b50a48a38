"""Oracles: exact relations and high-precision solutions that the tests hold the package against.

Nothing here calls a kernel. Everything works in mpmath unless its name says otherwise.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpf

from grasp_ros import scene as scenes
from grasp_ros.physics import certificate
from grasp_ros.physics.integrator import ACCURACY, Integrator
from grasp_ros.physics.layout import Event
from grasp_ros.physics.model import Arm, Array, Contact, Grasp, penetration
from grasp_ros.physics.system import System
from grasp_ros.reference import Reference, integrate

mp.dps = 40
STANDARD = Arm(1.0, 10.0, 0.2, 5.0, 0.5)
ELASTIC = Arm(1.0, 10.0, 0.0, 5.0, 0.0)
FREE = Arm(1.0, 0.0, 0.0, 0.0, 0.0)
CASES = [f"case_{number:02d}" for number in range(1, 12)]


def energy(grasp: Grasp, state: Array) -> certificate.Energy:
    """V, V_c, V' and mode of the paper's grasp."""
    return certificate.energy(System.of(grasp, np.zeros(6)), state)


def make_grasp(
    arm: Arm = STANDARD, hertz: float = 1e4, p: float = 0.1, object_mass: float = 5.0, right: Arm | None = None
) -> Grasp:
    """The same contact on both sides, and the same arm unless told otherwise."""
    return Grasp(arm, arm if right is None else right, Contact(hertz, p), Contact(hertz, p), object_mass)


# Flight: m x'' + c x' + k x = f.


def flight(body: Sequence[Any], x: Any, v: Any, t: Any) -> tuple[Any, Any]:
    """Position and velocity after t, by the matrix exponential of (x, v, 1); body is (m, k, c, f)."""
    m, k, c, f = (mpf(value) for value in body)
    generator = mp.matrix([[0, 1, 0], [-k / m, -c / m, f / m], [0, 0, 0]])
    with mp.workdps(mp.dps + 30):
        result = mp.expm(generator * mpf(t)) * mp.matrix([mpf(x), mpf(v), 1])
    return +result[0], +result[1]


def flight_array(body: Sequence[float], x: float, v: float, t: Array) -> tuple[Array, Array]:
    """The same in doubles for many times, by the complex roots; for under- and over-damped bodies with k > 0."""
    m, k, c, f = body
    root = np.sqrt(complex(c * c / (4 * m * m) - k / m))
    a, b = -c / (2 * m) + root, -c / (2 * m) - root
    rest = f / k
    first = (v - b * (x - rest)) / (a - b)
    second = x - rest - first
    ea, eb = first * np.exp(a * t), second * np.exp(b * t)
    return rest + (ea + eb).real, (a * ea + b * eb).real


def first_touch_from_rest(m: Any, stiffness: Any, damping: Any) -> Any:
    """O4: when an under-damped arm that is released at rest first passes 0."""
    s = mpf(damping) / (2 * mpf(m))
    w = mp.sqrt(mpf(stiffness) / mpf(m) - s * s)
    return (mp.pi - mp.atan2(w, s)) / w


# Impacts of two free bodies.


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


def impact(mu: Any, hertz: Any, p: Any, speed: Any) -> Impact:
    """O1 and O2. mu u' du' = -H u^(3/2) (1 + p u') du gives depth and restitution; the duration is a quadrature."""
    mu, hertz, p, speed = (mpf(value) for value in (mu, hertz, p, speed))
    if p == 0:
        depth = (5 * mu * speed**2 / (4 * hertz)) ** mpf("0.4")
        return Impact(depth, mpf("0.8") * mp.beta(mpf("0.4"), mpf("0.5")) * depth / speed, mpf(1))
    power = 5 * mu / (2 * hertz)
    leave = _exit(p * speed) / p

    def depth_of(v: Any, delta: Any) -> Any:
        """u at a distance delta from the velocity v at which u = 0, from the conserved quantity."""
        return (power * (delta / p + mp.log1p(-p * delta / (1 + p * v)) / p**2)) ** mpf("0.4")

    def time_from(v: Any, sign: int) -> Any:
        """Time between u' = v, u = 0 and u' = 0; dt/dv ~ (distance)^(-3/5), so v = end - sign r^(5/2)."""

        def rate(r: Any) -> Any:
            delta = sign * r ** mpf("2.5")
            force = hertz * depth_of(v, delta) ** mpf("1.5") * (1 + p * (v - delta))
            return mu / force * mpf("2.5") * r ** mpf("1.5")

        return mp.quad(rate, [0, abs(v) ** mpf("0.4")])

    return Impact(depth_of(speed, speed), time_from(speed, 1) + time_from(-leave, -1), leave / speed)


# High-precision reference of the paper's cases, once per case and session.


@cache
def reference_of(name: str, horizon: float, points: int = 201) -> Reference:
    """The reference of a scene's binary floats on an equidistant grid."""
    scene = scenes.load(name)
    times = np.linspace(0.0, horizon, points).tolist()
    return integrate(scene.grasp, scene.initial_state.tolist(), times, digits=25)


# Ledgers, O3.


class Run(NamedTuple):
    """A finished integration."""

    integrator: Integrator
    states: Array

    def times(self, side: int, *kinds: Event) -> Array:
        """Times of one side's events of some kinds."""
        return np.array([e.time for e in self.integrator.events if e.side == side and e.kind in kinds])


def run(grasp: Grasp, state: Any, duration: float, grid: Any = None, **options: Any) -> Run:
    """Integrate with continuous feedback (unless told otherwise) over one horizon."""
    options = {"continuous": True, "accuracy": ACCURACY, **options}
    integrator = Integrator(System.of(grasp, np.asarray(state, dtype=float)), **options)
    return Run(integrator, integrator.advance(duration, None if grid is None else np.asarray(grid)))


class Ledger(NamedTuple):
    """Momentum and energy balance at the ends of the segments between events; all should vanish."""

    momentum: Array  # relative to the largest momentum
    energy: Array  # relative to V_c(0)


def ledger(grasp: Grasp, state: Any, duration: float, nodes: int = 40, pieces: int = 16, **options: Any) -> Ledger:
    """O3 along one trajectory with continuous feedback.

    Between events the integrands are analytic after t = middle - half cos(theta), because u^(3/2) becomes
    theta^3 times an analytic function; Gauss and Legendre do the rest. Long flights are cut into pieces.
    """
    events = run(grasp, state, duration, **options).integrator.events
    edges = sorted({0.0, duration, *(event.time for event in events)})
    edges = [a + (b - a) * j / pieces for a, b in itertools.pairwise(edges) for j in range(pieces)]
    edges.append(duration)
    x, weight = np.polynomial.legendre.leggauss(nodes)
    theta = 0.5 * np.pi * (x + 1.0)
    times, weights = [], []
    for a, b in itertools.pairwise(edges):
        times.append(np.concatenate([[a], 0.5 * (a + b) - 0.5 * (b - a) * np.cos(theta)]))
        weights.append(0.25 * np.pi * (b - a) * np.sin(theta) * weight)
    grid = np.append(np.concatenate(times), duration)
    # rounding may put the last node of a tiny segment a last digit behind its end
    states = run(grasp, state, duration, np.maximum.accumulate(grid), **options).states
    at_edges = states[:: nodes + 1]
    inside = np.delete(states[:-1].reshape(-1, nodes + 1, 6), 0, axis=1)

    def integral(values: Array) -> Array:
        return np.concatenate([[0.0], np.cumsum((values * np.array(weights)).sum(axis=1))])

    left, right = grasp.left, grasp.right
    K = [arm.stiffness + arm.position_gain for arm in (left, right)]
    C = [arm.damping + arm.velocity_gain for arm in (left, right)]

    def momentum(y: Array) -> Array:
        x_l, v_l, _, v_o, x_r, v_r = np.moveaxis(y, -1, 0)
        return left.mass * v_l + grasp.object_mass * v_o + right.mass * v_r + C[0] * x_l + C[1] * x_r

    def power(y: Array) -> Array:
        """Dissipation, from the definition in O3 and not from model.energy."""
        total = C[0] * y[..., 1] ** 2 + C[1] * y[..., 5] ** 2
        u_l, d_l, u_r, d_r = penetration(y)
        for contact, u, d in ((grasp.left_contact, u_l, d_l), (grasp.right_contact, u_r, d_r)):
            force = contact.hertz * np.maximum(u, 0.0) ** 1.5
            total = total + np.where(
                1.0 + contact.dissipation * d >= 0.0, contact.dissipation * force * d * d, -force * d
            )
        return total

    P = momentum(at_edges) + integral(K[0] * inside[..., 0] + K[1] * inside[..., 4])
    V_c = energy(grasp, at_edges).V_c
    E = V_c + 2.0 * integral(power(inside))
    scale = max(np.abs(at_edges[:, 1]).max() * left.mass, np.abs(at_edges[:, 5]).max() * right.mass)
    return Ledger((P - P[0]) / scale, (E - E[0]) / V_c[0])

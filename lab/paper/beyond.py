"""What the paper could not show: the gap in its proof, the tail of the motion, case 2 as chaos, and symmetric starts.

A symmetric start is a knife-edge, from which the smallest offset leads away.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.simulation import Trajectory, simulate
from lab.oracles.closed_forms import tail_rate
from lab.paper.cases import SYMMETRIC, Cases, moved, started
from lab.paper.measures import measure
from lab.paper.motion import distance_of_states, nearest_return, state_weights
from lab.reference.grasp import grasp_of
from lab.studies.certificate import SCENES, Jump, jumps, safe_p
from lab.studies.predictability import states_from

TAIL_SECONDS = 1e5
TAIL_POINTS = 400
SMALL = 1e-9  # relative size of the perturbation behind a Lyapunov exponent
EVERY = 0.5  # s between two renormalisations
CHAOS_SECONDS = 1000.0
RETURN_SECONDS = 2000.0
WITHIN = 200.0  # s, how long an offset across the symmetry is followed
BLOCKS = 10  # of the time, for the standard error of the exponent
EVEN_CASES = (1, 2, 5, 7, 8)  # both arms equal: what the paper starts symmetrically, and Nos. 1 and 2 from there
SMALLEST = 1e-9  # m, the offset of x_l(0) whose growth is followed
VISIBLE = 1e-3  # m
MOVED = (0.0, 1e-12, 1e-9, 1e-6, 1e-3)  # m, offsets behind which settling times are compared
EDGE_SECONDS, EDGE_POINTS = 60.0, 12_001


class Gap(NamedTuple):
    """Where the printed V jumps up, and what V_c does there."""

    runs: list[Trajectory]
    jumps: list[tuple[str, Jump]]
    V_c_rise: float  # largest rise of V_c between output times, in V_c(0)
    safe: list[tuple[int, float, float]]  # case, its p, and the p below which no jump is possible (theorem 2)


def gap(cases: Cases) -> Gap:
    """The gap in the proof, and its repair."""
    runs = [simulate(scenes.load(name), grid=np.linspace(0.0, 0.8, 4001)) for name in SCENES[:2]]
    found = [(name, jump) for name in SCENES[:2] for jump in jumps(scenes.load(name).system, 0.8)]
    rise = max(float(np.diff(run.energy.V_c).max() / run.energy.V_c[0]) for run in runs)
    safe = [
        (number, grasp_of(scene).left_contact.dissipation, safe_p(grasp_of(scene), scene.initial_state))
        for number, scene in cases.items()
    ]
    return Gap(runs, found, rise, safe)


class Tail(NamedTuple):
    """The end of the motion of case 1: V_c beside its law (4/5) H (kappa t)^(-5/2)."""

    t: Array  # (n,), s
    V_c: Array  # (n,), J
    law: Array  # (n,), J
    contacts: Array  # (n,): touches of both sides so far
    kappa: float  # 1/(m s)
    slope: float  # d log V_c / d log t over the last decade
    constant: float  # V_c over its law at the end
    touches_slope: float  # d log contacts / d log t over the last decade


def tail(scene: Scene, seconds: float = TAIL_SECONDS) -> Tail:
    """Follow a case with damped arms to the law of its tail; O9 of docs/oracles.md."""
    grasp = grasp_of(scene)
    arm, hertzian = grasp.left, grasp.left_contact.hertzian
    C, K = arm.damping + arm.velocity_gain, arm.stiffness + arm.position_gain
    kappa = float(tail_rate(C, K, hertzian, grasp.object_mass))
    t = np.geomspace(1.0, seconds, TAIL_POINTS)
    run = simulate(scene.changed({"time.duration_s": seconds}), grid=np.minimum(t, seconds))
    touches = np.sort(run.event_table[run.event_table[:, 2] == Transition.TOUCH, 0])
    contacts = np.searchsorted(touches, t).astype(float)
    V_c = run.energy.V_c
    last = t >= seconds / 10.0

    def slope(values: Array) -> float:
        return float(np.polyfit(np.log(t[last]), np.log(values[last]), 1)[0])

    law = 0.8 * hertzian * (kappa * t) ** -2.5
    return Tail(t, V_c, law, contacts, kappa, slope(V_c), float(V_c[-1] / law[-1]), slope(contacts))


class Chaos(NamedTuple):
    """Case 2 as a motion that depends on its start."""

    t: Array  # (n,), s
    growth: Array  # (n,): sum of the logarithms of the stretching so far
    exponent: float  # 1/s
    error: float  # standard error from blocks of time
    symmetric: float  # exponent within the motion from a symmetric start, where the object rests
    apart: tuple[Array, Array]  # t, distance of two motions that begin 1e-9 apart, in sqrt(V(0))
    near_time: float  # s, of the nearest return to the start within RETURN_SECONDS
    near: float  # how near, in sqrt(V(0))
    periodic_time: float  # the same for a symmetric start
    periodic: float
    across: float  # 1/s, growth of an offset that breaks the symmetry of that motion


def stretching(scene: Scene, seconds: float, push: Array) -> Array:
    """Logarithms of how much a small perturbation, of this direction (6,), grows in each interval of EVERY s.

    Two motions run side by side; after each interval their difference is scaled back to SMALL: G. Benettin, L. Galgani,
    A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents for smooth dynamical systems, Meccanica 15 (1980).
    """
    weights, level = state_weights(scene.system), _level(scene)
    state, offset = scene.initial_state, _offset(scene, push)
    found = np.empty(round(seconds / EVERY))
    for row in range(len(found)):
        state, other = (states_from(scene, start, np.array([EVERY]))[-1] for start in (state, state + offset))
        grown = float(np.linalg.norm((other - state) * weights)) / (SMALL * level)
        found[row] = np.log(grown)
        offset = (other - state) / grown
    return found


def _level(scene: Scene) -> float:
    """Square root of V(0)."""
    return float(np.sqrt(energy(scene.system, scene.initial_state).V_c))


def _offset(scene: Scene, push: Array) -> Array:
    """A difference of states of the size SMALL."""
    return push / state_weights(scene.system) * (SMALL * _level(scene) / float(np.linalg.norm(push)))


def chaos(cases: Cases, seconds: float = CHAOS_SECONDS) -> Chaos:
    """Lyapunov exponent and nearest return of case 2."""
    scene, symmetric = cases[2], started(cases[2], SYMMETRIC)
    push = np.random.default_rng(1990).normal(size=6)
    logs = stretching(scene, seconds, push)
    blocks = logs.reshape(BLOCKS, -1).sum(axis=1) / (seconds / BLOCKS)
    keeping, breaking = np.array([1.0, 1.0, 0.0, 0.0, -1.0, -1.0]), np.array([1.0, 1.0, 0.5, 0.5, 1.0, 1.0])
    even = stretching(symmetric, seconds / 5.0, keeping)
    return Chaos(
        EVERY * np.arange(1, len(logs) + 1, dtype=float), np.cumsum(logs), float(logs.sum() / seconds),
        float(blocks.std(ddof=1) / np.sqrt(BLOCKS)), float(even.sum() / (seconds / 5.0)), _apart(scene, push),
        *nearest_return(scene, RETURN_SECONDS), *nearest_return(symmetric, 20.0),
        float(stretching(symmetric, WITHIN, breaking).sum() / WITHIN),
    )


def _apart(scene: Scene, push: Array) -> tuple[Array, Array]:
    """Distance of two motions that begin SMALL apart, over 60 s."""
    grid = np.linspace(0.0, 60.0, 6001)
    starts = scene.initial_state, scene.initial_state + _offset(scene, push)
    return grid, distance_of_states(scene, *(states_from(scene, start, grid) for start in starts)) / _level(scene)


class Edge(NamedTuple):
    """One case from the symmetric start, and from starts beside it."""

    case: int
    t: Array  # (n,), s
    apart: Array  # (n,), m: how far from symmetric, the larger of |x_l + x_r| and |x_o|, after SMALLEST
    rest: float  # m, the same without an offset: the largest
    visible: float  # s, when it first exceeds VISIBLE; infinite: not within EDGE_SECONDS
    settling: tuple[float, ...]  # s, for each of MOVED

    @property
    def rate(self) -> float:
        """Mean rate of growth up to VISIBLE in 1/s; nan where it does not grow so far."""
        return float(np.log(VISIBLE / SMALLEST) / self.visible) if np.isfinite(self.visible) else float("nan")


def knife_edge(cases: Cases) -> list[Edge]:
    """All symmetric cases, from a symmetric start and from beside it."""
    return [_edge(number, started(cases[number], SYMMETRIC)) for number in EVEN_CASES]


def _edge(number: int, scene: Scene) -> Edge:
    t: Array = np.linspace(0.0, EDGE_SECONDS, EDGE_POINTS)
    apart = _asymmetry(moved(scene, -SMALLEST), t)
    above = np.flatnonzero(apart > VISIBLE)
    return Edge(number, t, apart, float(_asymmetry(scene, t).max()), float(t[above[0]]) if len(above) else float("inf"),
                tuple(measure(moved(scene, -offset), "settling") for offset in MOVED))


def _asymmetry(scene: Scene, t: Array) -> Array:
    state = simulate(scene.changed({"time.duration_s": EDGE_SECONDS}), grid=t).state
    return np.asarray(np.maximum(np.abs(state[:, 0] + state[:, 4]), np.abs(state[:, 2])))

"""Long horizons: energy, clock, the tail of ever smaller bounces; and the balances of momentum and energy."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import LEFT, Transition
from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.cases.case import Case, Product, Solver
from lab.cases.families import BALANCE, ENERGY, HORIZON, LIMIT, MOMENTUM, TAIL
from lab.cases.scenes import AWAY, ELASTIC, FREE, STANDARD, grasp, library
from lab.oracles.closed_forms import balance, elastic_period, tail_rate

PERIOD = float(elastic_period(1, 15, 10_000, "0.3"))  # s


def _energy(seconds: float, points: int, solver: Solver) -> float:
    """Drift of V_c in the elastic marginal case."""
    scene = library("case_02", seconds)
    V_c = energy(scene.system, solver.states(scene, np.linspace(0.0, scene.duration, points))).V_c
    return float(np.abs(V_c / V_c[0] - 1.0).max())


def _periodic(periods: int, solver: Solver) -> float:
    """Phase of the periodic motion, from the time of its last touch, in s."""
    scene = grasp([-0.3, 0, 0, 0, 0.3, 0], periods * PERIOD, left=ELASTIC, contact=Contact(1e4, 0.0))
    touches = [event.time for event in solver.events(scene) if event.kind is Transition.TOUCH and event.side == LEFT]
    if len(touches) != periods:
        return np.inf
    return abs(touches[-1] - touches[0] - (periods - 1) * PERIOD)


def tail(seconds: float, solver: Solver) -> float:
    """V_c against its law, relative; contacts that are soft enough for the law to set in at once."""
    C, K, hertzian, mass = 0.7, 15.0, 10.0, 5.0
    scene = grasp([-0.3, 0.0, 0.0, 0.0, 0.5, 0.0], seconds, contact=Contact(hertzian, 0.0), mass=mass)
    V_c = float(energy(scene.system, solver.states(scene, [scene.duration])).V_c[0])
    amplitude = 1.0 / (float(tail_rate(C, K, hertzian, mass)) * seconds)
    return float(abs(V_c / (0.8 * hertzian * amplitude**2.5) - 1.0))


def _rise_of_tail(name: str, solver: Solver) -> float:
    """V_c from 500 s to 1000 s: what it rises, relative to V_c(0)."""
    scene = library(name, 1000.0)
    V_c = energy(scene.system, solver.states(scene, [0.0, 500.0, 1000.0])).V_c
    return float(max(V_c[2] - V_c[1], 0.0) / V_c[0])


def balances(scene: Scene, parts: int, product: Product) -> float:
    """Momentum and energy balance, each in units of what it may be off."""
    events = [event.time for event in product.events(scene)]
    book = balance(scene.system, scene.duration, events, lambda grid: product.states(scene, grid), parts)
    return float(max(np.abs(book.momentum).max() / MOMENTUM, np.abs(book.energy).max() / ENERGY))


def _creeps(product: Product) -> float:
    """A light arm that begins deep in a stiff contact and creeps out of it: more than ten units of work."""
    product.run(grasp([0.01, 0.6, 0.0, 0.0, AWAY, 0.0], 1.0, left=Arm(1e-4, 0.0, 0.0, 0.0, 0.0), right=FREE,
                      contact=Contact(1e6, 10.0), mass=1e-3))
    return np.inf


def cases() -> Iterator[Case]:
    """All long runs and balances."""
    yield Case(HORIZON, "elastic marginal case, 2000 s", partial(_energy, 2000.0, 2001), 2e-12)
    yield Case(HORIZON, "elastic marginal case, 2e4 s", partial(_energy, 2e4, 201), 2e-11)
    for periods, bound in ((1000, 1e-9), (20_000, 1e-7)):
        yield Case(HORIZON, f"{periods} periods", partial(_periodic, periods), bound, "O12: phase after the periods, s")
    for seconds, bound in ((1e4, 0.1), (1e5, 0.02)):
        yield Case(TAIL, f"{seconds:g} s", partial(tail, seconds), bound)
    for name in ("case_01", "case_09", "case_10"):
        yield Case(TAIL, f"{name} for 1000 s", partial(_rise_of_tail, name), 1e-60,
                   "O3: V_c does not rise, relative to V_c(0)", max_work=3_000_000)
    strong = Arm(1.0, 10.0, 0.2, 50.0, 5.0)
    for text, scene in (
        *((name, library(name, 20.0)) for name in ("case_01", "case_02", "case_03", "case_04", "case_07", "case_09")),
        ("clamped and back", grasp([-0.3, 0, 0, 0, 0.3, 0], 3.0, left=strong, contact=Contact(1e4, 10.0), mass=1.0)),
        ("H = 1e12", grasp([-0.3, 0, 0, 0, 0.5, 0], 1.0, contact=Contact(1e12, 0.1))),
        ("object of 1e-6 kg", grasp([-0.3, 0, 0.01, 0, 0.5, 0], 0.6, mass=1e-6)),
        ("object of 1e6 kg", grasp([-0.3, 0, 0, 0, 0.5, 0], 5.0, mass=1e6)),
        ("over-damped and fast", grasp([-0.3, 2.0, 0, 0, 0.5, -2.0], 5.0, left=STANDARD._replace(velocity_gain=9.0))),
        ("0.2 m deep on both sides", grasp([0.2, 0, 0, 0, -0.2, 0], 5.0)),
    ):
        yield Case(BALANCE, text, partial(balances, scene, 128 if "1e-6" in text else 16), 1.0, product_only=True)
    yield Case(LIMIT, "more contacts than the budget",  # there are 44 touches
               lambda product: float(len(product.run(library("case_01", 20.0)).events)), 0.0,
               limit=Status.EVENT_BUDGET, product_only=True, max_events=30)
    yield Case(LIMIT, "more work than the budget", _creeps, 0.0, "a stiff contact that opens at 1/p",
               limit=Status.WORK_BUDGET, product_only=True, max_work=10)

"""Bodies that touch at rest: what acts on them decides whether they are pressed together, and when."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.scene import Scene
from lab.cases.case import Case, Product
from lab.cases.families import REST
from lab.cases.scenes import part

PUSH, HERTZIAN, RATE = 1.0, 1e4, 10.0  # N, N/m^1.5, 1/s
GRAVITY, ANGLE = 9.81, 0.3  # m/s^2, rad
BODIES = 1.0, 2.0  # kg, arm and object


def _touching(seconds: float, stiffness: float, added: Mapping[str, Mapping[str, Any]]) -> Scene:
    """An arm and an object, both at rest at 0."""
    arm, mass = BODIES
    return scenes.compose("touching", {
        "time": {"duration_s": seconds, "control_period_s": 0.001},
        "left_arm": {"mass_kg": arm, "stiffness_N_per_m": stiffness, "position_m": 0.0, "velocity_m_per_s": 0.0},
        "object": {"mass_kg": mass, "position_m": 0.0, "velocity_m_per_s": 0.0},
        "left_contact": {"hertz_N_per_m1_5": HERTZIAN}, **added,
    })


def _pushed(start: float, sampled: bool) -> Scene:
    """For 2 s after the start."""
    pulse = {"start_s": start, "length_s": 100.0, "force_N": PUSH}
    return _touching(start + 2.0, 0.0, {"left_arm_pulse": pulse, **({"loop": {}} if sampled else {})})


def _energy(states: np.ndarray, stiffness: float, push: tuple[float, float]) -> np.ndarray:
    """Energy (n,) of an elastic contact under constant forces on arm and object."""
    x_l, v_l, x_o, v_o = states[:, :4].T
    kinetic = 0.5 * (BODIES[0] * v_l**2 + BODIES[1] * v_o**2)
    impact = 0.4 * HERTZIAN * np.maximum(x_l - x_o, 0.0) ** 2.5
    energy: np.ndarray = kinetic + 0.5 * stiffness * x_l**2 + impact - push[0] * x_l - push[1] * x_o
    return energy


def _pushes(start: float, sampled: bool, product: Product) -> float:
    """Momentum and energy of a push that begins at a tick, relative."""
    scene = _pushed(start, sampled)
    times = part(scene, 101, start)
    run = product.run(scene, times, sampled=sampled)
    momentum = run.state[:, 1] * BODIES[0] + run.state[:, 3] * BODIES[1] - PUSH * (times - start)
    energy = _energy(run.state, 0.0, (PUSH, 0.0)) / (PUSH * run.state[-1, 0])
    return float(max(np.abs(momentum).max() / (2.0 * PUSH), np.abs(energy).max()))


def _later(product: Product) -> float:
    """The same push at another time."""
    first, second = (product.states(_pushed(start, False), [start + 2.0])[0, :4] for start in (0.0, 1.0))
    return float(np.abs(first - second).max())


def _tilted(sign: float, product: Product) -> float:
    """A spring holds the arm back; the object slides away from it, or against it."""
    scene = _touching(0.3, BODIES[0] * RATE**2, {"tilt": {"angle_rad": sign * ANGLE, "gravity_m_per_s2": GRAVITY}})
    times = part(scene, 31)
    states = product.states(scene, times)
    pull = -sign * GRAVITY * np.sin(ANGLE)
    if sign > 0.0:
        return float(np.abs(_energy(states, BODIES[0] * RATE**2, (BODIES[0] * pull, BODIES[1] * pull))).max())
    arm, mass = pull / RATE**2 * (1.0 - np.cos(RATE * times)), 0.5 * pull * times**2
    return float(max(np.abs(states[:, 0] - arm).max(), np.abs(states[:, 2] - mass).max()))


def cases() -> Iterator[Case]:
    """All of them."""
    for start, sampled, text in ((0.0, False, "at once"), (1.0, False, "after 1 s"), (1.0, True, "in a sampled run")):
        yield Case(REST, f"pushed {text}", partial(_pushes, start, sampled), 1e-13, product_only=True)
    yield Case(REST, "the same push later", _later, 1e-12, "nothing before it, then the same motion, m and m/s",
               product_only=True)
    for sign, text, oracle in ((-1.0, "part", "closed form, m"), (1.0, "are pressed together", "energy, J")):
        yield Case(REST, f"on a tilted line they {text}", partial(_tilted, sign), 1e-13,
                   f"gravity cancels in u''; {oracle}", product_only=True)

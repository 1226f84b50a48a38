"""Oracles of the tests alone; those that the study of hard cases shares are in `lab.oracles.closed_forms`.

Nothing here but `run` and `balance_of` calls a kernel. Everything works in mpmath unless its name says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.exact.integrator import Integrator, Status
from grasp_ros.physics import energy as certificate
from grasp_ros.physics.accuracy import ACCURACY
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Arm, Array, Contact
from lab.oracles.closed_forms import Balance, Impact, balance, first_touch_from_rest, flight, impact, reduced_mass
from lab.reference import Reference, integrate
from lab.reference.grasp import Grasp, system_of

__all__ = ["Balance", "Impact", "first_touch_from_rest", "flight", "impact", "reduced_mass"]  # for the tests
STANDARD = Arm(1.0, 10.0, 0.2, 5.0, 0.5)
ELASTIC = Arm(1.0, 10.0, 0.0, 5.0, 0.0)
FREE = Arm(1.0, 0.0, 0.0, 0.0, 0.0)
AT_REST = [-0.3, 0.0, 0.0, 0.0, 0.5, 0.0]  # the standard release, m and m/s
CASES = [f"case_{number:02d}" for number in range(1, 12)]


def energy(grasp: Grasp, state: Array) -> certificate.Energy:
    """V, V_c, V' and mode of the paper's grasp."""
    return certificate.energy(system_of(grasp, np.zeros(6)), state)


def make_grasp(
    arm: Arm = STANDARD, hertzian: float = 1e4, p: float = 0.1, object_mass: float = 5.0, right: Arm | None = None
) -> Grasp:
    """The same contact on both sides, and the same arm unless told otherwise."""
    return Grasp(arm, arm if right is None else right, Contact(hertzian, p), Contact(hertzian, p), object_mass)


# Flight: m x'' + c x' + k x = f.


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


# High-precision reference of the paper's cases, once per case and session.


@cache
def reference_of(name: str, horizon: float, points: int = 201) -> Reference:
    """The reference of a scene's binary floats on an equidistant grid; with 25 digits the doubles are the same."""
    return integrate(scenes.load(name), np.linspace(0.0, horizon, points).tolist(), digits=16)


# Balances of momentum and energy, O3.


class Run(NamedTuple):
    """A finished integration."""

    integrator: Integrator
    states: Array

    def times(self, side: int, *kinds: Transition) -> Array:
        """Times of one side's events of some kinds."""
        return np.array([e.time for e in self.integrator.events if e.side == side and e.kind in kinds])


def run(grasp: Grasp, state: Any, duration: float, grid: Any = None, **options: Any) -> Run:
    """Integrate with continuous feedback (unless told otherwise) over one horizon."""
    options = {"continuous": True, "accuracy": ACCURACY, **options}
    integrator = Integrator(system_of(grasp, np.asarray(state, dtype=float)), **options)
    return Run(integrator, integrator.advance(duration, None if grid is None else np.asarray(grid)))


def kinds(result: Run) -> list[tuple[str, int]]:
    """Events without their times."""
    return [(event.kind.name, event.side) for event in result.integrator.events]


def done(result: Run) -> Integrator:
    """The integrator of a run that must have reached its end."""
    assert result.integrator.status is Status.DONE
    return result.integrator


def balance_of(grasp: Grasp, state: Any, duration: float, **options: Any) -> Balance:
    """O3 along one trajectory with continuous feedback."""
    events = [event.time for event in run(grasp, state, duration, **options).integrator.events]
    system = system_of(grasp, np.asarray(state, dtype=float))
    return balance(system, duration, events, lambda grid: run(grasp, state, duration, grid, **options).states)

"""The table of all methods, and the one door to those that step in time."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from grasp_ros.exact.integrator import ACCURACY, COARSEST, FINEST
from grasp_ros.methods import discrete_gradient, fixed_step, library
from grasp_ros.methods.equations import Solution
from grasp_ros.physics.model import Array, Grasp
from grasp_ros.scene import PAPER, Scene

EXACT = "exact"
STEP, TOLERANCE, ACCURACY_KNOB = "step", "tolerance", "accuracy"
UNITS = {STEP: " s", TOLERANCE: "", ACCURACY_KNOB: ""}
MOST_STEPS = 1e9
MOST_EVENTS = 10**6  # rows of memory, which is only taken where it is written


class Method(NamedTuple):
    """One way to integrate a grasp."""

    name: str
    order: str
    source: str
    at_touch: str  # what it does at a touch
    knob: str  # STEP, TOLERANCE or ACCURACY_KNOB
    default: float
    ladder: tuple[float, ...]  # settings worth a measurement, loose to tight
    low: float  # allowed settings, `low` to `high`; a step is limited by the horizon as well
    high: float
    solve: Callable[[Grasp, Array, float, Array, float, int], Solution] | None  # None: `simulation.simulate` itself
    package: str | None = None  # that must be installed

    @property
    def finds_contacts(self) -> bool:
        """Whether touches and releases are part of the result."""
        return self.solve is None or not self.at_touch.startswith("nothing")


def _tens(first: float, last: float, per_decade: int = 1) -> tuple[float, ...]:
    """10**-first ... 10**-last."""
    return tuple(float(f"{10.0 ** -(k / per_decade):.1e}") for k in range(round(first * per_decade),
                                                                        round(last * per_decade) + 1))


_STEPS = tuple(base * 10.0**-decade for decade in range(2, 6) for base in (1.0, 0.5, 0.2))
_HAIRER = "Hairer, Norsett, Wanner, Solving ODEs I"
_STIFF = "Hairer, Wanner, Solving ODEs II"
_INSIDE = "nothing: the events are inside the right-hand side"
_RESTART = "frozen mode; terminal events of scipy, which it looks for at the ends of its steps; restart after each"


def _fixed(name: str, order: str, source: str, at_touch: str, rule: int) -> Method:
    return Method(
        name, order, source, at_touch, STEP, 1e-4, _STEPS, 0.0, 1e9, partial(fixed_step.solve, rule)
    )


def _scipy(solver: str, order: str, source: str) -> list[Method]:
    ladder = (*_tens(3, 13), 3e-14)  # solve_ivp takes no less than 100 roundings
    return [
        Method(name, order, source, text, TOLERANCE, 1e-9, ladder, 2.3e-14, 1e-2, partial(solve, solver), "scipy")
        for name, text, solve in (
            (solver.lower(), _INSIDE, library.straight), (f"{solver.lower()}_events", _RESTART, library.restarted),
        )
    ]


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method(
            EXACT, "any, by the accuracy", "this package: grasp_ros/exact",
            "closed-form flight to the touch, which cannot be missed; Taylor series in w = sqrt(u) through the contact",
            ACCURACY_KNOB, ACCURACY, _tens(3, 16), FINEST, COARSEST, None,
        ),
        _fixed(
            "paper", "2 at a touch, 4 elsewhere", "Fukuda, Shoji, Inaba (1990), Simulation Method",
            "decided at both ends of a step; time and state by linear interpolation, then the rest of the step",
            fixed_step.PAPER,
        ),
        _fixed("rk4", "4; through a touch 2.5", f"{_HAIRER}, II.1", _INSIDE, fixed_step.PLAIN),
        _fixed(
            "rk4_events", "4; through a touch 2.5", f"{_HAIRER}, II.1",
            "frozen mode; looked for at the ends of a step, located to rounding; restart from there",
            fixed_step.LOCATED,
        ),
        Method(
            "discrete_gradient", "2", "Gonzalez (1996); Celledoni et al. (2012)",
            "nothing is located: a difference quotient spans the touch and conserves V_c", STEP, 1e-4, _STEPS, 0.0, 1e9,
            discrete_gradient.solve,
        ),
        *_scipy("RK45", "5(4)", f"Dormand, Prince (1980); {_HAIRER}, II.5; scipy"),
        *_scipy("DOP853", "8(5,3)", f"{_HAIRER}, II.5; scipy"),
        *_scipy("Radau", "5, implicit", f"{_STIFF}, IV.8; scipy"),
        *_scipy("LSODA", "1 to 12, implicit where stiff", "Hindmarsh, Petzold (1983); scipy"),
    )
}


def check(name: str, scene: Scene, setting: float | None, sampled: bool = False) -> float:
    """The setting of a method, if it can do what is asked; the one place that says what methods can.

    The range of `exact` is checked where it is used, in `physics.integrator.Integrator`.

    Raises
    ------
    ValueError
        If the name or the setting is not allowed, a package is missing, or the scene has something, or lacks
        something, that only `exact` knows how to treat.
    """
    if name not in METHODS:
        raise ValueError(f"method {name!r} is not allowed; allowed: {', '.join(METHODS)}")
    method = METHODS[name]
    value = method.default if setting is None else setting
    if name == EXACT:
        return value
    low, high = method.low, method.high
    if method.knob == STEP:
        low, high = scene.duration / MOST_STEPS, scene.duration
        value = min(value, high) if setting is None else value
    if not low <= value <= high:
        raise ValueError(f"{name}: {method.knob} {value!r} is not allowed; allowed: {low:g} to {high:g}")
    if sampled:
        raise ValueError(f"{name}: only continuous feedback; allowed for sampled feedback: {EXACT}")
    if odd := sorted(set(scene.values) ^ PAPER):
        raise ValueError(
            f"{scene.name}: {', '.join(odd)}: {name} knows two arms, an object and their contacts, no more and no less;"
            f" allowed here: {EXACT}"
        )
    if method.package is not None and importlib.util.find_spec(method.package) is None:
        raise ValueError(f"{name}: needs {method.package}, which is not installed; pip install 'grasp_ros[study]'")
    return value


def solve(name: str, scene: Scene, grid: Array, setting: float, max_events: int) -> Solution:
    """Integrate a scene with a method that steps in time.

    Parameters
    ----------
    name : str
        A key of METHODS, not EXACT.
    scene : Scene
    grid : array (n,), s
        Ascending output times within the horizon.
    setting : float
        Step in s or tolerance (rtol = atol), as `check` gives it.
    max_events : int
        Budget of contact events.
    """
    run = METHODS[name].solve
    assert run is not None
    times, place = np.unique(grid, return_inverse=True)
    solution = run(scene.grasp, scene.initial_state, scene.duration, times, setting, max_events)
    return solution._replace(state=solution.state[place[place < len(solution.state)]])

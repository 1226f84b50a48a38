"""Touches that are easily lost: simultaneous, nearly so, grazing, and two within one contact."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Arm, Contact
from lab.cases.case import Case, Product, Solver, recorded
from lab.cases.families import EXTREME, GRAZE, TOUCH
from lab.cases.scenes import AWAY, FREE, STANDARD, distance, grasp, library, part, reference
from lab.oracles.closed_forms import first_peak, first_touch_from_rest

SYMMETRIC = (-0.4, 0.1, 0.0, 0.0, 0.4, -0.1)
STIFF = Arm(1.0, 10.0, 0.2, 50.0, 5.0)


def _first_touch(name: str, damping: float, solver: Solver) -> float:
    """Time of the first touch of both sides."""
    times = [event.time for event in solver.events(library(name, 0.5)) if event.kind is Transition.TOUCH]
    if len(times) < 2:
        return np.inf
    expected = float(first_touch_from_rest(1, 15, damping))
    return max(abs(time / expected - 1.0) for time in times[:2])


def _apart(delay: float, solver: Solver) -> float:
    """States behind two impacts whose touches are a little apart, in m and m/s; all speeds are about 1."""
    scene = grasp([-0.5, 1.0, 0.0, 0.0, 0.5 + delay, -1.0], 1.0, left=FREE, contact=Contact(1e4, 0.3), mass=1.0)
    times = [0.0, 0.52, 0.7, scene.duration]
    return float(np.abs(solver.states(scene, times)[:, :4] - reference(scene, times)[:, :4]).max())


def symmetric(arm: Arm, p: float, mass: float, solver: Solver) -> float:
    """How far the object moves between two equal arms; they must meet it at least once."""
    scene = grasp(SYMMETRIC, 5.0, left=arm, contact=Contact(1e4, p), mass=mass)
    states = solver.states(scene, part(scene, 201))
    events = recorded(solver)
    if events is not None and len(events) < 4:
        return np.inf
    return float(max(np.abs(states[:, 2:4]).max(), np.abs(states[:, 0:2] + states[:, 4:6]).max()))


def _graze(overshoot: float, solver: Solver) -> float:
    """The speed that a grazed object gets; of a near miss the speed itself, which is 0."""
    peak = first_peak(-0.3, 1.0, 15.0, STANDARD.damping + STANDARD.velocity_gain)
    face = float(peak - overshoot)
    scene = grasp([-0.3, 0.0, face, 0.0, AWAY, 0.0], 1.0, right=FREE, contact=Contact(1e4, 0.0), mass=1.0)
    found = float(solver.states(scene, [1.0])[0, 3])
    if overshoot <= 0.0:
        return abs(found)
    expected = float(reference(scene, [0.0, 1.0])[1, 3])
    return abs(found / expected - 1.0)


def _within_one_period(product: Product) -> float:
    """Arm in and out of a light object within one control period of 0.8 s, with a command that is held."""
    scene = grasp([-0.3, 0.0, 0.1, 0.0, 30.0, 0.0], 0.8, left=Arm(1.0, 100.0, 0.2, 5.0, 0.5), right=FREE,
                  contact=Contact(1e4, 0.1), mass=1e-3)
    held = scenes.compose("held", {**scene.values, "loop": {}})
    times = [0.0, scene.duration]
    return distance(product.states(held, times)[1:], reference(held, times)[1:])


def _during(seconds: float, right: Arm, mass: float, touches: int, solver: Solver) -> float:
    """The stiff right side touches some times during one long, soft contact of the left side."""
    scene = grasp([0.0, 1.0, 0.0, 0.0, 0.01, 0.0], seconds, left=FREE, right=right, contact=Contact(50.0, 0.1),
                  right_contact=Contact(1e6, 0.1), mass=mass)
    times = part(scene, 61)
    error = distance(solver.states(scene, times), reference(scene, times))
    events = recorded(solver)
    if events is not None:
        kinds = [(event.kind, event.side) for event in events]
        if kinds.count((Transition.TOUCH, RIGHT)) != touches or (Transition.RELEASE, LEFT) in kinds:
            return np.inf
    return error


def _turning(sides: int, solver: Solver) -> float:
    """State of arms that turn after 1.6 ms in a contact so soft that it does nothing within that time."""
    speed, rate = 1e-13, 1e3
    arm = Arm(1.0, rate**2, 0.0, 0.0, 0.0)
    scene = grasp([0.0, speed, 0.0, 0.0, 0.0 if sides == 2 else AWAY, -speed if sides == 2 else 0.0], 0.003, left=arm,
                  right=arm if sides == 2 else FREE, contact=Contact(1.0, 0.1))
    times = part(scene, 31)
    states = solver.states(scene, times)
    errors = states[:, 0] * rate - speed * np.sin(rate * times), states[:, 1] - speed * np.cos(rate * times)
    return float(np.abs(errors).max() / speed)


def cases() -> Iterator[Case]:
    """All touches."""
    for name, damping in (("case_01", 0.7), ("case_02", 0.0), ("case_03", 0.0)):
        yield Case(TOUCH, f"exactly simultaneous, {name}", partial(_first_touch, name, damping), 2e-16,
                   "O4: time of the first touch of both sides, relative")
    for arm, p, text in ((STANDARD, 0.1, "standard arms"), (STIFF, 10.0, "clamped and back")):
        yield Case(TOUCH, f"exactly simultaneous for 5 s, {text}", partial(symmetric, arm, p, 0.5), 0.0,
                   "O5: the object stays at exactly 0")
    for exponent in (3, 6, 9, 12, 15, 16):
        yield Case(TOUCH, f"1e-{exponent} s apart", partial(_apart, 10.0**-exponent), 1e-11)
    for exponent in (4, 6, 8, 10, 12):
        yield Case(GRAZE, f"overshoot 1e-{exponent} m", partial(_graze, 10.0**-exponent), 1e-14 * 10.0**exponent)
    for overshoot, text in ((0.0, "to the peak, rounded"), (-1e-15, "miss by 1e-15 m"), (-1e-6, "miss by 1e-6 m")):
        yield Case(GRAZE, text, partial(_graze, overshoot), 1e-20, "O13: no touch, the object stays at rest, m/s")
    yield Case(GRAZE, "two crossings within one control period", _within_one_period, 1e-11,
               "the command is held for 0.8 s; all states, relative", product_only=True)
    for sides, text in ((1, "one arm"), (2, "both arms")):
        yield Case(EXTREME, f"{text} in a contact that is much too slow", partial(_turning, sides), 1e-13,
                   "the impact would last for minutes, the arm turns after 1.6 ms: its free swing")
    light = Arm(0.01, 400.0, 0.0, 0.0, 0.0)
    for touches, seconds, right, mass in ((1, 0.25, FREE, 1.0), (2, 0.4, FREE, 1.0), (3, 0.1, light, 0.5)):
        yield Case(TOUCH, f"second side {touches} times during one contact",
                   partial(_during, seconds, right, mass, touches), 1e-10)

"""Touches that are easily lost: simultaneous, nearly so, grazing, and two within one contact; and bodies at rest.

Where bodies touch at rest, what acts on them decides whether they are pressed together, and when.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics.layout import LEFT, RIGHT, Transition
from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.cases.case import Case, Product, Solver, recorded
from lab.cases.families import EXTREME, GRAZE, REST, TOUCH
from lab.cases.scenes import AWAY, FREE, STANDARD, distance, grasp, library, part, reference
from lab.oracles.closed_forms import first_peak, first_touch_from_rest

SYMMETRIC = (-0.4, 0.1, 0.0, 0.0, 0.4, -0.1)
STIFF = Arm(1.0, 10.0, 0.2, 50.0, 5.0)
# of bodies that touch at rest
PUSH, HERTZIAN, RATE = 1.0, 1e4, 10.0  # N, N/m^1.5, 1/s
GRAVITY, ANGLE = 9.81, 0.3  # m/s^2, rad
BODIES = 1.0, 2.0  # kg, arm and object


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
    for start, sampled, text in ((0.0, False, "at once"), (1.0, False, "after 1 s"), (1.0, True, "in a sampled run")):
        yield Case(REST, f"pushed {text}", partial(_pushes, start, sampled), 1e-13, product_only=True)
    yield Case(REST, "the same push later", _later, 1e-12, "nothing before it, then the same motion, m and m/s",
               product_only=True)
    for sign, text, oracle in ((-1.0, "part", "closed form, m"), (1.0, "are pressed together", "energy, J")):
        yield Case(REST, f"on a tilted line they {text}", partial(_tilted, sign), 1e-13,
                   f"gravity cancels in u''; {oracle}", product_only=True)

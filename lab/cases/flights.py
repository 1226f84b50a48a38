"""Flights: damping near critical, vanishing springs, long waits, and arms that never arrive."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from grasp_ros.exact.tolerances import REST
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Arm, Contact
from lab.cases.case import Case, Solver, recorded
from lab.cases.families import FLIGHT, WAIT
from lab.cases.scenes import AWAY, FREE, STANDARD, grasp
from lab.oracles.closed_forms import flight

TIMES = (1e-6, 0.1, 1.0, 5.0, 20.0)


def _alone(arm: Arm, solver: Solver) -> float:
    """An arm that meets nobody, beside the exact flight."""
    scene = grasp([-0.3, 0.7, AWAY, 0.0, 2.0 * AWAY, 0.0], TIMES[-1], left=arm, right=FREE)
    states = solver.states(scene, TIMES)
    body = arm.mass, arm.stiffness + arm.position_gain, arm.damping + arm.velocity_gain, 0.0
    worst = 0.0
    for time, state in zip(TIMES, states, strict=True):
        x, v = (float(value) for value in flight(body, -0.3, 0.7, time))
        size = abs(x) + abs(v)
        if size < REST and max(abs(state[0]), abs(state[1])) < REST:
            continue  # of a start of 0.3 m and 0.7 m/s: it is at rest
        worst = max(worst, abs(state[0] - x) / size, abs(state[1] - v) / size)
    return worst


def _long_wait(speed: float, distance: float, solver: Solver) -> float:
    """Time of a touch after a free flight."""
    seconds = distance / speed
    scene = grasp([-distance, speed, 0.0, 0.0, AWAY, 0.0], 1.1 * seconds, left=FREE, contact=Contact(1e4, 0.0),
                  mass=1.0)
    touches = [event.time for event in solver.events(scene) if event.kind is Transition.TOUCH]
    return abs(touches[0] / seconds - 1.0) if len(touches) == 1 else np.inf


def _never(arm: Arm, solver: Solver) -> float:
    """How far the object moves although nothing ever touches it."""
    scene = grasp([-0.3, 0.0, 0.0, 0.0, 0.5, 0.0], 1e4, left=arm)
    moved = float(np.abs(solver.states(scene, [1.0, 100.0, 1e4])[:, 2:4]).max())
    return np.inf if recorded(solver) else moved


def _at_rest(solver: Solver) -> float:
    scene = grasp([0.0] * 6, 1e6)
    moved = float(np.abs(solver.states(scene, [0.0, 1.0, 1e6])).max())
    return np.inf if recorded(solver) else moved


def cases() -> Iterator[Case]:
    """All flights."""
    root = 2.0 * 15.0**0.5
    for offset in (0.0, 1e-15, -1e-15, 1e-12, -1e-12, 1e-8, -1e-8, 1e-4, -1e-4):
        change = f" times 1 {'-' if offset < 0 else '+'} {abs(offset):g}" if offset else ""
        text = f"critical damping{change}"
        yield Case(FLIGHT, text, partial(_alone, Arm(1.0, 10.0, root * (1.0 + offset), 5.0, 0.0)), 1e-13)
    for text, arm in (
        ("c = 1e6, strongly over-damped", Arm(1.0, 10.0, 1e6, 5.0, 0.0)), ("no spring", Arm(1.0, 0.0, 0.7, 0.0, 0.0)),
        ("a spring of 1e-18 N/m", Arm(1.0, 1e-18, 0.7, 0.0, 0.0)), ("no damper", Arm(1.0, 10.0, 0.0, 5.0, 0.0)),
        ("k + Kp = 0 by feedback", Arm(1.0, 10.0, 0.2, -10.0, 0.5)), ("nothing", FREE),
        ("a damper of 1e-18 N s/m", Arm(1.0, 10.0, 1e-18, 5.0, 0.0)),
    ):
        yield Case(FLIGHT, text, partial(_alone, arm), 2e-13)
    for speed, distance in ((1e-6, 1.0), (1e-3, 1e3), (1.0, 1e6)):
        yield Case(WAIT, f"{distance / speed:g} s at {speed:g} m/s", partial(_long_wait, speed, distance), 4e-16,
                   "time of the touch: distance / speed, relative")
    for text, arm in (("over-damped", STANDARD._replace(damping=39.0)), ("critical", Arm(1.0, 16.0, 8.0, 0.0, 0.0))):
        yield Case(WAIT, f"never arrives: {text}", partial(_never, arm), 0.0)
    yield Case(WAIT, "everything at 0 for 1e6 s", _at_rest, 0.0, "u = u' = 0 on both sides")

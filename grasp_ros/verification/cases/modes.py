"""Condition (10)'s second surface, starts in every mode, and extreme stiffness and mass."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import Transition
from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from grasp_ros.verification.cases.case import Case, Solver
from grasp_ros.verification.cases.families import CLAMP, EXTREME, START
from grasp_ros.verification.cases.scenes import STANDARD, distance, grasp, library, part, reference

STARTS: dict[str, tuple[float, ...]] = {
    "in contact": (0.005, 0.3, 0.0, 0.0, 0.5, 0.0),
    "deep, 0.3 m": (0.3, 0.0, 0.0, 0.0, 0.5, 0.0),
    "both deep": (0.3, 0.1, 0.0, 0.0, -0.2, 0.3),
    "clamped": (0.01, -12.0, 0.0, 0.0, 0.5, 0.0),
    "both clamped": (0.01, -12.0, 0.0, 0.0, -0.02, 11.0),
    "u' = -1/p exactly": (0.01, -10.0, 0.0, 0.0, 0.5, 0.0),
    "u = 0, approaching": (0.0, 0.4, 0.0, 0.0, 0.5, 0.0),
    "u = 0, separating": (0.0, -0.4, 0.0, 0.0, 0.5, 0.0),
    "u = 0, u' = 0, pressed": (-0.1, 0.0, -0.1, 0.0, 0.5, 0.0),
    "u = 0, u' = 0, pulled": (0.1, 0.0, 0.1, 0.0, 0.5, 0.0),
    "u = 0 on both sides": (0.0, 0.4, 0.0, 0.0, 0.0, -0.7),
    "a denormal gap": (-5e-324, 0.4, 0.0, 0.0, 0.5, 0.0),
    "a denormal penetration": (5e-324, 0.4, 0.0, 0.0, 0.5, 0.0),
    "1e4 m/s": (-1.0, 1e4, 0.0, 0.0, 0.5, 0.0),
}


def _states(scene: Scene, solver: Solver) -> float:
    times = part(scene, 41)
    return distance(solver.states(scene, times), reference(scene, times))


def _height(name: str, time: float, depth: float, solver: Solver) -> float:
    """Time and depth of the first re-entry."""
    back = [event for event in solver.events(library(name, 1.0)) if event.kind is Transition.REENTRY]
    return max(abs(back[0].time / time - 1.0), abs(back[0].u / depth - 1.0))


def _clamped() -> Iterator[tuple[str, Scene]]:
    strong = Arm(1.0, 10.0, 0.2, 80.0, 6.0)
    yield "both sides at once", grasp((-0.3, 0, 0, 0, 0.3, 0), 3.0, left=Arm(1.0, 10.0, 0.2, 50.0, 5.0),
                                      contact=Contact(1e4, 10.0), mass=1.0)
    yield "one side", grasp((-0.3, 0, 0, 0, 0.2, 0), 3.0, contact=Contact(1e3, 15.0), mass=1.0)
    yield "hardly: Table 1, p = 2.1", library("v_jump_smallest_p", 1.0)
    yield "unequal sides, light object", grasp((-0.3, 0.5, 0, 0, 0.4, 0), 3.0, left=strong, mass=0.3,
                                               contact=Contact(300.0, 20.0))
    yield "p = 1000 from a deep start", grasp((0.1, 0.0, 0.0, 0.0, 0.3, 0.0), 1.0, left=strong,
                                              contact=Contact(1e3, 1e3), mass=1.0)


def _extreme() -> Iterator[tuple[str, Scene]]:
    away = (-0.3, 0.0, 0.01, 0.0, 0.5, 0.0)
    yield "H = 1e8", grasp(away, 1.2, contact=Contact(1e8, 0.1))
    yield "H = 1e12", grasp(away, 1.2, contact=Contact(1e12, 0.1))
    yield "H = 1, sinking in", grasp(away, 3.0, contact=Contact(1.0, 0.1))
    yield "object of 1e-4 kg", grasp(away, 0.44, mass=1e-4)
    yield "object of 1e6 kg", grasp(away, 1.2, mass=1e6)
    yield "object of 1e6 kg, H = 1e12", grasp(away, 1.2, contact=Contact(1e12, 0.1), mass=1e6)
    heavy = STANDARD._replace(mass=1e6)
    yield "arms of 1 and 1e6 kg", grasp((-0.3, 0.0, 0.0, 0.0, 0.01, -1e-3), 0.6, right=heavy)
    yield "springs of 1e8 N/m", grasp((-0.3, 0.0, 0.01, 0.0, 0.5, 0.0), 0.02, left=Arm(1.0, 1e8, 0.2, 5.0, 0.5))


def _huge(p: float, solver: Solver) -> float:
    """Arms that squeeze the object with a p that never lets it go."""
    scene = grasp((-0.3, 0.0, 0.0, 0.0, 0.5, 0.0), 1.0, contact=Contact(1e4, p))
    return _states(scene, solver)


def cases() -> Iterator[Case]:
    """All modes, starts and extremes."""
    yield Case(CLAMP, "re-entry of v_jump_symmetric",
               partial(_height, "v_jump_symmetric", 0.363159009501776, 0.006353953744931), 1e-11,
               "time and depth of the re-entry, known to 15 digits, relative")
    for text, scene in _clamped():
        yield Case(CLAMP, text, partial(_states, scene), 1e-10)
    for text, state in STARTS.items():
        yield Case(START, text, partial(_states, grasp(state, 1.0, mass=2.0)), 1e-11)
    for text, scene in _extreme():
        yield Case(EXTREME, text, partial(_states, scene), 1e-11)
    for p in (300.0, 1e4):
        yield Case(CLAMP, f"squeezed with p = {p:g}", partial(_huge, p), 1e-9,
                   "creeps along the surface, pressed and pulled by springs", limit=Status.STALLED)


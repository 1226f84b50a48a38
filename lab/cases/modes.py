"""The clamp surface u' = -1/p of condition (10), starts in every mode, and extreme stiffness and mass."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.layout import EPS, LEFT, RIGHT, Transition
from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.cases.case import Case, Solver, recorded
from lab.cases.families import CLAMP, EXTREME, START
from lab.cases.scenes import STANDARD, contacts, distance, grasp, library, part, reference, reference_run

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
    "u = 0, u' = 0, pressed on both sides": (-0.1, 0.0, -0.1, 0.0, -0.1, 0.0),
    "u = 0 on both sides, the left one at rest": (0.0, 0.0, 0.0, 0.0, 0.0, -0.3),
    "a gap of one rounding": (-EPS / 2, 0.4, 0.0, 0.0, 0.5, 0.0),
    "a penetration of one rounding": (EPS / 2, 0.4, 0.0, 0.0, 0.5, 0.0),
    "1e4 m/s": (-1.0, 1e4, 0.0, 0.0, 0.5, 0.0),
}
CLAMPS = {  # first clamp and first re-entry of the right pair: time in s, depth in m; by the reference with 30 digits
    "v_jump_symmetric": ((0.31545231844736173, 0.011179605635114846), (0.36315900950177645, 0.0063539537449310074)),
    "v_jump_one_sided": ((0.55401683582995486, 0.021953677733082374), (0.57292735735190279, 0.020691567680421681)),
}


def _states(scene: Scene, solver: Solver) -> float:
    times = part(scene, 41)
    return distance(solver.states(scene, times), reference(scene, times))


def _contacts_and_states(scene: Scene, solver: Solver) -> float:
    """The same; the product must have recorded as many contacts as the reference has."""
    error, events = _states(scene, solver), recorded(solver)
    exact = reference_run(scene, part(scene, 41))
    for side in (LEFT, RIGHT):
        there_are = [len(exact.touches[side]), len(exact.releases[side])]
        if events is not None and [len(times) for times in contacts(events, side)] != there_are:
            return np.inf
    return error


def _clamps(name: str, solver: Solver) -> float:
    """Times in s and depths in m of the first clamp and the first re-entry."""
    events = solver.events(library(name, 1.0))
    worst = 0.0
    for kind, (time, depth) in zip((Transition.CLAMP, Transition.REENTRY), CLAMPS[name], strict=True):
        first = next((event for event in events if event.kind is kind and event.side == RIGHT), None)
        if first is None:
            return np.inf
        worst = max(worst, abs(first.time - time), abs(first.u - depth))
    return worst


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
    yield "object of 1e6 kg, H = 1e6", grasp(away, 1.2, contact=Contact(1e6, 0.1), mass=1e6)
    yield "object of 1e6 kg, H = 1e12", grasp(away, 1.2, contact=Contact(1e12, 0.1), mass=1e6)
    heavy = STANDARD._replace(mass=1e6)
    yield "arms of 1 and 1e6 kg", grasp((-0.3, 0.0, 0.0, 0.0, 0.01, -1e-3), 0.6, right=heavy)
    yield "springs of 1e8 N/m", grasp((-0.3, 0.0, 0.01, 0.0, 0.5, 0.0), 0.02, left=Arm(1.0, 1e8, 0.2, 5.0, 0.5))


def cases() -> Iterator[Case]:
    """All modes, starts and extremes."""
    for name in CLAMPS:
        yield Case(CLAMP, f"clamp and re-entry of {name}", partial(_clamps, name), 2e-14,
                   "their times and depths, known to 30 digits, s and m")
    for text, scene in _clamped():
        yield Case(CLAMP, text, partial(_contacts_and_states, scene), 1e-10)
    for text, state in STARTS.items():
        yield Case(START, text, partial(_states, grasp(state, 1.0, mass=2.0)), 1e-11)
    for text, scene in _extreme():
        yield Case(EXTREME, text, partial(_contacts_and_states, scene), 1e-11)
    for p in (300.0, 1e4):
        squeezed = grasp((-0.3, 0.0, 0.0, 0.0, 0.5, 0.0), 1.0, contact=Contact(1e4, p))
        yield Case(CLAMP, f"squeezed with p = {p:g}", partial(_contacts_and_states, squeezed), 1e-9,
                   "creeps along the clamp surface, pressed and pulled by springs", limit=Status.STALLED)


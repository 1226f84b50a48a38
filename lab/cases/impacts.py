"""Isolated impacts of two free bodies, and chains of three: laws that hold for any stiffness and speed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from grasp_ros.exact.events import Event
from grasp_ros.physics.layout import EPS, LEFT, Transition
from grasp_ros.physics.model import Contact
from lab.cases.case import Case, Solver, recorded
from lab.cases.families import CHAIN, CREEP, EXTREME, IMPACT
from lab.cases.scenes import AWAY, FREE, distance, grasp, reference
from lab.oracles.closed_forms import chain_speeds, impact_numbers

LOSSES = (0.0, 0.1, 1.0, 10.0, 100.0)  # p v
TOUCHING = {  # O11: mass of the middle body, and the speeds behind a touching chain that was hit with 1
    1.0: (-0.070952353651436871, 0.076403039071206993, 0.994549314580229878),
    0.5: (-0.136122574012185708, 0.355827683353408662, 0.958208732335481377),
    0.1: (-0.0475095756030004457, 0.907669860965354066, 0.956742589506465039),
}


def impact_error(m1: float, m2: float, hertzian: float, losses: tuple[float, ...], speed: float,
                 solver: Solver) -> float:
    """Error of exit speed and duration, read from the states behind the impact; the product's record must agree."""
    worst = 0.0
    for loss in losses:
        p = loss / speed
        duration, restitution = impact_numbers(m1, m2, hertzian, p, speed)
        scene = grasp(
            [0.0, speed, 0.0, 0.0, AWAY, 0.0], 2.0 * duration, left=FREE._replace(mass=m1),
            right=FREE, contact=Contact(hertzian, p), mass=m2,
        )
        end = scene.duration
        x_l, v_l, x_o, v_o, _, _ = solver.states(scene, [end])[0]
        leaving = restitution * speed
        found = end - (x_o - x_l) / (v_o - v_l)
        worst = max(worst, abs((v_o - v_l) / leaving - 1.0), abs(found / duration - 1.0))
        events = recorded(solver)
        if events is not None:
            worst = max(worst, _release_error(events, duration, leaving))
    return worst


def _release_error(events: list[Event], time: float, speed: float) -> float:
    """Error of the time and the speed of the only release."""
    found = [event for event in events if event.kind is Transition.RELEASE]
    if len(found) != 1 or found[0].side != LEFT:
        return np.inf
    return max(abs(found[0].time / time - 1.0), abs(-found[0].u_rate / speed - 1.0))


def chain(mass: float, gap: float, speed: float, contact: Contact, seconds: float, expected: tuple[float, float, float],
          touches: int | None, solver: Solver) -> float:
    """Error of the speeds, over that of the first body, behind all impacts of a chain 1 : mass : 1.

    The product must have recorded as many touches, if a number is given.
    """
    scene = grasp([-gap, speed, 0.0, 0.0, gap, 0.0], seconds, left=FREE, contact=contact, mass=mass)
    error = float(np.abs(solver.states(scene, [scene.duration])[0, 1::2] / speed - expected).max())
    events = recorded(solver)
    if None not in (events, touches) and sum(event.kind is Transition.TOUCH for event in events or ()) != touches:
        return np.inf
    return error


def _short(solver: Solver) -> float:
    """Restitution of one very slow impact beside a fast one: the same pair, one after the other."""
    scene = grasp([-1e-3, 1.0, 0.0, 0.0, 1.0, -1e-9], 3.0, left=FREE, contact=Contact(1e4, 0.3), mass=1e3)
    times = [0.0, 1e-3, scene.duration]
    return distance(solver.states(scene, times)[1:], reference(scene, times)[1:])


def _creeps(p: float, speed: float, hertzian: float, solver: Solver) -> float:
    duration, restitution = impact_numbers(1.0, 1.0, hertzian, p, speed)
    scene = grasp([0.0, speed, 0.0, 0.0, AWAY, 0.0], 1.5 * duration, left=FREE, contact=Contact(hertzian, p), mass=1.0)
    return _release_error(solver.events(scene), duration, restitution * speed)


def cases() -> Iterator[Case]:
    """All impacts."""
    for hertzian, speed in product((1.0, 1e4, 1e8, 1e12), (1e-6, 1.0, 1e3)):
        yield Case(IMPACT, f"H = {hertzian:g}, v = {speed:g} m/s, p v = 0 to 100",
                   partial(impact_error, 1.0, 1.0, hertzian, LOSSES, speed), 1e-12)
    for m1, m2 in ((1.0, 1e-6), (1.0, 1e6), (1e-6, 1.0), (1e6, 1.0)):
        yield Case(IMPACT, f"masses {m1:g} and {m2:g} kg", partial(impact_error, m1, m2, 1e4, (0.0, 0.3), 1.0), 1e-12)
    for mass, p, seconds, touches in ((1.0, 0.0, 10.0, 2), (0.5, 0.0, 10.0, 3), (1.0, 0.3, 100.0, 3)):
        yield Case(CHAIN, f"1:{mass:g}:1 with gaps, p = {p:g}",
                   partial(chain, mass, 1.0, 1.0, Contact(1e4, p), seconds, chain_speeds(mass, p), touches), 1e-13,
                   "the last impact comes after 75 s" if p > 0.0 else "")
    for mass, speeds in TOUCHING.items():
        yield Case(CHAIN, f"1:{mass:g}:1 without gaps, H = 1e8",
                   partial(chain, mass, 0.0, 1.0, Contact(1e8, 0.0), 10.0, speeds, None), 1e-12)
    yield Case(EXTREME, "an impact at 1 m/s, then one at 1e-9 m/s", _short, 1e-10)
    for p, speed, hertzian in ((1e4, 1.0, 1e4), (1e6, 1.0, 1e4), (1e3, 1e3, 1e12), (1e12, 1e-6, 1.0)):
        yield Case(CREEP, f"p = {p:g} s/m, v = {speed:g} m/s", partial(_creeps, p, speed, hertzian),
                   4.0 * EPS * p * speed, max_work=5000)

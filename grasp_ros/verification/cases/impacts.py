"""Isolated impacts of two free bodies, and chains of three: laws that hold for any stiffness and speed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from grasp_ros.exact.integrator import Status
from grasp_ros.physics.energy import EPS
from grasp_ros.physics.layout import LEFT, Transition
from grasp_ros.physics.model import Contact
from grasp_ros.verification.cases.case import Case, Solver
from grasp_ros.verification.cases.families import CHAIN, CREEP, EXTREME, IMPACT
from grasp_ros.verification.cases.scenes import AWAY, FREE, distance, grasp, reference
from grasp_ros.verification.oracles import impact_numbers

LOSSES = (0.0, 0.1, 1.0, 10.0, 100.0)  # p v


def impact_error(m1: float, m2: float, hertzian: float, losses: tuple[float, ...], speed: float,
                 solver: Solver) -> float:
    """Error of the exit speed and of the duration, both read from the states behind the impact."""
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
    return worst


def _chain(masses: tuple[float, float, float], gap: float, hertzian: float, p: float, seconds: float,
           expected: tuple[float, float, float], solver: Solver) -> float:
    left, middle, right = masses
    scene = grasp([-gap, 1.0, 0.0, 0.0, gap, 0.0], seconds, left=FREE._replace(mass=left),
                  right=FREE._replace(mass=right), contact=Contact(hertzian, p), mass=middle)
    return float(np.abs(solver.states(scene, [scene.duration])[0, 1::2] - expected).max())


def _short(solver: Solver) -> float:
    """Restitution of one very slow impact beside a fast one: the same pair, one after the other."""
    scene = grasp([-1e-3, 1.0, 0.0, 0.0, 1.0, -1e-9], 3.0, left=FREE, contact=Contact(1e4, 0.3), mass=1e3)
    times = [0.0, 1e-3, scene.duration]
    return distance(solver.states(scene, times)[1:], reference(scene, times)[1:])


def _creeps(p: float, speed: float, hertzian: float, solver: Solver) -> float:
    duration, _ = impact_numbers(1.0, 1.0, hertzian, p, speed)
    scene = grasp([0.0, speed, 0.0, 0.0, AWAY, 0.0], 1.5 * duration, left=FREE, contact=Contact(hertzian, p), mass=1.0)
    end = [event.time for event in solver.events(scene) if event.kind is Transition.RELEASE and event.side == LEFT]
    return abs(end[0] / duration - 1.0) if len(end) == 1 else np.inf


def cases() -> Iterator[Case]:
    """All impacts."""
    for hertzian, speed in product((1.0, 1e4, 1e8, 1e12), (1e-6, 1.0, 1e3)):
        yield Case(IMPACT, f"H = {hertzian:g}, v = {speed:g} m/s, p v = 0 to 100",
                   partial(impact_error, 1.0, 1.0, hertzian, LOSSES, speed), 1e-11)
    for m1, m2 in ((1.0, 1e-6), (1.0, 1e6), (1e-6, 1.0), (1e6, 1.0)):
        yield Case(IMPACT, f"masses {m1:g} and {m2:g} kg", partial(impact_error, m1, m2, 1e4, (0.0, 0.3), 1.0),
                   1e-9 if m1 == 1e6 or m2 == 1e6 else 1e-11)
    for masses, p, seconds, speeds in (
        ((1.0, 1.0, 1.0), 0.0, 10.0, (0.0, 0.0, 1.0)), ((1.0, 0.5, 1.0), 0.0, 10.0, (-5 / 27, 16 / 27, 8 / 9)),
        ((1.0, 1.0, 1.0), 0.3, 100.0, (0.0711621355174101678, 0.0835497205190094322, 0.8452881439635804)),
    ):
        yield Case(CHAIN, f"{':'.join(f'{m:g}' for m in masses)} with gaps, p = {p:g}",
                   partial(_chain, masses, 1.0, 1e4, p, seconds, speeds), 1e-12,
                   "the last impact comes after 75 s" if p > 0.0 else "")
    for mass, speeds in (
        (1.0, (-0.070952353651436871, 0.076403039071206993, 0.994549314580229878)),
        (0.5, (-0.136122574012185708, 0.355827683353408662, 0.958208732335481377)),
        (0.1, (-0.0475095756030004457, 0.907669860965354066, 0.956742589506465039)),
    ):
        yield Case(CHAIN, f"1:{mass:g}:1 without gaps, H = 1e8",
                   partial(_chain, (1.0, mass, 1.0), 0.0, 1e8, 0.0, 10.0, speeds), 1e-12)
    yield Case(EXTREME, "an impact at 1 m/s, then one at 1e-9 m/s", _short, 1e-10)
    for p, speed, hertzian in ((1e4, 1.0, 1e4), (1e6, 1.0, 1e4), (1e9, 1e3, 1e12), (1e12, 1e-6, 1.0)):
        yield Case(CREEP, f"p = {p:g} s/m, v = {speed:g} m/s", partial(_creeps, p, speed, hertzian),
                   4.0 * EPS * p * speed, limit=Status.STALLED)

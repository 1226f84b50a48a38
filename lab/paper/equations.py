"""Equations (1) to (37): a number for each that shows how well the motion agrees with it; (1) to (15) are here.

Accelerations are differentiated from the dense output of the integrator, which shares no line with the functions of
`physics` that state the equations.
"""

from __future__ import annotations

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics import lyapunov
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, X
from grasp_ros.physics.model import impact_force, in_contact, penetration
from grasp_ros.scene import SceneError
from lab.paper import by_hand
from lab.paper.cases import Cases, with_values
from lab.paper.conditions import condition_rows
from lab.paper.equation_table import AT_EVENTS, Equation, rows
from lab.paper.sample import Sample, relative
from lab.reference.grasp import acceleration

CROSSING = ("v_jump_one_sided", "v_jump_symmetric")  # scenes that cross the second surface of (10) with u > 0


def motion_equations(samples: list[Sample]) -> dict[str, float]:
    """(1) to (3)."""
    worst = np.zeros(3)
    for sample in samples:
        stated = acceleration(sample.grasp, sample.state)
        for row, (column, right) in enumerate(zip((1, 3, 5), stated, strict=True)):
            if np.abs(right).max() > 1e-9:  # the object of a symmetric case does not move
                worst[row] = max(worst[row], relative(sample.rate[:, column], right))
    return {"(1)": float(worst[0]), "(2)": float(worst[2]), "(3)": float(worst[1])}


def force_equations(samples: list[Sample]) -> dict[str, float]:
    """(4) to (8)."""
    inputs, impacts, gap = np.zeros(2), np.zeros(2), 0.0
    for sample in samples:
        grasp, y, run = sample.grasp, sample.state, sample.run
        for side, arm, x in ((LEFT, grasp.left, 0), (RIGHT, grasp.right, 4)):
            printed = -arm.position_gain * run.state[:, x] - arm.velocity_gain * run.state[:, x + 1]
            inputs[side] = max(inputs[side], np.abs(run.command[:, side] - printed).max())
            sign = -1.0 if side == LEFT else 1.0  # how (1), (2) count the impact force
            pushed = arm.mass * sample.rate[:, x + 1] + arm.stiffness * y[:, x] + arm.damping * y[:, x + 1]
            inferred = sign * (pushed - sample.system.feedback(y)[:, side])
            contact = grasp.left_contact if side == LEFT else grasp.right_contact
            stated = impact_force(contact, *sample.pair(side))
            impacts[side] = max(impacts[side], relative(inferred, stated))
        rates = [sample.differentiated(u) for u in penetration(sample.stencils)[0::2]]
        gap = max(gap, *(float(np.abs(rate - sample.pair(side)[1]).max()) for side, rate in enumerate(rates)))
    return {"(4)": float(inputs[LEFT]), "(5)": float(inputs[RIGHT]), "(6)": float(impacts[LEFT]),
            "(7)": float(impacts[RIGHT]), "(8)": gap}


def condition_equations(samples: list[Sample]) -> dict[str, float]:
    """(9) and (10)."""
    refused = 0
    for letter in ("H", "p"):
        try:
            with_values(samples[0].scene, {letter: -1.0})
        except SceneError:
            refused += 1
    wrong, at_events = 0, 0.0
    for sample in samples:
        table = sample.run.event_table
        kinds = np.isin(table[:, 2], (Transition.TOUCH, Transition.RELEASE))
        at_events = max(at_events, float(np.abs(table[kinds, 3]).max()))
        for side in (LEFT, RIGHT):
            u, d = sample.pair(side)
            own = table[table[:, 1] == side]
            row = np.searchsorted(own[:, 0], sample.t) - 1
            closed = np.where(row >= 0, np.isin(own[row, 2], (Transition.TOUCH, Transition.REENTRY)), u[0] > 0.0)
            contact = sample.grasp.left_contact if side == LEFT else sample.grasp.right_contact
            wrong += int(np.count_nonzero(closed != in_contact(contact, u, d)))
    return {"(9)": 2.0 - refused, "(10)": float(wrong), AT_EVENTS: at_events}


def form_equations(samples: list[Sample]) -> dict[str, float]:
    """(11) to (15)."""
    worst = dict.fromkeys(("(11)", "(12)", "(13)", "(14)", "(15)"), 0.0)
    for sample in samples:
        y, parts = sample.state, lyapunov.parts(sample.system, sample.state)
        P = np.array([by_hand.matrix(sample.scene, each) for each in y])
        squared = np.einsum("ni,nij,nj->n", y, P, y)
        moving = [x for x in (X.L, X.O, X.R) if y[:, x + 1].any()]  # the object of a symmetric case rests
        found = {"(11)": relative(sample.level.V, squared), "(12)": relative(np.sum(parts, axis=0), squared),
                 "(13)": max(relative(sample.rate[:, x], y[:, x + 1]) for x in moving)}
        for number, x, stored, side in (("(14)", X.L, parts.contact_l, LEFT), ("(15)", X.R, parts.contact_r, RIGHT)):
            if stored.max() > 0.0:
                found[number] = relative(-P[:, x, X.O] * sample.pair(side)[0] ** 2, stored)
        worst |= {number: max(worst[number], each) for number, each in found.items()}
    return worst


def equations(cases: Cases) -> list[Equation]:
    """All rows, from the eleven cases, and from scenes in which a pair separates faster than 1/p, as no case does."""
    return rows_of([Sample(scene) for scene in (*cases.values(), *map(scenes.load, CROSSING))])


def rows_of(samples: list[Sample]) -> list[Equation]:
    """All rows, from some motions."""
    return rows({
        **motion_equations(samples), **force_equations(samples), **condition_equations(samples),
        **form_equations(samples), **condition_rows(samples),
    })

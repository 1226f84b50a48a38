"""Equations (1) to (37): a number for each that shows how well the motion agrees with it; (1) to (15) are here.

Accelerations are differentiated from the dense output of the integrator, which shares no line with the functions of
`physics` that state the equations.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics import lyapunov
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, V, X
from grasp_ros.physics.model import impact_force, in_contact, penetration
from grasp_ros.scene import SceneError
from lab.paper import by_hand
from lab.paper.cases import Cases, with_values
from lab.paper.conditions import condition_rows, constant, positive
from lab.paper.equation_table import AT_EVENTS, EQUATIONS, Equation
from lab.paper.sample import Sample, relative
from lab.reference.grasp import acceleration

CROSSING = ("v_jump_one_sided", "v_jump_symmetric")  # scenes that cross the clamp surface of (10) with u > 0


def motion_equations(sample: Sample) -> dict[str, float]:
    """(1) to (3)."""
    stated = zip(("(1)", "(3)", "(2)"), (V.L, V.O, V.R), acceleration(sample.grasp, sample.state), strict=True)
    return {number: relative(sample.rate[:, column], right) for number, column, right in stated
            if np.abs(right).max() > 1e-9}  # the object of a symmetric case does not move


def force_equations(sample: Sample) -> dict[str, float]:
    """(4) to (8)."""
    grasp, y, run, found = sample.grasp, sample.state, sample.run, {}
    for side, arm, contact, x, v, sign, given, impact in (  # sign: how (1), (2) count the impact force
        (LEFT, grasp.left, grasp.left_contact, X.L, V.L, -1.0, "(4)", "(6)"),
        (RIGHT, grasp.right, grasp.right_contact, X.R, V.R, 1.0, "(5)", "(7)"),
    ):
        printed = -arm.position_gain * run.state[:, x] - arm.velocity_gain * run.state[:, v]
        found[given] = float(np.abs(run.command[:, side] - printed).max())
        pushed = arm.mass * sample.rate[:, v] + arm.stiffness * y[:, x] + arm.damping * y[:, v]
        inferred = sign * (pushed - sample.system.feedback(y)[:, side])
        found[impact] = relative(inferred, impact_force(contact, *sample.pair(side)))
    rates = [sample.differentiated(u) for u in penetration(sample.stencils)[0::2]]
    found["(8)"] = max(float(np.abs(rate - sample.pair(side)[1]).max()) for side, rate in enumerate(rates))
    return found


def contact_equations(sample: Sample) -> dict[str, float]:
    """(9) and (10)."""
    accepted, wrong, table = 0, 0, sample.run.event_table
    for letter in ("H", "p"):
        with suppress(SceneError):
            with_values(sample.scene, {letter: -1.0})
            accepted += 1
    for side, contact in ((LEFT, sample.grasp.left_contact), (RIGHT, sample.grasp.right_contact)):
        u, d = sample.pair(side)
        own = table[table[:, 1] == side]
        row = np.searchsorted(own[:, 0], sample.t) - 1
        closed = np.where(row >= 0, np.isin(own[row, 2], (Transition.TOUCH, Transition.REENTRY)), u[0] > 0.0)
        wrong += int(np.count_nonzero(closed != in_contact(contact, u, d)))
    kinds = np.isin(table[:, 2], (Transition.TOUCH, Transition.RELEASE))
    return {"(9)": float(accepted), "(10)": float(wrong), AT_EVENTS: float(np.abs(table[kinds, 3]).max())}


def form_equations(sample: Sample) -> dict[str, float]:
    """(11) to (15)."""
    y, parts = sample.state, lyapunov.parts(sample.system, sample.state)
    P = np.array([by_hand.matrix(sample.scene, each) for each in y])
    squared = np.einsum("ni,nij,nj->n", y, P, y)
    moving = [x for x in (X.L, X.O, X.R) if y[:, x + 1].any()]  # the object of a symmetric case rests
    found = {"(11)": relative(sample.level.V, squared), "(12)": relative(np.sum(parts, axis=0), squared),
             "(13)": max(relative(sample.rate[:, x], y[:, x + 1]) for x in moving)}
    for number, x, stored, side in (("(14)", X.L, parts.contact_l, LEFT), ("(15)", X.R, parts.contact_r, RIGHT)):
        if stored.max() > 0.0:
            found[number] = relative(-P[:, x, X.O] * sample.pair(side)[0] ** 2, stored)
    return found


def equations(cases: Cases) -> list[Equation]:
    """All rows, from the eleven cases, and from scenes in which a pair separates faster than 1/p, as no case does."""
    return rows_of([Sample(scene) for scene in (*cases.values(), *map(scenes.load, CROSSING))])


def rows_of(samples: list[Sample]) -> list[Equation]:
    """All rows, each with the worst number of the motions that show it."""
    found = [{**motion_equations(each), **force_equations(each), **contact_equations(each), **form_equations(each),
              **condition_rows(each)} for each in samples]
    found.append({**positive(samples[0].system), **constant(samples)})
    return [row._replace(number=key.split()[0], found=(min if row.margin else max)(
        own[key] for own in found if key in own)) for key, row in EQUATIONS.items()]

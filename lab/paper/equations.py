"""Equations (1) to (37): the function that states each, and a number that shows how well the motion agrees with it.

Accelerations are differentiated from the dense output of the integrator, which shares no line with the functions of
`physics` that state the equations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics import lyapunov
from grasp_ros.physics.layout import LEFT, RIGHT, Transition, X
from grasp_ros.physics.model import acceleration, impact_force, in_contact, penetration
from grasp_ros.scene import SceneError
from lab.paper import by_hand, quadratic_form
from lab.paper.cases import Cases, with_values
from lab.paper.conditions import condition_rows
from lab.paper.sample import ALGEBRA, Equation, Sample, relative

CROSSING = ("v_jump_one_sided", "v_jump_symmetric")  # scenes that cross the second surface of (10) with u > 0


def motion_equations(samples: list[Sample]) -> list[Equation]:
    """(1) to (3)."""
    worst = np.zeros(3)
    for sample in samples:
        stated = acceleration(sample.grasp, sample.state)
        for row, (column, right) in enumerate(zip((1, 3, 5), stated, strict=True)):
            if np.abs(right).max() > 1e-9:  # the object of a symmetric case does not move
                worst[row] = max(worst[row], relative(sample.rate[:, column], right))
    says = "motion of the left arm", "motion of the right arm", "motion of the object"
    order = (0, 2, 1)
    return [
        Equation(
            f"({number})",
            text,
            "physics.model.acceleration",
            "differentiated velocity against the printed right-hand side, relative",
            float(worst[row]),
            1e-8,
        )
        for number, (text, row) in enumerate(zip(says, order, strict=True), start=1)
    ]


def force_equations(samples: list[Sample]) -> list[Equation]:
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
    law = "impact force from the motion of the arm against the law, relative to the largest"
    return [
        *(
            Equation(
                f"({4 + side})",
                f"input of the {name} arm",
                "physics.system.System.feedback",
                "command against -Kp x - Kv x', N",
                float(inputs[side]),
                1e-14,
                by=ALGEBRA,
            )
            for side, name in enumerate(("left", "right"))
        ),
        *(
            Equation(
                f"({6 + side})", f"{name} impact force", "physics.model.impact_force", law, float(impacts[side]), 1e-7
            )
            for side, name in enumerate(("left", "right"))
        ),
        Equation(
            "(8)",
            "deformations and their rates",
            "physics.model.penetration",
            "u differentiated against u', m/s",
            gap,
            1e-9,
        ),
    ]


def condition_equations(samples: list[Sample]) -> list[Equation]:
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
    return [
        Equation(
            "(9)",
            "p and H are not negative",
            "scene.effects.contact.PARAMETERS",
            "negative H, p that a scene accepts, of 2",
            2.0 - refused,
            0.0,
            by=ALGEBRA,
        ),
        Equation(
            "(10)",
            "contact and noncontact",
            "physics.model.in_contact",
            "places where the condition and the located events disagree",
            float(wrong),
            0.0,
        ),
        Equation(
            "(10)", "touch and release at u = 0", "exact.automaton.modes.make_transition", "largest |u| at an event, m",
            at_events, 1e-15,
        ),
    ]


def form_equations(samples: list[Sample]) -> list[Equation]:
    """(11) to (15)."""
    form, order, stiffness, entries = 0.0, 0.0, np.zeros(2), 0.0
    for sample in samples:
        y = sample.state
        P = quadratic_form.matrix(sample.system, y)
        written = np.array([by_hand.matrix(sample.scene, each) for each in y])
        entries = max(entries, float(np.abs(P - written).max() / np.abs(written).max()))
        squared = np.einsum("ni,nij,nj->n", y, written, y)
        form = max(form, relative(squared, sample.level.V))
        form = max(form, relative(quadratic_form.quadratic_form(sample.system, y), squared))
        moving = [x for x in (X.L, X.O, X.R) if y[:, x + 1].any()]  # the object of a symmetric case rests
        order = max(order, *(relative(sample.rate[:, x], y[:, x + 1]) for x in moving))
        for side, stored in enumerate(lyapunov.parts(sample.system, y)[3:]):
            if stored.max() > 0.0:
                x = 0 if side == LEFT else 4
                stiffness[side] = max(stiffness[side], relative(-P[:, x, 2] * sample.pair(side)[0] ** 2, stored))
    return [
        Equation(
            "(11)", "V = x' P(x) x", "lab.paper.quadratic_form.quadratic_form",
            "x' P x, with P by hand and without, against V, relative", form, 1e-13, by=ALGEBRA,
        ),
        Equation(
            "(12)", "P(x)", "lab.paper.quadratic_form.matrix", "its 36 entries against (12) by hand, relative", entries,
            1e-15, by=ALGEBRA,
        ),
        Equation(
            "(13)",
            "order of the state",
            "physics.layout.X_L, V_L, X_O, V_O, X_R, V_R",
            "x_l, x_o, x_r differentiated against the columns behind them, relative",
            order,
            1e-9,
        ),
        *(
            Equation(
                f"({14 + side})",
                f"Delta k of the {name} contact",
                "lab.paper.quadratic_form.contact_stiffness",
                "Delta k u^2 against the elastic part of V, relative",
                float(stiffness[side]),
                1e-12,
                by=ALGEBRA,
            )
            for side, name in enumerate(("left", "right"))
        ),
    ]


def equations(cases: Cases) -> list[Equation]:
    """All rows, from the eleven cases, and from scenes in which a pair separates faster than 1/p, as no case does."""
    return rows_of([Sample(scene) for scene in (*cases.values(), *map(scenes.load, CROSSING))])


def rows_of(samples: list[Sample]) -> list[Equation]:
    """All rows, from some motions."""
    blocks: tuple[Callable[[list[Sample]], list[Equation]], ...] = (
        motion_equations,
        force_equations,
        condition_equations,
        form_equations,
        condition_rows,
    )
    return [row for block in blocks for row in block(samples)]

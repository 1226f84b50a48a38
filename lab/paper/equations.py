"""Equations (1) to (37): a number for each that shows how well the motion agrees with it.

Accelerations are differentiated from the dense output of the integrator, which shares no line with the functions of
`physics` that state the equations.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from grasp_ros import scene as scenes
from grasp_ros.physics import lyapunov
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Transition, V, X
from grasp_ros.physics.lyapunov import reach
from grasp_ros.physics.model import Array, Mode, impact_force, in_contact, penetration
from grasp_ros.physics.system import System
from grasp_ros.scene import SceneError
from lab.paper import by_hand
from lab.paper.cases import Cases, with_values
from lab.paper.equation_table import AT_EVENTS, DRAWS, EQUATIONS, Equation
from lab.paper.sample import Sample, relative
from lab.reference.grasp import acceleration

CROSSING = ("v_jump_one_sided", "v_jump_symmetric")  # scenes that cross the clamp surface of (10) with u > 0
POSITIVE = {Mode.BOTH: "(17)", Mode.LEFT: "(22)", Mode.RIGHT: "(26)"}  # V > 0, by the condition of contact


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


def condition_rows(sample: Sample) -> dict[str, float]:
    """(16), (18), (20) and so on, as far as one motion shows them."""
    return {
        **_condition(sample, Mode.BOTH, "(16)", "(18)", "(20)"),
        **_condition(sample, Mode.LEFT, "(21)", "(23)", "(25)"),
        **_condition(sample, Mode.RIGHT, "", "", "(27)"), **_flight(sample), **_enclosure(sample),
    }


def _condition(sample: Sample, mode: Mode, value: str, rate: str, sign: str) -> dict[str, float]:
    """V, its rate and the sign of its rate in one condition of contact; an empty number is not printed."""
    here = sample.where(mode)
    if not here.any():
        return {}
    states, level = sample.state[here], sample.level
    written = np.array([by_hand.level(sample.scene, state) for state in states])
    stated = np.array([by_hand.rate(sample.scene, state) for state in states])
    levels, rates = (level.V[here], sum(lyapunov.parts(sample.system, states))), (sample.V_rate, level.V_rate)
    return {
        value: max(float(np.abs(own / written - 1.0).max()) for own in levels),
        rate: max(float(np.abs(own[here] - stated).max()) for own in rates) / sample.fastest,
        sign: float(level.V_rate[here].max()),
    }


def positive(system: System) -> dict[str, float]:
    """(17), (22), (26): smallest V over the square of the state; (30), (33): of V_l and V_o; of random states."""
    rng = np.random.default_rng(1990)
    size = 10.0 ** rng.uniform(-3.0, 0.0, (DRAWS, 1))
    states: Array = size * rng.normal(size=(DRAWS, 6))
    level, square = energy(system, states), (states**2).sum(axis=1)
    found = {number: float((level.V / square)[level.mode == int(mode)].min()) for mode, number in POSITIVE.items()}
    states = np.random.default_rng(1990).normal(size=(DRAWS, 6))
    parts = lyapunov.parts(system, states)
    found["(30)"] = float((parts.V_l / (states[:, :2] ** 2).sum(axis=1)).min())
    found["(33)"] = float((parts.V_o / states[:, V.O] ** 2).min())
    return found


def constant(samples: list[Sample]) -> dict[str, float]:
    """(19), (24): the a that makes V' a sum of losses, fitted to V' + 2 C v^2 + ... = ((5/2) a - 2) H u^(3/2) u'."""
    above, below = 0.0, 0.0
    for sample in samples:
        if sample.crosses:  # the differences are too coarse for these digits
            continue
        without = sample.V_rate - sample.level.V_rate  # what a = 4/5 leaves
        for side in (LEFT, RIGHT):
            u, d = sample.pair(side)
            alone = sample.where(Mode.LEFT if side == LEFT else Mode.RIGHT)
            slope = 2.5 * sample.system.pairs[side, 0] * np.maximum(u, 0.0)[alone] ** 1.5 * d[alone]
            above, below = above + float(slope @ without[alone]), below + float(slope @ slope)
    return dict.fromkeys(("(19)", "(24)"), abs(above / below))


def _flight(sample: Sample) -> dict[str, float]:
    """(28), (29), (31), (32) and (34)."""
    here = sample.where(Mode.NONE)
    states = sample.state[here]
    written = np.array([by_hand.parts(sample.scene, state) for state in states])
    whole = written.sum(axis=1)
    own = np.column_stack(lyapunov.parts(sample.system, states)[:3])
    found = {"(28)": float(np.abs(sample.level.V[here] / whole - 1.0).max()),
             "(29)": float((np.abs(own - written) / np.maximum(whole, 1e-300)[:, None]).max())}
    stencils, damping = lyapunov.parts(sample.system, sample.stencils[here]), sample.system.closed_loop[:, 2]
    for number, part, body, column in (("(31)", stencils.V_l, LEFT, V.L), ("(32)", stencils.V_r, RIGHT, V.R),
                                       ("(34)", stencils.V_o, OBJECT, V.O)):
        off = np.abs(sample.differentiated(part) + 2.0 * damping[body] * states[:, column] ** 2)
        found[number] = float(off.max()) / sample.fastest
    return found


def _enclosure(sample: Sample) -> dict[str, float]:
    """(35) to (37)."""
    run = sample.run
    allowed = np.array(reach(sample.system.closed_loop, sample.system.pairs, float(run.energy.V_c[0]))[3:])
    left, right = (allowed / run.epsilon[-1] - 1.0).tolist()
    x_l, x_o, x_r = run.state[:, 0::2].T
    return {"(35)": left, "(36)": right,
            "(37)": min(float((x_o - x_l + allowed[LEFT]).min()), float((x_r + allowed[RIGHT] - x_o).min()))}


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

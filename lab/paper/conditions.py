"""Equations (16) to (37): V in the four conditions of contact, its rate, its parts, and the position of the object."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics import lyapunov
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, V
from grasp_ros.physics.lyapunov import reach
from grasp_ros.physics.model import Array, Mode
from grasp_ros.physics.system import System
from lab.paper import by_hand
from lab.paper.equation_table import DRAWS
from lab.paper.sample import Sample

POSITIVE = {Mode.BOTH: "(17)", Mode.LEFT: "(22)", Mode.RIGHT: "(26)"}  # V > 0, by the condition of contact


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

"""Equations (16) to (37): V in the four conditions of contact, its rate, its parts, and the place of the object."""

from __future__ import annotations

import numpy as np

from grasp_ros.physics import lyapunov
from grasp_ros.physics.energy import energy
from grasp_ros.physics.layout import LEFT, RIGHT
from grasp_ros.physics.lyapunov import reach
from grasp_ros.physics.model import Array, Mode
from lab.paper import by_hand
from lab.paper.equation_table import DRAWS
from lab.paper.sample import Sample


def condition_rows(samples: list[Sample]) -> dict[str, float]:
    """(16) to (37)."""
    constant = _constant(samples)
    return {
        **_condition(samples, Mode.BOTH, ("(16)", "(17)", "(18)", "(20)")), "(19)": constant,
        **_condition(samples, Mode.LEFT, ("(21)", "(22)", "(23)", "(25)")), "(24)": constant,
        **_condition(samples, Mode.RIGHT, ("", "(26)", "", "(27)")), **_flight(samples), **_enclosure(samples),
    }


def _condition(samples: list[Sample], mode: Mode, numbers: tuple[str, ...]) -> dict[str, float]:
    """V, its sign, its rate and the sign of its rate in one condition of contact; an empty number is not printed."""
    value, rate, highest = 0.0, 0.0, -np.inf
    for sample in samples:
        here = sample.where(mode)
        if here.any():
            states = sample.state[here]
            written = np.array([by_hand.level(sample.scene, state) for state in states])
            value = max(value, float(np.abs(sample.level.V[here] / written - 1.0).max()))
            value = max(value, float(np.abs(sum(lyapunov.parts(sample.system, states)) / written - 1.0).max()))
            stated = np.array([by_hand.rate(sample.scene, state) for state in states])
            scale = float(np.abs(sample.level.V_rate).max()) or 1.0
            rate = max(rate, float(np.abs(sample.V_rate[here] - stated).max()) / scale)
            rate = max(rate, float(np.abs(sample.level.V_rate[here] - stated).max()) / scale)
            highest = max(highest, float(sample.level.V_rate[here].max()))
    found = zip(numbers, (value, _smallest(samples[0], mode), rate, highest), strict=True)
    return {number: each for number, each in found if number}


def _smallest(sample: Sample, mode: Mode) -> float:
    """Smallest V over the square of the state, of random states in a condition of contact."""
    rng = np.random.default_rng(1990)
    size = 10.0 ** rng.uniform(-3.0, 0.0, (DRAWS, 1))
    states: Array = size * rng.normal(size=(DRAWS, 6))
    level = energy(sample.system, states)
    here = level.mode == int(mode)
    return float((level.V[here] / (states[here] ** 2).sum(axis=1)).min())


def _constant(samples: list[Sample]) -> float:
    """The a that makes V' a sum of losses, from the motion: V' + 2 C v^2 + ... = ((5/2) a - 2) H u^(3/2) u'."""
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
    return abs(above / below)


def _flight(samples: list[Sample]) -> dict[str, float]:
    """(28) to (34)."""
    total, rates, apart = 0.0, np.zeros(3), 0.0
    for sample in samples:
        here = sample.where(Mode.NONE)
        parts = lyapunov.parts(sample.system, sample.state[here])
        written = np.array([by_hand.parts(sample.scene, state) for state in sample.state[here]])
        total = max(total, float(np.abs(sample.level.V[here] / written.sum(axis=1) - 1.0).max()))
        own = np.column_stack(parts[:3])
        apart = max(apart, float((np.abs(own - written) / np.maximum(written.sum(axis=1), 1e-300)[:, None]).max()))
        stencils = lyapunov.parts(sample.system, sample.stencils[here])
        scale = float(np.abs(sample.level.V_rate).max()) or 1.0
        damping = sample.system.closed_loop[:, 2]
        for row, (part, body, column) in enumerate(((stencils.V_l, 0, 1), (stencils.V_r, 1, 5), (stencils.V_o, 2, 3))):
            stated = -2.0 * damping[body] * sample.state[here, column] ** 2
            rates[row] = max(rates[row], float(np.abs(sample.differentiated(part) - stated).max()) / scale)
    left, right, thing = rates.tolist()
    return {"(28)": total, "(29)": apart, "(30)": _smallest_part(samples[0], 0), "(31)": left, "(32)": right,
            "(33)": _smallest_part(samples[0], 1), "(34)": thing}


def _smallest_part(sample: Sample, part: int) -> float:
    """Smallest V_l over x_l^2 + x_l'^2, or V_o over x_o'^2, of random states."""
    states = np.random.default_rng(1990).normal(size=(DRAWS, 6))
    columns = (0, 1) if part == 0 else (3,)
    found = lyapunov.parts(sample.system, states)[part]
    return float((found / (states[:, columns] ** 2).sum(axis=1)).min())


def _enclosure(samples: list[Sample]) -> dict[str, float]:
    """(35) to (37)."""
    bound, margin = np.full(2, np.inf), np.inf
    for sample in samples:
        run = sample.run
        epsilon = run.epsilon[-1]
        allowed = np.array(reach(sample.system.closed_loop, sample.system.pairs, float(run.energy.V_c[0]))[3:])
        bound = np.minimum(bound, allowed / epsilon)
        x_l, x_o, x_r = run.state[:, 0], run.state[:, 2], run.state[:, 4]
        margin = min(margin, float((x_o - x_l + allowed[LEFT]).min()), float((x_r + allowed[RIGHT] - x_o).min()))
    return {"(35)": float(bound[LEFT]) - 1.0, "(36)": float(bound[RIGHT]) - 1.0, "(37)": margin}

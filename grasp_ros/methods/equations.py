"""What the methods that step in time share: the compiled right-hand side, the frozen modes, and their counters."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np

from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.impact import damping_factor, elastic_force
from grasp_ros.methods.contract import Problem
from grasp_ros.physics.layout import LEFT, OBJECT, RIGHT, Of, Outcome, Pair, Transition
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import System

MAX_IDLE = 100  # events without progress in time
PIECE = 2**16  # steps: some milliseconds
SLIVER = 1e-9  # of a step: what rounding may leave at the end of the horizon


class Work(IntEnum):
    """Columns of the work counters of a method that steps in time."""

    STEPS = 0  # steps, and parts of steps between events
    RIGHT_HAND_SIDES = 1
    EVENT_EVALUATIONS = 2  # trial steps or interpolants that look for an event
    IMPLICIT_ITERATIONS = 3  # Newton iterations, or factorised Jacobians


def parameters(system: System) -> Array:
    """m, K, C, H, p of the left and of the right side, then m_o, shape (11,), SI; the feedback is in K and C.

    Forces and friction are not in it: the paper's grasp has none.
    """
    bodies, pairs = system.closed_loop, system.pairs
    sides = [part for side in (LEFT, RIGHT) for part in (bodies[side, :Of.FORCE], pairs[side])]
    return np.concatenate([*sides, bodies[OBJECT, [Of.MASS]]])


def begun(problem: Problem) -> tuple[Array, Any, Array, Any]:
    """What a run with a fixed step begins with: parameters, state, room for the output states, and counters at 0."""
    state, out = problem.system.state.tolist(), np.empty((len(problem.grid), 6))
    return parameters(problem.system), tuple(state), out, np.zeros(len(Work), dtype=np.int64)


def in_pieces(problem: Problem, begin: Any, run: Callable[[Any, int], tuple[int, Any]]) -> tuple[int, Any]:
    """The outcome of a run with a fixed step, and what it reached: some steps at a time, to say how far it is.

    `run` goes on from what is reached, the time in s first, up to a step.
    """
    outcome, reached = run(begin, last := PIECE)
    while outcome == Outcome.GO_ON:
        if problem.progress is not None:
            problem.progress(reached[0])
        outcome, reached = run(reached, last := last + PIECE)
    return outcome, reached


@kernel
def rates(q: Any, push_l: bool, push_r: bool, y: Any) -> Any:
    """Time derivative of y = (x_l, v_l, x_o, v_o, x_r, v_r): (1) to (8); a side that may not push is frozen open."""
    x_l, v_l, x_o, v_o, x_r, v_r = y
    f_l, f_r = 0.0, 0.0
    if push_l:
        u = max(x_l - x_o, 0.0)
        f_l = elastic_force(q[3], u) * max(damping_factor(q[4], v_l - v_o), 0.0)
    if push_r:
        u = max(x_o - x_r, 0.0)
        f_r = elastic_force(q[8], u) * max(damping_factor(q[9], v_o - v_r), 0.0)
    a_l = (-q[1] * x_l - q[2] * v_l - f_l) / q[0]
    a_r = (-q[6] * x_r - q[7] * v_r + f_r) / q[5]
    return v_l, a_l, v_o, (f_l - f_r) / q[10], v_r, a_r


@kernel
def relative(y: Any, side: int) -> Any:
    """u and u' of one pair, (8)."""
    if side == LEFT:
        return y[0] - y[2], y[1] - y[3]
    return y[2] - y[4], y[3] - y[5]


@kernel
def condition(q: Any, y: Any, side: int) -> Pair:
    """Mode of one pair by (10): OPEN, CONTACT, or CLAMPED (u >= 0 and u' < -1/p)."""
    u, d = relative(y, side)
    if not u >= 0.0:
        return Pair.OPEN
    return Pair.CONTACT if damping_factor(q[4 + 5 * side], d) >= 0.0 else Pair.CLAMPED


@kernel
def kind_of(before: int, after: int) -> Transition:
    """Event between two modes of one pair."""
    if after == Pair.OPEN:
        return Transition.RELEASE
    if before == Pair.OPEN:
        return Transition.TOUCH
    return Transition.CLAMP if after == Pair.CLAMPED else Transition.REENTRY

"""What `speed` measures: a method, its settings and its answer; and the methods of scipy.

scipy gets a compiled right-hand side, either with a restart at every touch and release or without. No peer knows
condition (10)'s second surface u' = -1/p as an event: it would only cost time in the scenes that are measured, and
`speed` refuses the others.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from grasp_ros.physics.jit import kernel
from grasp_ros.physics.layout import LEFT, RIGHT, V_L, V_O, V_R, X_L, X_O, X_R
from grasp_ros.physics.model import Array, Grasp
from grasp_ros.scene import Scene

TOGETHER_M = 1e-13  # a gap below this at the other side's touch is a touch of both
MAX_STEPS = 1_000_000


class Answer(NamedTuple):
    """What a solver delivers."""

    state: Array  # (n, 6), m and m/s; fewer rows than asked for if it failed
    touches: tuple[int, int] | None  # left and right; None: it does not look for them
    status: str


Solve = Callable[[Array], Answer]  # from the output times, of which the last is the horizon


class Method(NamedTuple):
    """A solver with the settings to try."""

    family: str
    name: str
    knob: str
    ladder: tuple[float, ...]  # loose to tight
    build: Callable[[float], Solve]  # raises ImportError if the solver is not installed


def scipy_methods(scene: Scene) -> list[Method]:
    """scipy's solvers over rtol = atol; odeint is LSODA again, with its loop over the steps compiled."""
    ladder = (*(10.0**-k for k in range(7, 14)), 3e-14)  # solve_ivp refuses less than 2.2e-14
    methods = []
    for name in ("LSODA", "DOP853", "RK45", "Radau"):
        for text, build in (("events", _restarted), ("no events", _straight)):
            methods.append(Method("scipy solve_ivp", f"{name}, {text}", "rtol", ladder, partial(build, scene, name)))
    return [*methods, Method("scipy odeint", "odeint, no events", "rtol", ladder, partial(_odeint, scene))]


def other_side_touches(y: Array, side: int) -> bool:
    """Whether the other side touches with this one: equal arms at rest reach the object at the same instant."""
    if side == LEFT:
        return bool(abs(y[X_O] - y[X_R]) < TOGETHER_M and y[V_O] > y[V_R])
    return bool(abs(y[X_L] - y[X_O]) < TOGETHER_M and y[V_L] > y[V_O])


@kernel
def _rates(t: float, y: Any, left: Any, right: Any, object_mass: float) -> Any:
    """Equations (1) to (8); rows left and right hold m, K, C, H, p and whether the pair may push."""
    u_l, d_l, u_r, d_r = y[0] - y[2], y[1] - y[3], y[2] - y[4], y[3] - y[5]
    f_l = left[5] * left[3] * max(u_l, 0.0) ** 1.5 * max(1.0 + left[4] * d_l, 0.0)
    f_r = right[5] * right[3] * max(u_r, 0.0) ** 1.5 * max(1.0 + right[4] * d_r, 0.0)
    rates = np.empty(6)
    rates[0], rates[2], rates[4] = y[1], y[3], y[5]
    rates[1] = (-left[1] * y[0] - left[2] * y[1] - f_l) / left[0]
    rates[3] = (f_l - f_r) / object_mass
    rates[5] = (-right[1] * y[4] - right[2] * y[5] + f_r) / right[0]
    return rates


def _parameters(grasp: Grasp) -> tuple[Array, Array, float]:
    rows = [
        np.array([arm.mass, arm.stiffness + arm.position_gain, arm.damping + arm.velocity_gain, *contact, 1.0])
        for arm, contact in ((grasp.left, grasp.left_contact), (grasp.right, grasp.right_contact))
    ]
    return rows[LEFT], rows[RIGHT], grasp.object_mass


def _gap(front: int, back: int, direction: float) -> Any:
    """Terminal event of scipy at y[front] = y[back]."""
    def gap(t: float, y: Array, *_: Any) -> float:
        return float(y[front] - y[back])

    gap.terminal, gap.direction = True, direction  # type: ignore[attr-defined]
    return gap


def _restarted(scene: Scene, name: str, tolerance: float) -> Solve:
    """solve_ivp from event to event; the mode is frozen between them."""
    from scipy.integrate import solve_ivp

    events = [[_gap(X_L, X_O, 1.0), _gap(X_L, X_O, -1.0)], [_gap(X_O, X_R, 1.0), _gap(X_O, X_R, -1.0)]]

    def solve(grid: Array) -> Answer:
        left, right, object_mass = _parameters(scene.grasp)
        touching, touches, rows, row, t, y = [0, 0], [0, 0], [], 0, 0.0, scene.initial_state
        while True:
            left[5], right[5] = touching
            result = solve_ivp(
                _rates, (t, grid[-1]), y, name, grid[row:], events=[events[side][touching[side]] for side in (0, 1)],
                args=(left, right, object_mass), rtol=tolerance, atol=tolerance,
            )
            rows.append(np.reshape(result.y, (6, -1)).T)
            row += len(rows[-1])
            if result.status != 1:
                status = "done" if result.status == 0 else result.message
                return Answer(np.concatenate(rows), (touches[LEFT], touches[RIGHT]), status)
            side = LEFT if len(result.t_events[LEFT]) else RIGHT
            t, y = result.t_events[side][0], result.y_events[side][0]
            both = touching == [0, 0] and other_side_touches(y, side)
            for changed in (LEFT, RIGHT) if both else (side,):
                touching[changed] ^= 1
                touches[changed] += touching[changed]

    return solve


def _straight(scene: Scene, name: str, tolerance: float) -> Solve:
    """solve_ivp over everything, with the switches inside the right-hand side."""
    from scipy.integrate import solve_ivp

    def solve(grid: Array) -> Answer:
        result = solve_ivp(
            _rates, (0.0, grid[-1]), scene.initial_state, name, grid, args=_parameters(scene.grasp), rtol=tolerance,
            atol=tolerance,
        )
        return Answer(result.y.T, None, "done" if result.status == 0 else result.message)

    return solve


def _odeint(scene: Scene, tolerance: float) -> Solve:
    """LSODA over everything, with its loop over the steps outside Python."""
    from scipy.integrate import odeint

    def solve(grid: Array) -> Answer:
        times = grid if grid[0] == 0.0 else np.concatenate([[0.0], grid])
        states, report = odeint(
            _rates, scene.initial_state, times, _parameters(scene.grasp), rtol=tolerance, atol=tolerance, tfirst=True,
            mxstep=MAX_STEPS, full_output=True,
        )
        done = report["message"] == "Integration successful."
        return Answer(states[-len(grid) :], None, "done" if done else report["message"])

    return solve

"""SUNDIALS' CVODE on the grasp, by scikit-sundae: the C solver, a compiled right-hand side, events or none.

Adams' formulas (order 1 to 12) suit these scenes better than BDF, which is there for the stiff ones. What was tried
and is not offered: an analytic Jacobian (no gain for Adams, whose iteration needs none), max_step.

No outside peer knows the clamp surface u' = -1/p as an event: it would only cost time in the scenes that are
measured. Tried and not available as a wheel for these Python versions: numbalsoda.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from grasp_ros.accuracy.measure import Answer, Contender, Solve
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.methods.equations import condition, parameters, rates
from grasp_ros.physics.layout import LEFT, RIGHT, Pair, V, X
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene

MAX_STEPS = 10_000_000
MAX_RESTARTS = 100_000
EVENT = 2  # status of scikit-sundae: stopped at an event
LADDER = tuple(10.0**-k for k in range(3, 15))
TOGETHER_M = 1e-13  # a gap below this at the other side's touch is a touch of both


def contenders() -> list[Contender]:
    """CVODE over rtol = atol."""
    return [
        Contender("SUNDIALS", f"cvode_{formula.lower()}{suffix}", "tolerance", LADDER, partial(build, formula))
        for formula in ("Adams", "BDF") for suffix, build in (("", _straight), ("_events", _restarted))
    ]


@kernel
def fill(t: float, y: Any, out: Any, settings: Any) -> None:
    """Right-hand side into `out`; settings are the parameters and what may push."""
    q, push_l, push_r = settings
    f = rates(q, push_l, push_r, (y[0], y[1], y[2], y[3], y[4], y[5]))
    out[0], out[1], out[2], out[3], out[4], out[5] = f


@kernel
def gaps(t: float, y: Any, out: Any, settings: Any) -> None:
    """Event functions: u of both sides."""
    out[0], out[1] = y[0] - y[2], y[2] - y[4]


def _solver(formula: str, settings: Any, tolerance: float, **options: Any) -> Any:
    from sksundae.cvode import CVODE

    return CVODE(
        fill, userdata=settings, method=formula, rtol=tolerance, atol=tolerance, max_num_steps=MAX_STEPS, **options
    )


def _straight(formula: str, scene: Scene, tolerance: float) -> Solve:
    """Over everything, with the events inside the right-hand side."""
    solver = _solver(formula, (parameters(scene.system), True, True), tolerance)

    def solve(grid: Array) -> Answer:
        times = np.unique(np.concatenate([[0.0, 0.5 * grid[-1]], grid]))  # two would ask for the solver's own steps
        result = solver.solve(times, scene.initial_state)
        status = "done" if result.success else result.message
        return Answer(result.y[np.isin(times[: len(result.y)], grid)], None, status, None, result.nfev)

    return solve


def _restarted(formula: str, scene: Scene, tolerance: float) -> Solve:
    """From touch to release to touch; the mode is frozen in between."""
    q = parameters(scene.system)
    solvers: dict[tuple[bool, bool], Any] = {}
    for mode in ((left, right) for left in (False, True) for right in (False, True)):
        def watch(t: float, y: Array, out: Array, settings: Any) -> None:
            gaps(t, y, out, settings)

        watch.direction = [-1 if pushing else 1 for pushing in mode]  # type: ignore[attr-defined]
        watch.terminal = [True, True]  # type: ignore[attr-defined]
        solvers[mode] = _solver(formula, (q, *mode), tolerance, eventsfn=watch, num_events=2)

    def solve(grid: Array) -> Answer:
        y, t, row, rhs, touches = scene.initial_state, 0.0, 0, 0, [0, 0]
        mode = [condition(q, tuple(y), side) == Pair.CONTACT for side in (LEFT, RIGHT)]
        out = np.empty((len(grid), 6))
        for _ in range(MAX_RESTARTS):
            while row < len(grid) and grid[row] <= t:
                out[row] = y
                row += 1
            if row == len(grid):
                return Answer(out, (touches[LEFT], touches[RIGHT]), "done", None, rhs)
            # Two times alone would ask for the solver's own steps, so that there is one between.
            times = np.concatenate([[t, 0.5 * (t + grid[row])], grid[row:]])
            result = solvers[mode[LEFT], mode[RIGHT]].solve(times, y)
            rhs += result.nfev
            stopped = result.status == EVENT  # the lists of events grow from call to call
            states = result.y[2 : len(result.y) - stopped]
            out[row : row + len(states)] = states
            row += len(states)
            if not stopped:
                status = "done" if result.success else result.message
                return Answer(out[:row], (touches[LEFT], touches[RIGHT]), status, None, rhs)
            side = LEFT if result.i_events[-1][LEFT] else RIGHT
            t, y = float(result.t_events[-1]), result.y_events[-1]
            both = mode == [False, False] and other_side_touches(y, side)
            for changed in (LEFT, RIGHT) if both else (side,):
                mode[changed] = not mode[changed]
                touches[changed] += mode[changed]
        return Answer(out[:row], (touches[LEFT], touches[RIGHT]), "stopped: events without end", None, rhs)

    return solve


def other_side_touches(y: Array, side: int) -> bool:
    """Whether the other side touches with this one: equal arms at rest reach the object at the same instant."""
    if side == LEFT:
        return bool(abs(y[X.O] - y[X.R]) < TOGETHER_M and y[V.O] > y[V.R])
    return bool(abs(y[X.L] - y[X.O]) < TOGETHER_M and y[V.L] > y[V.O])

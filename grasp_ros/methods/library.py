"""scipy's solvers on the grasp, with a compiled right-hand side: explicit pairs and implicit methods.

Two ways: (6), (7) and (10) are left to the right-hand side; or the mode is frozen, scipy finds the events of (10) as
terminal events, and starts afresh after each.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from grasp_ros.exact.compilation.jit import allocating
from grasp_ros.exact.impact import damping_factor, elastic_force, elastic_slope
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.equations import MAX_IDLE, Work, condition, kind_of, parameters, rates, relative
from grasp_ros.physics.layout import LEFT, RIGHT, Law, Pair
from grasp_ros.physics.model import Array
from grasp_ros.physics.system import PAIR_COLUMNS

TOGETHER = 1e-13  # m or m/s, or a part of the horizon; a gap below this at the other side's event is an event of both
AT_END, AT_EVENT = 0, 1  # where scipy says that it stopped; negative: it failed
IMPLICIT = ("Radau", "LSODA")  # solvers that take a Jacobian


@allocating
def slopes(t: float, y: Any, q: Any, push_l: bool, push_r: bool) -> Any:
    """Right-hand side as an array (6,)."""
    f = rates(q, push_l, push_r, (y[0], y[1], y[2], y[3], y[4], y[5]))
    return np.array(f)


@allocating
def jacobian(t: float, y: Any, q: Any, push_l: bool, push_r: bool) -> Any:
    """Derivative of `slopes` by y, shape (6, 6)."""
    j = np.zeros((6, 6))
    for side in range(2):
        m, K, C, H, p = q[5 * side : 5 * side + 5]
        x, v = 4 * side, 4 * side + 1
        sign = 1.0 if side == 0 else -1.0
        j[x, v], j[v, x], j[v, v] = 1.0, -K / m, -C / m
        u, d = sign * (y[x] - y[2]), sign * (y[v] - y[3])
        factor = damping_factor(p, d)
        if not (push_l if side == 0 else push_r) or u <= 0.0 or factor <= 0.0:
            continue
        by_u, by_d = elastic_slope(H, u) * factor, p * elastic_force(H, u)
        for column, slope in ((x, by_u), (v, by_d)):
            other = column - x + 2
            j[v, column] -= slope / m
            j[v, other] += slope / m
            j[3, column] += slope / q[10]
            j[3, other] -= slope / q[10]
    j[2, 3] = 1.0
    return j


def solve(name: str, located: bool, problem: Problem) -> Solution:
    """Integrate with one of scipy's solvers, rtol = atol: from event to event if they are located, or at one go."""
    q, work = parameters(problem.system), np.zeros(len(Work), dtype=np.int64)
    grid, index = np.unique(problem.grid, return_inverse=True)  # scipy refuses a time that comes twice
    t, y, row, idle, states = 0.0, problem.system.state, 0, 0, [np.empty((0, 6))]
    mode = [condition(q, tuple(y), side) if located else Pair.CONTACT for side in (LEFT, RIGHT)]
    gaps = [_gaps(side, problem.system.pairs[side, Law.DISSIPATION], work) for side in (LEFT, RIGHT) if located]
    events: list[tuple[float, ...]] = []
    status: Status | None = None
    while status is None:
        active = [gap for side, own in enumerate(gaps) for gap in own[mode[side]]]
        args = (q, mode[LEFT] == Pair.CONTACT, mode[RIGHT] == Pair.CONTACT)
        try:
            result = _integrate(name, (t, problem.duration), y, grid[row:], args, problem, active or None, work)
        except ValueError:  # of its search for an event: its interpolation has no zero where its steps have one
            status = Status.STALLED
            break
        states.append(np.reshape(result.y, (6, -1)).T)
        row += len(states[-1])
        if result.status != AT_EVENT or idle > MAX_IDLE:
            status = Status.DONE if result.status == AT_END else Status.STALLED
            break
        first = next(gap for gap, times in zip(active, result.t_events, strict=True) if len(times))
        at = result.t_events[active.index(first)][0]
        y = result.y_events[active.index(first)][0]
        idle = 0 if at - t > TOGETHER * problem.duration else idle + 1
        t = at
        f = slopes(t, y, *args)
        fired = [first, *(gap for gap in active if gap.side != first.side and gap.fires_too(y, f))]
        for gap in fired:
            events.append((t, gap.side, kind_of(mode[gap.side], gap.after), *relative(y, gap.side)))
            mode[gap.side] = gap.after
        f = slopes(t, y, q, mode[LEFT] == Pair.CONTACT, mode[RIGHT] == Pair.CONTACT)
        for following in (following for gap in fired for following in gaps[gap.side][gap.after]):
            following.begin = t if following.rate(f) < 0.0 else math.nan
        status = Status.EVENT_BUDGET if len(events) > problem.max_events else None
    found = np.concatenate(states)  # as far as it came, at distinct times
    found[grid[: len(found)] == 0.0] = problem.system.state  # which LSODA interpolates
    return Solution(found[index[index < len(found)]], np.array(events).reshape(-1, 5), work, status)


class _Gap:
    """Event function of scipy: u, or u' + 1/p, of one pair."""

    terminal = True

    def __init__(self, side: int, after: Pair, direction: float, p: float | None, work: Any) -> None:
        self.side, self.after, self.direction, self._work = side, after, direction, work
        self._front, self._back = (column + (p is not None) for column in PAIR_COLUMNS[side])
        self._offset = 0.0 if p is None else 1.0 / p
        self.begin = math.nan  # time in s of an event of its pair, with which it became active and moves off

    def __call__(self, t: float, y: Array, *_: Any) -> float:
        """Its value in m or m/s.

        Of the same zero again, in a step that comes back to it, scipy would make an event: so it lies before it.
        """
        self._work[Work.EVENT_EVALUATIONS] += 1
        value = float(y[self._front] - y[self._back] + self._offset)
        return -self.direction * TOGETHER if t == self.begin and value * self.direction >= 0.0 else value

    def rate(self, f: Array) -> float:
        """How fast it moves in its direction, for the slopes f of a state."""
        return float(self.direction * (f[self._front] - f[self._back]))

    def fires_too(self, y: Array, f: Array) -> bool:
        """Whether it fires with another one: equal arms at rest reach the object at the same instant.

        scipy would lose it: a function that is zero, or a rounding past it, where a step begins is no event.
        """
        return self.rate(f) > 0.0 and abs(self(math.nan, y)) < TOGETHER


def _gaps(side: int, p: float, work: Any) -> dict[int, list[_Gap]]:
    """The events that can end each mode of a pair."""
    release = _Gap(side, Pair.OPEN, -1.0, None, work)
    faster = [_Gap(side, Pair.CLAMPED, -1.0, p, work)] if p > 0.0 else []
    slower = [_Gap(side, Pair.CONTACT, 1.0, p, work)] if p > 0.0 else []
    touch = _Gap(side, Pair.CONTACT, 1.0, None, work)
    return {Pair.OPEN: [touch], Pair.CONTACT: [release, *faster], Pair.CLAMPED: [release, *slower]}


def _integrate(
    name: str, span: tuple[float, float], y: Array, grid: Array, args: tuple[Any, ...], problem: Problem,
    events: list[Any] | None, work: Any,
) -> Any:
    from scipy import integrate

    base: Any = getattr(integrate, name)

    class Counting(base):
        """scipy's solver, which counts its steps and says how far it is; no output depends on the other ones."""

        def step(self) -> Any:
            work[Work.STEPS] += 1
            message = super().step()
            if problem.progress is not None:
                problem.progress(float(self.t_old))  # an event may lie before its end
            return message

        def dense_output(self) -> Any:
            found = super().dense_output()  # of several times at once it rounds in another way
            return lambda t: found(t) if np.ndim(t) == 0 else np.stack([found(one) for one in t], axis=-1)

    options = {"jac": jacobian} if name in IMPLICIT else {}
    with warnings.catch_warnings():  # an integration that fails says so in its status
        warnings.simplefilter("ignore")
        result = integrate.solve_ivp(
            slopes, span, y, Counting, grid, events=events, args=args, rtol=problem.setting, atol=problem.setting,
            **options
        )
    work[Work.RIGHT_HAND_SIDES] += result.nfev
    work[Work.IMPLICIT_ITERATIONS] += result.nlu
    return result

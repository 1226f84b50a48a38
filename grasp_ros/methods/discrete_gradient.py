"""An energy-conserving method: the average vector field, which is a discrete gradient here.

With the mean velocity of a step the equations (1) to (3) become

    m (v1 - v0) / h = -K (x0 + x1) / 2 - C (v0 + v1) / 2 - F,    x1 - x0 = h (v0 + v1) / 2,
    F = (phi(u1) - phi(u0)) / (u1 - u0) * (1 + p (u1 - u0) / h),    phi(u) = (2/5) H u^(5/2), 0 without penetration.

Every potential is a function of one linear combination of the positions, so that its average gradient along the step
is this difference quotient. V_c then changes by the damping terms alone, to the last digit that Newton's method
leaves; with C = p = 0 it is constant for any step. The rest is only of order 2. No event is located, and none
needs to be: the quotient spans a touch, and conserves V_c through it.

References
----------
O. Gonzalez: Time Integration and Discrete Hamiltonian Systems. J. Nonlinear Sci. 6 (1996). E. Celledoni et al.:
Preserving energy resp. dissipation in numerical PDEs using the average vector field method. J. Comput. Phys. 231
(2012).
"""

import math
from typing import Any

import numpy as np

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.impact import energy_quotient
from grasp_ros.exact.integrator import Status
from grasp_ros.methods.contract import Problem, Solution
from grasp_ros.methods.equations import SLIVER, Work, begun, in_pieces
from grasp_ros.physics.layout import EPS, Outcome

MOST_ITERATIONS = 100


def solve(problem: Problem) -> Solution:
    """Integrate with a fixed step; outputs between the steps by the parabola that the method follows."""
    q, y, out, work = begun(problem)
    outcome, (_, _, _, rows) = in_pieces(problem, (0.0, y, 0, 0), lambda reached, last: run(
        q, problem.duration, problem.setting, problem.grid, out, work, reached, last))
    return Solution(out[:rows], np.empty((0, 5)), work, Status[Outcome(outcome).name])


@inlined
def mean_force(hertzian: float, loss: float, u0: float, u1: float, h: float) -> Any:
    """F of the step and its derivative by u1."""
    elastic, slope = energy_quotient(u0, u1)
    factor = 1.0 + loss * (u1 - u0) / h
    if not factor > 0.0:
        return 0.0, 0.0
    return hertzian * elastic * factor, hertzian * (slope * factor + elastic * loss / h)


@inlined
def forces(q: Any, h: float, u_l: float, u_r: float, free_l: float, free_r: float, give: Any, work: Any) -> Any:
    """Mean impact forces of a step by Newton's method for the penetrations at its end; nan if it does not converge.

    `u_l`, `u_r` are those at the beginning in m, `free_l`, `free_r` those at the end if nothing pushed; `give` in m/N
    is by how much a unit of the left force, of the right force and of the other side's force moves them.
    """
    f_l, slope_l = mean_force(q[3], q[4], u_l, free_l, h)
    f_r, slope_r = mean_force(q[8], q[9], u_r, free_r, h)
    if f_l == 0.0 and f_r == 0.0:
        return 0.0, 0.0
    end_l, end_r = free_l, free_r
    last = math.inf
    for _ in range(MOST_ITERATIONS):
        work[Work.IMPLICIT_ITERATIONS] += 1
        rest_l = end_l - free_l + give[0] * f_l - give[2] * f_r
        rest_r = end_r - free_r + give[1] * f_r - give[2] * f_l
        a, b = 1.0 + give[0] * slope_l, -give[2] * slope_r
        c, d = -give[2] * slope_l, 1.0 + give[1] * slope_r
        move_l = (rest_l * d - rest_r * b) / (a * d - b * c)
        move_r = (rest_r * a - rest_l * c) / (a * d - b * c)
        end_l -= move_l
        end_r -= move_r
        f_l, slope_l = mean_force(q[3], q[4], u_l, end_l, h)
        f_r, slope_r = mean_force(q[8], q[9], u_r, end_r, h)
        move = abs(move_l) + abs(move_r)
        size = abs(end_l) + abs(u_l) + abs(end_r) + abs(u_r)
        if move <= EPS * size or (move >= last and move <= 64.0 * EPS * size):
            return f_l, f_r
        last = move
    return math.nan, math.nan


@inlined
def advance(q: Any, y: Any, h: float, work: Any) -> Any:
    """One step.

    It is solved for half the change of each velocity: a rounding of its factor is then a rounding of a mass. Solved for
    the mean velocity, the same rounding would be a damper, and the energy would drift.
    """
    x_l, v_l, x_o, v_o, x_r, v_r = y
    yield_l = 1.0 / (2.0 * q[0] / h + 0.5 * q[1] * h + q[2])
    yield_r = 1.0 / (2.0 * q[5] / h + 0.5 * q[6] * h + q[7])
    yield_o = 0.5 * h / q[10]
    pull_l = -q[1] * (x_l + 0.5 * h * v_l) - q[2] * v_l
    pull_r = -q[6] * (x_r + 0.5 * h * v_r) - q[7] * v_r
    u_l, u_r = x_l - x_o, x_o - x_r
    give = (h * (yield_l + yield_o), h * (yield_r + yield_o), h * yield_o)
    free_l, free_r = u_l + h * (v_l + yield_l * pull_l - v_o), u_r + h * (v_o - v_r - yield_r * pull_r)
    f_l, f_r = forces(q, h, u_l, u_r, free_l, free_r, give, work)
    half_l, half_o, half_r = yield_l * (pull_l - f_l), yield_o * (f_l - f_r), yield_r * (pull_r + f_r)
    return (
        x_l + h * (v_l + half_l), v_l + 2.0 * half_l, x_o + h * (v_o + half_o), v_o + 2.0 * half_o,
        x_r + h * (v_r + half_r), v_r + 2.0 * half_r,
    )


@inlined
def within(y: Any, z: Any, h: float, part: float) -> Any:
    """State inside a step: linear velocities, and positions that agree with them."""
    a, b, c = y[1] + part * (z[1] - y[1]), y[3] + part * (z[3] - y[3]), y[5] + part * (z[5] - y[5])
    half = 0.5 * part * h
    return y[0] + half * (y[1] + a), a, y[2] + half * (y[3] + b), b, y[4] + half * (y[5] + c), c


@kernel
def run(q: Any, duration: float, step: float, grid: Any, out: Any, work: Any, reached: Any, last: int) -> Any:
    """The steps up to the last of a piece; returns the outcome, and the time, the state, the steps and rows done."""
    t, y, number, row = reached
    while row < grid.shape[0] and grid[row] <= 0.0:
        out[row] = y
        row += 1
    while t < duration:
        if number == last:
            return Outcome.GO_ON.value, (t, y, number, row)
        number += 1
        end = min(number * step, duration)
        if duration - end < SLIVER * step:
            end = duration
        # Equal steps conserve better than number * step - t, whose rounding differs from step to step.
        h = end - t if end == duration else step
        z = advance(q, y, h, work)
        work[Work.STEPS] += 1
        total = z[0] + z[1] + z[2] + z[3] + z[4] + z[5]
        if not math.isfinite(total):
            return (Outcome.STALLED if math.isnan(total) else Outcome.NOT_FINITE).value, (t, y, number, row)
        while row < grid.shape[0] and grid[row] <= end:
            out[row] = within(y, z, h, (grid[row] - t) / (end - t))
            row += 1
        y, t = z, end
    return Outcome.DONE.value, (t, y, number, row)

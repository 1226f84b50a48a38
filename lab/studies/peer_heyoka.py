"""heyoka at its best on the grasp: flights in time, contacts in the regularised variables of `exact.contact.series`.

heyoka is an adaptive Taylor integrator compiled by LLVM. Each contact mode has an integrator of its own, with the
terminal events that end the mode. Where no output falls within a mode, heyoka's own loop runs through it; otherwise
the Taylor series of each step is the dense output. heyoka's continuous output does the same, but compiles code each
time (0.9 ms a contact), and its `propagate_grid` cannot invert the time of a contact. A release of both sides at one
instant is not handled: w_l w_r = 0 stops the regularised time, and the attempt is reported as stopped.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from grasp_ros.accuracy.measure import Answer, Contender
from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.physics.layout import LEFT, RIGHT, X
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from lab.reference.grasp import Grasp, grasp_of
from lab.studies.peer_sundials import other_side_touches

BALLISTIC_S = 1e-7  # both sides' forces are left out so long after a touch of both: 1e-14 N s of impulse in case 1
BALLISTIC_HERTZ = 1e4  # where that holds, N/m^1.5; the impulse at 1 m/s is H t^2.5
# heyoka passes over an event function that is exactly zero where a step begins, so that none may be:
FIRST_W = 1e-13  # w at a touch, m^0.5
FIRST_GAP_M = 1e-15  # at a release, if rounding leaves none
NEVER_S = 1e9  # end of a contact's variable: the release comes first
ROUNDING = 4e-16
MAX_LEG_STEPS = 10_000
VARIANTS: tuple[dict[str, bool], ...] = ({}, {"fast_math": True})  # ways to generate code worth their compile time
LADDER = (1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14, 1e-15)


def contenders() -> list[Contender]:
    """heyoka over its tolerance."""
    return [
        Contender("heyoka", "_".join(["heyoka", *options]), "tolerance", LADDER, partial(HeyokaGrasp, options))
        for options in VARIANTS
    ]


@kernel
def read_series(tables: Any, lengths: Any, clock: int, begin: float, arrived: bool, grid: Any, out: Any,
                row: int) -> int:
    """Write the states at the output times that one mode's Taylor steps cover; returns the next row.

    Row `clock` of a table (variables, order + 1) is the time since `begin`. It increases, and is solved for the
    step's variable by safeguarded Newton; -1: the variable is the time. If `arrived`, the last step ends at grid[-1].
    """
    n = tables.shape[2] - 1
    past = begin
    for j in range(lengths.shape[0]):
        c, h = tables[j], lengths[j]
        now = past + h
        if clock >= 0:
            now = 0.0
            for k in range(n, -1, -1):
                now = now * h + c[clock, k]
            now += begin
        elif arrived and j == lengths.shape[0] - 1:
            now = grid[-1]
        s, low = 0.5 * h, 0.0
        while row < grid.shape[0] and grid[row] <= now:
            s = grid[row] - past if clock < 0 else invert(c[clock], n, grid[row] - begin, s, low, h)
            for i in range(6):
                value = c[i, n]
                for k in range(n - 1, -1, -1):
                    value = value * s + c[i, k]
                out[row, i] = value
            low = s
            row += 1
        past = now
    return row


@kernel
def invert(c: Any, n: int, value: float, s: float, low: float, high: float) -> float:
    """Where in [low, high] an increasing polynomial of degree n has a value; s is the first guess."""
    top = high
    for _ in range(100):
        rest, slope = c[n], 0.0
        for k in range(n - 1, -1, -1):
            slope = slope * s + rest
            rest = rest * s + c[k]
        rest -= value
        low, high = (low, s) if rest > 0.0 else (s, high)
        last = s
        s = s - rest / slope
        if not low <= s <= high:
            s = 0.5 * (low + high)
        if abs(s - last) <= ROUNDING * top:
            break
    return s


def heyoka_system(hy: Any, grasp: Grasp, left: bool, right: bool) -> tuple[list[Any], list[Any]]:
    """Equations (1) to (8) with dt = 2 w ds in contact, 2 w_l w_r ds in two, and the events that end the mode."""
    x_l, v_l, x_o, v_o, x_r, v_r = hy.make_vars("x_l", "v_l", "x_o", "v_o", "x_r", "v_r")
    w_l, w_r, t = hy.make_vars("w_l", "w_r", "t")
    clock = (2.0 if left or right else 1.0) * (w_l if left else 1.0) * (w_r if right else 1.0)
    force = [
        pair.hertzian * (w * w * w) * (1.0 + pair.dissipation * rate) if touching else 0.0
        for touching, pair, w, rate in (
            (left, grasp.left_contact, w_l, v_l - v_o), (right, grasp.right_contact, w_r, v_o - v_r),
        )
    ]
    pull = [
        -(arm.stiffness + arm.position_gain) * x - (arm.damping + arm.velocity_gain) * v
        for arm, x, v in ((grasp.left, x_l, v_l), (grasp.right, x_r, v_r))
    ]
    rates = [
        (x_l, v_l), (v_l, (pull[LEFT] - force[LEFT]) / grasp.left.mass),
        (x_o, v_o), (v_o, hy.expression(force[LEFT] - force[RIGHT]) / grasp.object_mass),
        (x_r, v_r), (v_r, (pull[RIGHT] + force[RIGHT]) / grasp.right.mass),
    ]
    equations = [(variable, clock * rate) for variable, rate in rates]
    equations += [(w_l, (v_l - v_o) * (w_r if right else 1.0))] if left else []
    equations += [(w_r, (v_o - v_r) * (w_l if left else 1.0))] if right else []
    equations += [(t, clock)] if left or right else []
    up, down = hy.event_direction.positive, hy.event_direction.negative
    events = [
        hy.t_event(w_l, direction=down) if left else hy.t_event(x_l - x_o, direction=up),
        hy.t_event(w_r, direction=down) if right else hy.t_event(x_o - x_r, direction=up),
    ]
    return equations, events


class Leg:
    """heyoka's integrator for one mode: the six states, then w of each side in contact, then the time since its start.

    The arrays are views into heyoka's memory.
    """

    def __init__(self, hy: Any, grasp: Grasp, mode: int, options: dict[str, Any]) -> None:
        self.sides = [side for side in (LEFT, RIGHT) if mode >> side & 1]
        equations, events = heyoka_system(hy, grasp, LEFT in self.sides, RIGHT in self.sides)
        self.solver = hy.taylor_adaptive(equations, [0.0] * len(equations), t_events=events, **options)
        self.y, self.tc = self.solver.state, self.solver.tc
        self._tables = np.empty((MAX_LEG_STEPS, *self.tc.shape))
        self.clock = len(self.y) - 1 if self.sides else -1
        self.success, self.time_limit = int(hy.taylor_outcome.success), int(hy.taylor_outcome.time_limit)

    def start(self, state: Array, w: list[float]) -> None:
        """Begin at a state; w (2,) of sides that are not in contact is not read."""
        self.y[:6] = state
        for i, side in enumerate(self.sides):
            self.y[6 + i] = w[side]
        if self.sides:
            self.y[-1] = 0.0
        self.solver.time = 0.0
        self.solver.reset_cooldowns()

    def elapsed(self) -> float:
        """Time since the start, s."""
        return float(self.y[-1] if self.sides else self.solver.time)

    def run(self, rest: float) -> int:
        """Go to the next event in heyoka's own loop; a flight no further than `rest`. Returns heyoka's outcome."""
        return int(self.solver.propagate_until(NEVER_S if self.sides else rest, max_steps=MAX_LEG_STEPS)[0])

    def deliver(self, begin: float, grid: Array, out: Array, row: int) -> tuple[int, int]:
        """Go to the next event step by step, a flight to the last output time; returns the outcome and the next row."""
        step, tables, tc = self.solver.step, self._tables, self.tc
        rest = NEVER_S if self.sides else grid[-1] - begin
        outcome = self.success
        lengths: list[float] = []
        while outcome == self.success and len(lengths) < len(tables):
            result, h = step(rest, True)
            tables[len(lengths)] = tc
            lengths.append(h)
            rest -= h
            outcome = result.value
        arrived = outcome == self.time_limit
        return outcome, read_series(tables, np.array(lengths), self.clock, begin, arrived, grid, out, row)


class HeyokaGrasp:
    """One scene's flights and contacts, built for one tolerance; call it with the output times."""

    def __init__(self, options: dict[str, bool], scene: Scene, tolerance: float) -> None:
        import heyoka as hy

        settings = {"tol": tolerance, **options}
        self._start = scene.initial_state
        hertzian = max(grasp_of(scene).left_contact.hertzian, grasp_of(scene).right_contact.hertzian)
        self._ballistic_s = BALLISTIC_S * (BALLISTIC_HERTZ / hertzian) ** 0.4
        self._legs = [Leg(hy, grasp_of(scene), mode, settings) for mode in range(4)]
        flight, _ = heyoka_system(hy, grasp_of(scene), False, False)
        self._ballistic = hy.taylor_adaptive(flight, [0.0] * 6, **settings)

    def __call__(self, grid: Array) -> Answer:
        """States at the output times."""
        out, row, mode, begin, touches = np.empty((len(grid), 6)), 0, 0, 0.0, [0, 0]
        state, w = self._start, [0.0, 0.0]
        while True:
            leg = self._legs[mode]
            leg.start(state, w)
            stepwise = len(grid) > 1
            if not stepwise:
                outcome = leg.run(grid[-1] - begin)
                stepwise = begin + leg.elapsed() >= grid[-1]
                if stepwise:
                    leg.start(state, w)
            if stepwise:
                outcome, row = leg.deliver(begin, grid, out, row)
            side = -1 - outcome
            if row == len(grid) or side not in (LEFT, RIGHT):
                status = "done" if row == len(grid) else f"stopped with heyoka's outcome {outcome}"
                return Answer(out[:row], (touches[LEFT], touches[RIGHT]), status, None, None)
            begin += leg.elapsed()
            state, w = leg.y[:6].copy(), [FIRST_W, FIRST_W]
            for i, pressed in enumerate(leg.sides):
                w[pressed] = leg.y[6 + i]
            mode ^= 1 << side
            if not mode >> side & 1:
                _open(state, side)
            else:
                w[side] = FIRST_W
                touches[side] += 1
                if mode == 1 << side and other_side_touches(state, side):
                    mode = 3
                    touches[1 - side] += 1
                    state, w = self._pass_corner(state)
                    begin += self._ballistic_s

    def _pass_corner(self, state: Array) -> tuple[Array, list[float]]:
        """State and w a moment after a touch of both sides; at w_l = w_r = 0 the regularised time stands still."""
        flight = self._ballistic
        flight.state[:] = state
        flight.step(self._ballistic_s)
        y = flight.state.copy()
        return y, [math.sqrt(y[X.L] - y[X.O]), math.sqrt(y[X.O] - y[X.R])]


def _open(state: Array, side: int) -> None:
    """Leave a gap behind a release."""
    arm, sign = (X.L, -1.0) if side == LEFT else (X.R, 1.0)
    if state[arm] == state[X.O]:
        state[arm] += sign * FIRST_GAP_M

"""The motions of scenes in high precision, and their derivatives by differences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import gmpy2
import numpy as np
from gmpy2 import mpfr
from numpy.typing import NDArray

from grasp_ros.physics.control import is_due
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.scene.effects.base import NANOSECONDS
from lab.reference.automaton import Event
from lab.reference.plant import LEFT, OBJECT, RIGHT, Body, Law, Plant, Real, Reals, number
from lab.reference.run import EXPONENTS, Row, Run, Spent, precision

STEP = 2.0**-50  # of a number, whose neighbours are 2^-53 to 2^-52 of it apart
FROM_ZERO = 2.0**-60  # the step of a number that is 0, whose neighbours are as near as one likes
DIGITS = 25


class Reference(NamedTuple):
    """A solution on a grid of times, and its contacts in the sense of (10), at u = 0 or at u' = -1/p."""

    t: list[Real]  # s
    state: list[Row]  # x_l, v_l, x_o, v_o, x_r, v_r in m and m/s; 0 of what is not there
    touches: tuple[list[Real], list[Real]]  # begin of contact, left and right, s
    releases: tuple[list[Real], list[Real]]  # end of contact, left and right, s
    events: list[Event]

    def as_array(self) -> NDArray[np.float64]:
        """The states rounded to doubles, shape (N, 6), m and m/s."""
        return np.array([[float(value) for value in row] for row in self.state]).reshape(-1, 6)


def _reference(grid: Reals, run: Run) -> Reference:
    """What a run has found."""
    touches: tuple[Reals, Reals] = ([], [])
    releases: tuple[Reals, Reals] = ([], [])
    clamped = [False, False]
    for event in run.events:
        if event.kind in ("touch", "reentry"):
            touches[event.body].append(event.t)
        elif event.kind == "clamp" or (event.kind == "release" and not clamped[event.body]):
            releases[event.body].append(event.t)
        if event.body != OBJECT:
            clamped[event.body] = event.kind == "clamp"
    return Reference(grid[: len(run.rows)], run.rows, touches, releases, run.events)


def integrate(scene: Scene, times: Iterable[Real], digits: int = DIGITS, budget: float = math.inf,
              state: Sequence[Real] | None = None, decimal: bool = False) -> Reference:
    """The motion of a scene in high precision.

    The floats of the system that the scene makes are taken exactly, a continuous feedback added to them; forces act
    from tick to tick, and commands are computed by the controllers from the states of this motion.

    Parameters
    ----------
    scene : Scene
    times : iterable of number, s
        Ascending, within the horizon; a float, or a str or an mpfr with more digits.
    digits : int
        Each step keeps this many digits; a scene that amplifies errors ends with fewer.
    budget : float
        Limit of steps; the states at the times reached until then are given.
    state : sequence (6,) of number, optional, m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r at t = 0; by default those of the scene. A pair may start in contact; that is no
        touch.
    decimal : bool
        A float stands for its shortest decimal form, 0.2 for one fifth, rather than for its binary value.

    Raises
    ------
    RuntimeError
        If the modes contradict each other.
    """
    exact = partial(number, decimal=decimal)
    with gmpy2.context(precision=precision(digits), emax=EXPONENTS, emin=-EXPONENTS):
        grid, system = [exact(t) for t in times], scene.system
        plant = _plant(scene, exact)
        x_l, v_l, x_o, v_o, x_r, v_r = map(exact, system.state.tolist() if state is None else state)
        run = Run(plant, [x_l, x_r, x_o], [v_l, v_r, v_o], grid, digits, budget)
        commands: Reals = [mpfr(0)] * 3
        waiting = [commands] * system.delay
        try:
            for tick, following in pairwise(_ticks(scene)):
                forces = [exact(force) for force in system.external_at(tick).tolist()]
                if scene.sampled:
                    commands = _commands(scene, tick, run, commands)
                    waiting.append(commands)
                    forces = [a + b for a, b in zip(forces, waiting.pop(0), strict=True)]
                run.enter(_pushed(plant, forces))
                # a tick is a whole number of nanoseconds: as a float 5.02 s is 4e-16 s less
                run.advance(grid[-1] if following == scene.ticks
                            else min(mpfr(following * scene.period_ns) / NANOSECONDS, grid[-1]))
                if len(run.rows) == len(grid):
                    break
        except Spent:
            pass
        return _reference(grid, run)


def _ticks(scene: Scene) -> list[int]:
    """Ticks at which forces may change, the first and the last one."""
    if scene.sampled:
        return list(range(scene.ticks + 1))
    changes = {tick for force in scene.system.external for tick in force.changes(scene.ticks)}
    return sorted({0, *changes, scene.ticks})


def _plant(scene: Scene, exact: Callable[[float], Real]) -> Plant:
    """What a scene simulates; the continuous feedback is in it, added here and not by the product."""
    system = scene.system
    rows = system.bodies.tolist()
    for side, law in () if scene.sampled else system.laws.items():
        kp, kv, set_point, feed_forward, *_ = law.row.tolist()
        rows[side] = np.add(rows[side], [0.0, kp, kv, kp * set_point + feed_forward]).tolist()
    left, right, thing = (Body.of(*map(exact, row)) if row[0] else None for row in rows)
    pairs = system.pairs.tolist()
    laws = [Law(*map(exact, pairs[side])) if side in system.contacts else None for side in (LEFT, RIGHT)]
    return Plant((left, right, thing), (laws[LEFT], laws[RIGHT]), exact(system.coulomb))


def _pushed(plant: Plant, forces: Reals) -> Plant:
    """The plant under more constant forces, by body."""
    left, right, thing = (
        None if body is None else body.pushed(body.drive * body.mass + force)
        for body, force in zip(plant.bodies, forces, strict=True)
    )
    return plant._replace(bodies=(left, right, thing))


def _commands(scene: Scene, tick: int, run: Run, last: Reals) -> Reals:
    """The commands, by body: what the controllers answer, or repeat."""
    forces = [*last]
    for side, law in scene.system.laws.items():
        if is_due(law.row, tick):
            forces[side] = number(law.command(tick, run.state.x[side], run.state.v[side]))
    return forces


class Derivative(NamedTuple):
    """Derivatives by one number, at fixed times; those of the times of contacts by side.

    They are empty where the two motions have not as many: mirror images, say.
    """

    state: Array  # (m, 6)
    touches: tuple[list[float], list[float]]  # s
    releases: tuple[list[float], list[float]]


def difference(scene: Scene, key: str, times: Sequence[float]) -> Derivative:
    """Central differences, or one-sided ones of a number at 0 that cannot be negative, extrapolated to a step of 0.

    Those of two steps are, one of them twice the other (L. F. Richardson, Phil. Trans. R. Soc. A 210 (1911) 307): where
    a motion grows by 1e11, even the smallest step of a float is too long for one difference.
    """
    section, _, name = key.partition(".")
    value = scene.values[section][name]
    step = STEP * 2.0 ** round(math.log2(abs(value))) if value else FROM_ZERO
    central = value != 0.0 or "position" in name or "velocity_m" in name or "set_point" in name
    with gmpy2.context(precision=4 * DIGITS):
        near, far = (_slopes(scene, key, times, value - width if central else value, value + width)
                     for width in (step, 2.0 * step))
        order = 2 if central else 1  # of the error in the step
        *state, left, right, later_left, later_right = _pairwise(lambda a, b: a + (a - b) / (2**order - 1), near, far)
    return Derivative(np.array(state, dtype=float), _floats(left, right), _floats(later_left, later_right))


def _slopes(scene: Scene, key: str, times: Sequence[float], low: float, high: float) -> list[Reals]:
    """Differences of states, one after another, and of the times of touches and releases, left and right."""
    first, second = (
        (*run.state, *run.touches, *run.releases)
        for run in (integrate(scene.changed({key: at}), times, DIGITS) for at in (low, high)))
    width = gmpy2.mpq(Fraction(high) - Fraction(low))
    return _pairwise(lambda a, b: (b - a) / width, first, second)


def _pairwise(
    combine: Callable[[Real, Real], Real], first: Iterable[Sequence[Real]], second: Iterable[Sequence[Real]],
) -> list[Reals]:
    """Combine the numbers of two sequences of lists; those of unequal lengths make an empty one."""
    return [[combine(a, b) for a, b in zip(*pair, strict=True)] if len(pair[0]) == len(pair[1]) else []
            for pair in zip(first, second, strict=True)]


def _floats(left: Reals, right: Reals) -> tuple[list[float], list[float]]:
    return [float(value) for value in left], [float(value) for value in right]

"""The motions of grasps and of scenes in high precision."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

import gmpy2
import numpy as np
from gmpy2 import mpfr
from numpy.typing import NDArray

from grasp_ros.physics.model import Arm, Contact
from grasp_ros.scene import Scene
from lab.reference.automaton import Event
from lab.reference.deadline import Deadline
from lab.reference.grasp import Grasp
from lab.reference.plant import LEFT, OBJECT, RIGHT, Body, Law, Plant, Real, Reals, number
from lab.reference.run import Row, Run, precision

STEP_BUDGET = 100_000
EXPONENTS = 1 << 40  # nothing overflows


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


def _arm(arm: Arm, force: float, feedback: bool, decimal: bool) -> Body:
    """The parameters of an arm, checked."""
    mass, k, c, kp, kv = (number(value, decimal) for value in arm)
    stiffness, damping = (k + kp, c + kv) if feedback else (k, c)
    if mass <= 0 or min(stiffness, damping) < 0:
        raise ValueError(f"a mass must be positive, stiffness and damping must not be negative: {arm}")
    return Body.of(mass, stiffness, damping, number(force, decimal))


def _law(contact: Contact, decimal: bool) -> Law | None:
    """The parameters of a pair, checked."""
    law = Law(*(number(value, decimal) for value in contact))
    if min(law) < 0:
        raise ValueError(f"H and p must not be negative: {contact}")
    return law if law.hertzian else None


def integrate(
    grasp: Grasp,
    state0: Sequence[float],
    times: Sequence[float],
    digits: int = 30,
    force: Sequence[float] = (0.0, 0.0),
    feedback: bool = True,
    decimal: bool = False,
) -> Reference:
    """The motion of a grasp in high precision.

    Every number may be a float, an int, a str, a Decimal or an mpfr.

    Parameters
    ----------
    grasp : Grasp
        Impact forces of a side with H = 0 do not exist, and its contacts are not recorded.
    state0 : sequence (6,), m and m/s
        x_l, v_l, x_o, v_o, x_r, v_r at t = 0. A pair may start in contact; that is no touch.
    times : sequence (N,), s
        Ascending, from 0; the states are given here.
    digits : int
        Each step keeps this many digits; a scene that amplifies errors ends with fewer.
    force : sequence (2,), N
        Constant forces on the left and the right arm, added to the feedback if there is one.
    feedback : bool
        Whether the continuous feedback (4), (5) acts.
    decimal : bool
        A float stands for its shortest decimal form, 0.2 for one fifth, rather than for its binary value.

    Returns
    -------
    Reference

    Raises
    ------
    ValueError
        If a number is not finite, a mass is not positive, K, C, H or p is negative, `state0` has not six
        components, or the times are not ascending from 0.
    RuntimeError
        If the motion has more steps than STEP_BUDGET.
    """
    with gmpy2.context(precision=precision(digits), emax=EXPONENTS, emin=-EXPONENTS):
        grid, start = ([number(value, decimal) for value in values] for values in (times, state0))
        if not grid or grid[0] != 0 or any(b <= a for a, b in pairwise(grid)):
            raise ValueError("times must ascend from 0")
        mass, zero = number(grasp.object_mass, decimal), mpfr(0)
        if len(start) != 6 or mass <= 0:
            raise ValueError("state0 needs six components, and the object a positive mass")
        arms = [_arm(arm, push, feedback, decimal) for arm, push in zip((grasp.left, grasp.right), force, strict=True)]
        laws = _law(grasp.left_contact, decimal), _law(grasp.right_contact, decimal)
        plant = Plant((arms[LEFT], arms[RIGHT], Body.of(mass, zero, zero, zero)), laws, zero)
        run = Run(plant, *_by_body(start), grid, digits, STEP_BUDGET)
        try:
            run.advance(grid[-1])
        except Deadline:
            raise RuntimeError(f"more than {STEP_BUDGET} steps before t = {float(run.state.t)} s") from None
        return _reference(grid, run)


def _by_body(start: Reals) -> tuple[Reals, Reals]:
    """Positions and velocities in the order of the bodies."""
    return [start[0], start[4], start[2]], [start[1], start[5], start[3]]


def integrate_scene(scene: Scene, times: Iterable[float], digits: int = 25, budget: float = math.inf) -> Reference:
    """The motion of a scene in high precision.

    The floats of the system that the scene makes are taken exactly; forces act from tick to tick, and commands are
    computed by the controllers from the states of this motion.

    Parameters
    ----------
    scene : Scene
    times : iterable of float, s
        Ascending, within the horizon.
    digits : int
        See `integrate`.
    budget : float
        Limit of steps; the states at the times reached until then are given.

    Returns
    -------
    Reference

    Raises
    ------
    RuntimeError
        If the modes contradict each other.
    """
    with gmpy2.context(precision=precision(digits), emax=EXPONENTS, emin=-EXPONENTS):
        grid = [number(float(t)) for t in times]
        plant = _plant(scene)
        start = [number(value) for value in scene.system.state.tolist()]
        run = Run(plant, *_by_body(start), grid, digits, budget)
        system, waiting = scene.system, [[mpfr(0)] * 3] * scene.system.delay
        try:
            for tick, following in pairwise(_ticks(scene)):
                forces = [number(force) for force in system.external_at(tick).tolist()]
                if scene.sampled:
                    waiting.append(_commands(scene, tick, run))
                    forces = [a + b for a, b in zip(forces, waiting.pop(0), strict=True)]
                run.enter(_pushed(plant, forces))
                run.advance(number(float(scene.time_of(following))))
                if len(run.rows) == len(grid):
                    break
        except Deadline:
            pass
        return _reference(grid, run)


def _ticks(scene: Scene) -> list[int]:
    """Ticks at which forces may change, the first and the last one."""
    if scene.sampled:
        return list(range(scene.ticks + 1))
    changes = {tick for force in scene.system.external for tick in force.changes(scene.ticks)}
    return sorted({0, *changes, scene.ticks})


def _plant(scene: Scene) -> Plant:
    """What a scene simulates; the continuous feedback is in it."""
    system = scene.system
    rows = (system.bodies if scene.sampled else system.closed_loop).tolist()
    left, right, thing = (Body.of(*map(number, row)) if row[0] else None for row in rows)
    pairs = system.pairs.tolist()
    laws = [Law(*map(number, pairs[side])) if side in system.contacts else None for side in (LEFT, RIGHT)]
    return Plant((left, right, thing), (laws[LEFT], laws[RIGHT]), number(system.coulomb))


def _pushed(plant: Plant, forces: Reals) -> Plant:
    """The plant under more constant forces, by body."""
    left, right, thing = (
        None if body is None else body.pushed(body.drive * body.mass + force)
        for body, force in zip(plant.bodies, forces, strict=True)
    )
    return plant._replace(bodies=(left, right, thing))


def _commands(scene: Scene, tick: int, run: Run) -> Reals:
    """What the controllers answer, by body."""
    answers = [mpfr(0)] * 3
    for side, law in scene.system.laws.items():
        answers[side] = number(law.command(tick, run.state.x[side], run.state.v[side]))
    return answers

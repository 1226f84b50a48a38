"""A pair on the bench: a plant, its state and its records, built for one side and mirrored for the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pytest

from grasp_ros.exact.contact.step_unit import higher_order, new_settings
from grasp_ros.exact.driver.advance import advance
from grasp_ros.exact.driver.outputs import SPARE
from grasp_ros.exact.driver.workspace import new_workspace
from grasp_ros.exact.kinematics import other
from grasp_ros.exact.records import (
    COULOMB,
    PLANT_NUMBERS,
    STATE_NUMBERS,
    Array,
    Output,
    Plant,
    Settings,
    State,
    one_interval,
    plant_of,
    state_of,
)
from grasp_ros.physics.layout import (
    LEFT,
    OBJECT,
    RIGHT,
    Body,
    Entry,
    Filled,
    Law,
    Of,
    Outcome,
    Pair,
    Slide,
    Transition,
    U,
    V,
    Work,
    X,
)
from grasp_ros.physics.system import COLUMN

SIDES = pytest.mark.parametrize("side", [LEFT, RIGHT], ids=["left", "right"])
TOLERANCE, ORDER = 1e-16, 34
OPEN_BESIDE = (-1.0, 0.0)  # u and u' of a pair that is far from touching


class Bench(NamedTuple):
    """What the functions of the automaton take."""

    plant: Plant
    state: State
    settings: Settings
    out: Output

    def mode(self, side: Body) -> Pair:
        """Mode of a pair."""
        return Pair(self.state.mode[side])

    @property
    def slide(self) -> Slide:
        """Mode of the object."""
        return Slide(self.state.mode[OBJECT])

    @property
    def events(self) -> list[tuple[Body, Transition]]:
        """What was recorded: who and what."""
        rows = self.out.events[: self.out.filled[Filled.EVENTS]]
        return [(Body(int(row[Entry.BODY])), Transition(int(row[Entry.KIND]))) for row in rows]

    @property
    def recorded_motion(self) -> list[tuple[float, float]]:
        """u and u' of the recorded events."""
        rows = self.out.events[: self.out.filled[Filled.EVENTS]]
        return [(row[Entry.U], row[Entry.RATE]) for row in rows.tolist()]

    @property
    def times(self) -> list[float]:
        """When, s."""
        return [float(time) for time in self.out.events[: self.out.filled[Filled.EVENTS], Entry.TIME]]


def bench(
    side: Body, u: float, d: float, mode: Pair = Pair.OPEN, *, beside: tuple[float, float] = OPEN_BESIDE,
    beside_mode: Pair = Pair.OPEN, p: float = 0.5, push: float = 0.0, object_push: float = 0.0,
    beside_push: float = 0.0, stiffness: float = 0.0, coulomb: float = 0.0, slide: Slide = Slide.FREE,
    object_speed: float = 0.0, time: float = 0.0,
) -> Bench:
    """A pair of mass 1 and 1 with penetration u and u' = d; pushes in N, positive where they press `side` together.

    The object is at 0. `push` acts on the arm of `side`, `object_push` on the object and `beside_push` on the other
    arm, all in the direction in which that arm of `side` approaches.
    """
    sign = 1.0 if side == LEFT else -1.0
    far = other(side)
    given = np.zeros((3, 4))
    given[:, Of.MASS] = 1.0
    given[side, Of.STIFFNESS] = stiffness
    given[[side, OBJECT, far], Of.FORCE] = sign * push, sign * object_push, sign * beside_push
    pairs = np.zeros((2, 2))
    pairs[:, Law.HERTZIAN], pairs[:, Law.DISSIPATION] = 1e4, p
    y = np.zeros(8)
    for body, (depth, rate), towards in ((side, (u, d), sign), (far, beside, -sign)):
        y[COLUMN[body]], y[COLUMN[body] + 1] = towards * depth, towards * rate + sign * object_speed
        y[U.L + body] = depth
    y[X.O], y[V.O] = 0.0, sign * object_speed
    modes = np.zeros(3, dtype=np.int64)
    modes[[side, far, OBJECT]] = mode, beside_mode, slide
    plant = Plant(given, given.copy(), pairs, coulomb, given[:, Of.FORCE].copy())
    out = Output(np.zeros(0), np.zeros((0, 6)), np.zeros((8 * SPARE, 5)), np.zeros(len(Filled), dtype=np.int64),
                 np.zeros(len(Work), dtype=np.int64), np.zeros(2, dtype=np.int64))
    settings = new_settings(TOLERANCE, higher_order(ORDER), given)
    return Bench(plant, State(y, modes, np.zeros(6), np.array([time, 0.0, 0.0]), np.zeros(3)), settings, out)


def drive(b: Bench, duration: float, grid: Sequence[float] = ()) -> Array:
    """Integrate for a time in s without any tick; the states at the grid."""
    loop = one_interval(duration, 0.0, len(grid))
    rows, memory, plant_block, state_block = (
        np.full((len(grid), 6), np.nan), new_workspace(ORDER), np.zeros(PLANT_NUMBERS), np.zeros(STATE_NUMBERS))
    plant, state, plant_block[COULOMB] = plant_of(plant_block), state_of(state_block, b.state.mode), b.plant.coulomb
    plant.given[:], plant.bodies[:], plant.pairs[:] = b.plant.given, b.plant.bodies, b.plant.pairs
    plant.own[:] = b.plant.given[:, Of.FORCE]
    state.y[:] = b.state.y
    outcome = advance(
        memory.block, memory.order, plant_block, state_block, b.state.mode, TOLERANCE, 10**6,
        np.array(grid, dtype=float), rows, b.out.events, b.out.filled, b.out.work, b.out.observer, tuple(loop))
    b.state.y[:], b.state.low[:], b.state.clock[:] = state.y, state.low, state.clock
    assert outcome == Outcome.DONE
    return rows


def bits(values: Array) -> bytes:
    """For comparisons to the last bit."""
    return np.asarray(values).tobytes()

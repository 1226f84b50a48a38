"""A pair on the bench: a plant, its state and its records, built for one side and mirrored for the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from grasp_ros.exact.kinematics import other
from grasp_ros.exact.orders import higher_order
from grasp_ros.exact.outputs import SPARE
from grasp_ros.exact.records import Array, Output, Plant, Settings, State
from grasp_ros.exact.scales import new_settings
from grasp_ros.physics.layout import (
    DISSIPATION,
    EVENT_BODY,
    EVENT_KIND,
    EVENT_RATE,
    EVENT_U,
    FORCE,
    HERTZIAN,
    LEFT,
    MASS,
    OBJECT,
    STIFFNESS,
    U_L,
    V_O,
    X_O,
    Body,
    Filled,
    Pair,
    Slide,
    Transition,
    Work,
)
from grasp_ros.physics.system import COLUMN

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
        return [(Body(int(row[EVENT_BODY])), Transition(int(row[EVENT_KIND]))) for row in rows]

    @property
    def recorded_motion(self) -> list[tuple[float, float]]:
        """u and u' of the recorded events."""
        rows = self.out.events[: self.out.filled[Filled.EVENTS]]
        return [(row[EVENT_U], row[EVENT_RATE]) for row in rows.tolist()]


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
    given[:, MASS] = 1.0
    given[side, STIFFNESS] = stiffness
    given[[side, OBJECT, far], FORCE] = sign * push, sign * object_push, sign * beside_push
    pairs = np.zeros((2, 2))
    pairs[:, HERTZIAN], pairs[:, DISSIPATION] = 1e4, p
    y = np.zeros(8)
    for body, (depth, rate), towards in ((side, (u, d), sign), (far, beside, -sign)):
        y[COLUMN[body]], y[COLUMN[body] + 1] = towards * depth, towards * rate + sign * object_speed
        y[U_L + body] = depth
    y[X_O], y[V_O] = 0.0, sign * object_speed
    modes = np.zeros(3, dtype=np.int64)
    modes[[side, far, OBJECT]] = mode, beside_mode, slide
    plant = Plant(given, given.copy(), pairs, coulomb)
    out = Output(np.zeros(0), np.zeros((0, 6)), np.zeros((SPARE, 5)), np.zeros(len(Filled), dtype=np.int64),
                 np.zeros(len(Work), dtype=np.int64))
    settings = new_settings(TOLERANCE, higher_order(ORDER), given)
    return Bench(plant, State(y, modes, np.zeros(8), np.array([time, 0.0, 0.0])), settings, out)


def bits(values: Array) -> bytes:
    """For comparisons to the last bit."""
    return np.asarray(values).tobytes()

"""A run with its tangents: the observer that carries them along, with its memory."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from grasp_ros.exact.compilation.vectors import WIDTH
from grasp_ros.exact.integrator import Integrator
from grasp_ros.exact.records import Integers, Tables
from grasp_ros.observe.observer import address_of
from grasp_ros.physics.control import Column, normals_over
from grasp_ros.physics.layout import LANES
from grasp_ros.physics.model import Array
from grasp_ros.scene import Scene
from grasp_ros.sensitivity.directions import Directions, law_rows
from grasp_ros.sensitivity.propagate import FINISH, UNSEEN, propagate
from grasp_ros.sensitivity.tangents import BLOCK, NUMBERS, ROOM, ROWS, STATES, TERMS, Count, Number, Place

LINE_BYTES = 64


def _zeros(*shape: int) -> Array:
    """Zeros that begin on a line of the processor's cache: vectors that lie on two lines take twice as long."""
    count = math.prod(shape)
    whole = np.zeros(count + WIDTH)
    first = -whole.ctypes.data % LINE_BYTES // whole.itemsize
    return whole[first : first + count].reshape(shape)


def _padded(array: Array) -> Array:
    """An array with zeros behind its last axis, up to a multiple of WIDTH."""
    n = array.shape[-1]
    wide = _zeros(*array.shape[:-1], n + -n % WIDTH)
    wide[..., :n] = array
    return wide


class Carrier:
    """Carries the tangents of one run along; an observer of `exact`.

    Parameters
    ----------
    integrator : Integrator
    directions : Directions
    grid : array (m,), s
        Ascending output times.

    Attributes
    ----------
    x : array (6, n)
        Derivatives of the state now.
    out : array (m, 6, n)
        At the output times.
    forces : array (m, 3, 1 + n)
        Constant forces that act on the bodies there, N, and behind them their derivatives.
    """

    def __init__(self, integrator: Integrator, directions: Directions, grid: Array) -> None:
        n, plant, state = directions.state.shape[1], integrator.plant, integrator.records
        x, law = _padded(directions.state), _padded(directions.pairs)
        wide = x.shape[1]
        self.x, self.out, self.forces = x[:, :n], np.zeros((len(grid), STATES, n)), np.zeros((len(grid), 3, 1 + n))
        self.counts, self.numbers = np.zeros(len(Count), dtype=np.int64), np.zeros(NUMBERS)
        self.counts[Count.DIRECTIONS], self.counts[Count.COLUMNS], self.counts[Count.OUTPUTS] = n, wide, len(grid)
        self.counts[Count.TICK], self.counts[Count.SLIDE] = -1, UNSEEN
        self.numbers[Number.CORNER] = math.inf
        self.before = state.y.copy()
        self._arrays: dict[Place, Array | Integers] = {
            Place.Y: state.y, Place.MODE: state.mode, Place.CLOCK: state.clock, Place.BODIES: plant.bodies,
            Place.PAIRS: plant.pairs, Place.COUNTS: self.counts, Place.NUMBERS: self.numbers,
            Place.BEFORE: self.before, Place.X: x, Place.AT: _zeros(STATES, wide),
            Place.GIVEN: directions.bodies, Place.ACTING: _zeros(3, 4, wide), Place.FORCE: np.zeros((3, n)),
            Place.LAW: law, Place.COULOMB: directions.coulomb, Place.GRID: grid,
            Place.OUT: self.out, Place.FORCES: self.forces,
            Place.SERIES: _zeros(wide // WIDTH * BLOCK), Place.ROWS: np.zeros((ROWS, TERMS)),
            Place.FACTORS: _zeros(2, ROOM), Place.PRODUCTS: _zeros(3, ROOM),
            Place.MATRICES: np.zeros((5, STATES, STATES)), Place.OWN: _zeros(LANES * TERMS),
            Place.CONTROL: np.zeros((2, len(Column))), Place.CONTROL_RATES: np.zeros((2, len(Column), n)),
            Place.NORMALS: np.zeros((1, 2, 2)), Place.WAITING: np.zeros((0, 2, n)),
            Place.EXTERNAL: directions.external,
        }
        self.counts[Count.NORMALS], self.counts[Count.TICKS] = 1, len(directions.external)
        self.context: NDArray[np.int64] = np.zeros(len(Place), dtype=np.int64)
        self._place()

    def _place(self) -> None:
        for place, array in self._arrays.items():
            self.context[place] = array.ctypes.data

    def drive_by(self, scene: Scene, directions: Directions, sampled: bool) -> None:
        """Let inputs change at ticks: commands that are held, and external forces."""
        system, n = scene.system, self.x.shape[1]
        self.counts[Count.DRIVEN], self.numbers[Number.PERIOD] = 1, scene.time_of(1)
        if sampled:
            normals = np.zeros((scene.ticks + 1, 2, 2))
            for side, law in system.laws.items():
                if law.seed is not None:
                    normals[:, side] = normals_over(law.seed, 0, scene.ticks + 1)
            self.counts[Count.NORMALS], self.counts[Count.DELAY] = len(normals), system.delay
            self._arrays |= {
                Place.CONTROL: law_rows(system), Place.CONTROL_RATES: directions.laws, Place.NORMALS: normals,
                Place.WAITING: np.zeros((system.delay, 2, n)),
            }
        self._place()

    def attach(self, tables: Tables) -> Integers:
        """What a run with this workspace calls after each segment."""
        self.context[Place.C] = tables.c.ctypes.data
        return np.array([address_of(propagate), self.context.ctypes.data])

    def finish(self, time: float) -> None:
        """After a run, at its end in s."""
        address_of(propagate)
        propagate(self.context.ctypes.data, FINISH, float(time), 0.0, 0)

    @property
    def corner(self) -> float | None:
        """First time in s at which one-sided derivatives differ; None: there is none."""
        corner = float(self.numbers[Number.CORNER])
        return corner if math.isfinite(corner) else None

"""What the tangents of a run are: derivatives of its state, and all that they follow from.

A direction is what one derivative is taken with respect to: an initial value, a number of the scene. Arrays have the
directions last, so that the inner loops of the kernels become vector instructions.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numba import typeof

from grasp_ros.exact.compilation.jit import kernel
from grasp_ros.exact.compilation.vectors import HALF
from grasp_ros.exact.contact.step_unit import higher_order, series_order
from grasp_ros.exact.driver.callback import reader
from grasp_ros.exact.driver.workspace import zeros
from grasp_ros.exact.records import Array, Integers, Plant, State, new_run
from grasp_ros.physics.accuracy import FINEST
from grasp_ros.physics.control import Column
from grasp_ros.physics.system import NO_LAW
from grasp_ros.sensitivity.directions import Directions, no_directions

TERMS = higher_order(series_order(FINEST)) + 1  # of the longest series
STATES = 6
STEP = STATES * HALF  # numbers of one coefficient of all states, for HALF directions
BLOCK = STEP * TERMS
WEIGHTS = HALF * TERMS
FLOWS = 16 * HALF  # numbers of the flows of all bodies
AHEAD = 8  # orders that `contact.multiply` finds at a time
ROOM = HALF * (TERMS + 2 * AHEAD)  # of four series for it
COLUMNS = len(Column)
UNSEEN = -1  # slide before the first segment


class Row(IntEnum):
    """Polynomials of a Taylor step of the run, each times dt/ds; the sides, or the bodies, have one each."""

    PACE = 0  # dt/ds itself
    HERTZIAN = 1  # dF/dH
    LOSS = 3  # dF/dp
    WAY = 5  # x; of the object, which has no spring, 0
    SPEED = 8  # x'
    GAIN = 11  # v'


class Weight(IntEnum):
    """The same that each coefficient of a direction is multiplied with, each number HALF times: as a vector."""

    PACE = 0
    SLOPE = 1  # dF/du
    DRAG = 3  # dF/du'


ROWS = Row.GAIN + 3


class Count(IntEnum):
    """Indices of the whole numbers."""

    FILLED = 0  # outputs
    TICK = 1  # whose inputs act; -1: none yet
    DRIVEN = 2  # whether inputs change at ticks
    SLIDE = 3  # mode of the object in the last segment; UNSEEN: there was none
    CORNER = 4  # why one-sided derivatives differ, see `Corner`


class Number(IntEnum):
    """Indices of the numbers."""

    TIME = 0  # up to which the tangents are known, s
    PERIOD = 1  # control period, s
    CORNER = 2  # first time at which one-sided derivatives differ, s; inf: none
    FORCE = 3  # constant force on the object in the last segment, its friction in it, N


class Corner(IntEnum):
    """Why one-sided derivatives differ."""

    START = 0
    GLIDE = 1
    LIMIT = 2
    STOP = 3
    TURN = 4


CORNERS = {  # in words
    Corner.START: "the object starts at rest under a force beyond its friction",
    Corner.GLIDE: "a pair starts at u' = -1/p and nothing moves it off",
    Corner.LIMIT: "a command is just at its limit",
    Corner.STOP: "the object stops just when inputs change",
    Corner.TURN: "the object turns where it could as well stay",
}


class Tangents(NamedTuple):
    """The tangents of a run with n directions, in some arrays with zeros up to a multiple N of HALF."""

    # the segment that the run has just made
    c: Array  # its Taylor table: the run has done with it
    y: Array  # (8,) state at its end
    mode: Integers  # (3,)
    clock: Array  # (3,)
    bodies: Array  # (3, 4) as they act in it
    pairs: Array  # (2, 2)
    before: Array  # (8,) state at its begin

    # derivatives of the state, and of the numbers that act in the segment
    x: Array  # (6, N) of the state at its begin, then at its end
    at: Array  # (6, N) scratch: the same at some time of the segment
    acting: Array  # (3, 4, N) of the bodies
    law: Array  # (2, 2, N) of H and p

    # what acts on the bodies, and its derivatives
    given: Array  # (3, 4, n) of the numbers of the bodies, without held inputs
    force: Array  # (3, n) of the inputs that are held
    coulomb: Array  # (n,) of the dry friction
    control: Array  # (2, k) laws of sampled controllers, `physics.control`; without gains: none
    control_rates: Array  # (2, k, n)
    normals: Array  # (2, ticks, 2) standard normal numbers of the sensors by side and tick
    held: Array  # (2, n) of the last commands
    waiting: Array  # (delay, 2, n) of commands on their way: a ring
    external: Array  # (ticks, 3, n)

    # what is written, and where it stands
    counts: Integers  # see `Count`
    numbers: Array  # see `Number`
    grid: Array  # (m,) output times, s, ascending
    order: Integers  # (m,) where each is written
    out: Array  # (m, 6, n)
    forces: Array  # (e, 3, 2 + n) in the last e rows: mass of each body, constant force on it, and its derivatives

    # scratch: the series of a Taylor step, and what moves a body in flight or at rest
    series: Array  # (N / HALF BLOCK,) of the tangents, HALF directions after another
    rows: Array  # (ROWS, TERMS) of the run, see `Row`
    weights: Array  # (5 WEIGHTS,) of the run, see `Weight`
    factors: Array  # (2, ROOM)
    products: Array  # (3, ROOM) see `contact.pair_series`
    matrices: Array  # (5, 6, 6)
    drift: Array  # (6, N) of the tangents at rest, by what acts on the bodies
    flows: Array  # (FLOWS,) see `flight.Flow`


def _padded(array: Array) -> Array:
    """An array with zeros behind its last axis, up to a multiple of HALF."""
    n = array.shape[-1]
    wide = zeros(*array.shape[:-1], n + -n % HALF)
    wide[..., :n] = array
    return wide


def tangents_of(plant: Plant, state: State, changes: Directions, times: Array, e: int) -> Tangents:
    """The tangents of a run that begins, without held commands, for output times (m,) in s, in any order.

    What acts on the bodies is kept at the last e of them.
    """
    n, m, order, x = changes.state.shape[1], len(times), np.argsort(times, kind="stable"), _padded(changes.state)
    wide, counts, numbers = x.shape[1], np.zeros(len(Count), dtype=np.int64), np.zeros(len(Number))
    counts[Count.TICK], counts[Count.SLIDE], numbers[Number.CORNER] = -1, UNSEEN, math.inf
    return Tangents(
        np.zeros(0), state.y, state.mode, state.clock, plant.bodies, plant.pairs, state.y.copy(),
        x, zeros(STATES, wide), zeros(3, 4, wide), _padded(changes.pairs),
        changes.bodies, np.zeros((3, n)), changes.coulomb[0], np.array([NO_LAW.row] * 2), np.zeros((2, COLUMNS, n)),
        np.zeros((2, 1, 2)), np.zeros((2, n)), np.zeros((0, 2, n)), changes.external,
        counts, numbers, times[order], order, np.zeros((m, STATES, n)), np.zeros((e, 3, 2 + n)),
        zeros(wide // HALF * BLOCK), np.zeros((ROWS, TERMS)), zeros(5 * WEIGHTS), zeros(2, ROOM), zeros(3, ROOM),
        np.zeros((5, STATES, STATES)), zeros(STATES, wide), zeros(FLOWS))


tangents_at = reader(typeof(tangents_of(*new_run()[2:], no_directions(1), np.zeros(0), 0)))


@kernel
def note_corner(t: Tangents, time: float, why: int) -> None:
    """Keep the first time in s at which one-sided derivatives differ, and why."""
    if time < t.numbers[Number.CORNER]:
        t.numbers[Number.CORNER], t.counts[Count.CORNER] = time, why


@kernel
def copy_matrix(target: Array, source: Array) -> None:
    """Copy what two matrices have in common, without the scratch that an assignment of arrays may need."""
    for i in range(min(target.shape[0], source.shape[0])):
        for j in range(min(target.shape[1], source.shape[1])):
            target[i, j] = source[i, j]

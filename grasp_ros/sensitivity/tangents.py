"""What the tangents of a run are: derivatives of its state, and all that they follow from.

A direction is what one derivative is taken with respect to: an initial value, a number of the scene. Arrays have the
directions last, so that the inner loops of the kernels become vector instructions.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from numba import carray

from grasp_ros.exact.compilation.jit import allocating, kernel
from grasp_ros.exact.compilation.vectors import WIDTH
from grasp_ros.exact.contact.step_order import higher_order, series_order
from grasp_ros.exact.driver.callback import floats_at, integers_at
from grasp_ros.exact.records import Array, Integers
from grasp_ros.physics.accuracy import FINEST
from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import LANES

TERMS = higher_order(series_order(FINEST)) + 1  # of the longest series
STATES = 6
STEP = STATES * WIDTH  # numbers of one coefficient of all states, for WIDTH directions
BLOCK = STEP * TERMS
ROOM = LANES * (TERMS + 3)  # of eight series for `contact.multiply`
COLUMNS = len(Column)


class Row(IntEnum):
    """Polynomials of a Taylor step of the run, each times dt/ds; the sides have one each."""

    PACE = 0  # dt/ds itself
    SLOPE = 1  # dF/du
    DRAG = 3  # dF/du'
    HERTZIAN = 5  # dF/dH
    LOSS = 7  # dF/dp


ROWS = Row.LOSS + 2


class Count(IntEnum):
    """Places of the whole numbers."""

    DIRECTIONS = 0
    OUTPUTS = 1
    FILLED = 2  # outputs
    TICK = 3  # whose inputs act; -1: none yet
    TICKS = 4  # rows of `external`; 0: no external force depends on a direction
    DELAY = 5
    NORMALS = 6  # rows of `normals`
    DRIVEN = 7  # whether inputs change at ticks
    SLIDE = 8  # mode of the object in the last segment; -1: there was none
    COLUMNS = 9  # of tangents: the directions, and zeros up to a multiple of WIDTH


class Number(IntEnum):
    """Places of the numbers."""

    TIME = 0  # up to which the tangents are known, s
    PERIOD = 1  # control period, s
    CORNER = 2  # first time at which one-sided derivatives differ, s; inf: none
    OBJECT = 3  # row (4,) of the object in the last segment


NUMBERS = Number.OBJECT + 4


class Place(IntEnum):
    """Places of the addresses that the observer is called with."""

    C = 0  # of the run: records.Tables, State, Plant
    Y = 1
    MODE = 2
    CLOCK = 3
    BODIES = 4
    PAIRS = 5
    COUNTS = 6
    NUMBERS = 7
    BEFORE = 8
    X = 9
    AT = 10
    GIVEN = 11
    ACTING = 12
    FORCE = 13
    LAW = 14
    COULOMB = 15
    GRID = 16
    OUT = 17
    SERIES = 18
    ROWS = 19
    MATRICES = 20
    CONTROL = 21
    CONTROL_RATES = 22
    NORMALS = 23
    WAITING = 24
    EXTERNAL = 25
    FACTORS = 26
    PRODUCTS = 27
    FORCES = 28
    OWN = 29  # where the Taylor table is copied to


PLACES, COUNTS = len(Place), len(Count)


class Motion(NamedTuple):
    """The segment that the run has just made."""

    c: Array  # (LANES TERMS,) a copy of its Taylor table
    y: Array  # (8,) state at its end
    mode: Integers  # (3,)
    clock: Array  # (3,)
    bodies: Array  # (3, 4) as they act in it
    pairs: Array  # (2, 2)
    before: Array  # (8,) state at its begin


class Rates(NamedTuple):
    """Derivatives of its state, and of the numbers that act in it; with zeros up to `Count.COLUMNS` directions."""

    x: Array  # (6, N) of the state at its begin, then at its end
    at: Array  # (6, N) scratch: the same at some time of the segment
    acting: Array  # (3, 4, N) of the bodies
    law: Array  # (2, 2, N) of H and p


class Table(NamedTuple):
    """Scratch: the series of a Taylor step."""

    series: Array  # (N / WIDTH BLOCK,) of the tangents, WIDTH directions after another
    rows: Array  # (ROWS, TERMS) of the run, see `Row`
    factors: Array  # (2, ROOM)
    products: Array  # (3, ROOM) see `contact.pair_series`


class Inputs(NamedTuple):
    """What acts on the bodies, and its derivatives."""

    given: Array  # (3, 4, n) of the numbers of the bodies, without held inputs
    force: Array  # (3, n) of the inputs that are held
    coulomb: Array  # (n,) of the dry friction
    control: Array  # (2, k) laws of sampled controllers, `physics.control`; without gains: none
    control_rates: Array  # (2, k, n)
    normals: Array  # (ticks, 2, 2) standard normal numbers of the sensors by tick and side
    waiting: Array  # (delay, 2, n) of commands on their way: a ring
    external: Array  # (ticks, 3, n)


class Outputs(NamedTuple):
    """What is written, and where it stands."""

    counts: Integers  # see `Count`
    numbers: Array  # see `Number`
    grid: Array  # (m,) output times, s
    out: Array  # (m, 6, n)
    forces: Array  # (m, 3, 1 + n) constant forces that act on the bodies, N, and their derivatives


class Tangents(NamedTuple):
    """The tangents of a run with n directions, in parts: a kernel that is handed all of them compiles for minutes."""

    motion: Motion
    rates: Rates
    table: Table
    inputs: Inputs
    outputs: Outputs
    matrices: Array  # (5, 6, 6) scratch
    source: Array  # (LANES TERMS,) the Taylor table of the run


@allocating
def tangents_at(address: int) -> Tangents:
    """The tangents behind an address."""
    at = carray(integers_at(address), (PLACES,))
    counts = carray(integers_at(at[Place.COUNTS]), (COUNTS,))
    n, wide, outputs = counts[Count.DIRECTIONS], counts[Count.COLUMNS], counts[Count.OUTPUTS]
    motion = Motion(
        carray(floats_at(at[Place.OWN]), (LANES * TERMS,)), carray(floats_at(at[Place.Y]), (8,)),
        carray(integers_at(at[Place.MODE]), (3,)), carray(floats_at(at[Place.CLOCK]), (3,)),
        carray(floats_at(at[Place.BODIES]), (3, 4)), carray(floats_at(at[Place.PAIRS]), (2, 2)),
        carray(floats_at(at[Place.BEFORE]), (8,)))
    rates = Rates(
        carray(floats_at(at[Place.X]), (STATES, wide)), carray(floats_at(at[Place.AT]), (STATES, wide)),
        carray(floats_at(at[Place.ACTING]), (3, 4, wide)), carray(floats_at(at[Place.LAW]), (2, 2, wide)))
    table = Table(
        carray(floats_at(at[Place.SERIES]), (wide // WIDTH * BLOCK,)),
        carray(floats_at(at[Place.ROWS]), (ROWS, TERMS)), carray(floats_at(at[Place.FACTORS]), (2, ROOM)),
        carray(floats_at(at[Place.PRODUCTS]), (3, ROOM)))
    inputs = Inputs(
        carray(floats_at(at[Place.GIVEN]), (3, 4, n)), carray(floats_at(at[Place.FORCE]), (3, n)),
        carray(floats_at(at[Place.COULOMB]), (n,)), carray(floats_at(at[Place.CONTROL]), (2, COLUMNS)),
        carray(floats_at(at[Place.CONTROL_RATES]), (2, COLUMNS, n)),
        carray(floats_at(at[Place.NORMALS]), (counts[Count.NORMALS], 2, 2)),
        carray(floats_at(at[Place.WAITING]), (counts[Count.DELAY], 2, n)),
        carray(floats_at(at[Place.EXTERNAL]), (counts[Count.TICKS], 3, n)))
    written = Outputs(
        counts, carray(floats_at(at[Place.NUMBERS]), (NUMBERS,)), carray(floats_at(at[Place.GRID]), (outputs,)),
        carray(floats_at(at[Place.OUT]), (outputs, STATES, n)),
        carray(floats_at(at[Place.FORCES]), (outputs, 3, n + 1)))
    return Tangents(motion, rates, table, inputs, written, carray(floats_at(at[Place.MATRICES]), (5, STATES, STATES)),
                    carray(floats_at(at[Place.C]), (LANES * TERMS,)))


@kernel
def copy_matrix(target: Array, source: Array) -> None:
    """Copy what two matrices have in common, without the scratch that an assignment of arrays may need."""
    for i in range(min(target.shape[0], source.shape[0])):
        for j in range(min(target.shape[1], source.shape[1])):
            target[i, j] = source[i, j]

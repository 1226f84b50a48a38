"""What an observer sees of a segment, and what it remembers of a run."""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple

import numpy as np
from numba import typeof

from grasp_ros.exact.contact.step_unit import higher_order, series_order
from grasp_ros.exact.driver.callback import reader
from grasp_ros.exact.records import Array, Integers, Plant, State, new_run
from grasp_ros.physics.accuracy import FINEST

QUANTITIES = 12  # STATES, and those of `Quantity`
STATES = 8
COUNTS = 4
POSITION, VELOCITY = 0, 1  # columns of gains
SCRATCH_ROWS = 6  # rows of scratch, one polynomial each
LOWER, UPPER = 4, 5  # those of them that hold bounds of the quantities
LONGEST = higher_order(series_order(FINEST)) + 1


class Quantity(IntEnum):
    """What extremes are kept of, behind the eight numbers of the state."""

    IMPACT_L = 8  # N
    IMPACT_R = 9
    INPUT_L = 10  # N
    INPUT_R = 11


class Wanted(IntFlag):
    """What a run is observed for."""

    MOTION = 1  # extremes of positions and velocities
    IMPACTS = 2  # of penetrations and impact forces
    INPUTS = 4  # of the forces of the controllers
    LOSSES = 8  # energy by cause
    SETTLING = 16  # when every body stays within a bound for good
    RISE = 32  # of V_c
    BOUND = 64  # when a body was last outside it within the run


class Seen(IntEnum):
    """Indices of what is remembered; the extremes fill LOW + q and HIGH + q."""

    LOW = 0  # of the quantities
    HIGH = QUANTITIES
    DAMPERS = 2 * QUANTITIES  # energy taken, J
    FEEDBACK = DAMPERS + 1
    FRICTION = DAMPERS + 2
    IMPACTS = DAMPERS + 3
    WORK = DAMPERS + 4  # of held commands and external forces, J
    LEVEL = DAMPERS + 5  # V_c, J
    LEAST = DAMPERS + 6  # of V_c so far
    RISE = DAMPERS + 7  # largest V_c less the least before it
    OUTSIDE = DAMPERS + 8  # of each body: last time outside the bound, s; inf: when the last segment ended
    BOUND = DAMPERS + 11  # m
    SETTLED = DAMPERS + 12  # time from which on no body leaves the bound, s; inf: not in the run; nan: V_c cannot tell
    LAST_OUTSIDE = DAMPERS + 13  # OUTSIDE of each body at the end of the run, s, also where the run goes on to settle


SEEN = Seen.LAST_OUTSIDE + 3
UNDECIDED = -1.0  # in place of SETTLED: V_c is not low enough yet


class Switch(IntEnum):
    """Indices of the integer settings of an observer."""

    WANTED = 0
    CERTAIN = 1  # 1: V_c cannot rise


class Memory(NamedTuple):
    """What an observer is called with: arrays of a run, and its own."""

    c: Array  # (LANES LONGEST,) records.Tables
    size: Array
    y: Array  # records.State
    mode: Integers
    clock: Array
    rest: Array
    bodies: Array  # records.Plant
    given: Array
    pairs: Array
    loop: Array  # (3, 4) bodies with the continuous feedback, whose energy is V_c
    own: Array  # (3, 4) bodies by themselves
    base: Array  # (3, 4) those of them that the motion has without held commands and external forces
    gains: Array  # (2, 2) Kp and Kv of the feedback that acts all the time; 0 where commands are held
    seen: Array  # (SEEN,)
    before: Array  # (8,) y at the begin of the segment
    rows: Array  # (SCRATCH_ROWS, LONGEST) scratch
    counts: Integers  # (COUNTS,) scratch
    switches: Integers  # see `Switch`


def memory_of(plant: Plant, state: State) -> Memory:
    """A memory for the runs that use these arrays; a run brings its tables."""
    scratch = np.zeros((SCRATCH_ROWS, LONGEST))
    return Memory(
        scratch[0], scratch[0], state.y, state.mode, state.clock, state.rest, plant.bodies, plant.given, plant.pairs,
        np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((2, 2)), np.zeros(SEEN), np.zeros(STATES),
        scratch, np.zeros(COUNTS, dtype=np.int64), np.zeros(len(Switch), dtype=np.int64))


memory_at = reader(typeof(memory_of(*new_run()[2:])))


class SegmentRecord(NamedTuple):
    """A segment that has just ended."""

    kind: int  # `layout.Kind`
    t: float  # s
    s: float  # end in the variable of the polynomials
    degree: int
    m: Memory  # with the states at its begin and at its end

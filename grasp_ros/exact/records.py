"""The records that the kernels hand to each other: what a plant is, where it stands, what a run writes.

An array that crosses from Python costs some 60 ns, so that `driver.advance` takes few of them: plant and state cross as
one block of numbers each, of which the arrays of their records are parts.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grasp_ros.physics.control import Column
from grasp_ros.physics.layout import LANES, Cursor, Kind, Pair

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Lanes = tuple[float, float, float, float, float, float, float, float]  # one number of each lane
PerMass = tuple[float, float, float, float]  # 1 / m, k / m, c / m, f / m of a body


class Plant(NamedTuple):
    """What moves and what pushes, see `layout`."""

    given: Array  # (3, 4) by body: m kg, k N/m, c N s/m, f N, as the scene and the inputs of this interval say
    bodies: Array  # (3, 4) the same as it acts in this mode: friction in f, an infinite mass where the object sticks
    pairs: Array  # (2, 2) by side: H N/m^1.5, p s/m; H = 0: no such pair
    coulomb: float  # dry friction of the object, N
    own: Array = np.zeros(3)  # (3,) N by body: forces of the bodies by themselves, to which the inputs are added


BODY_NUMBERS, PAIR_NUMBERS = 12, 4
COULOMB = 2 * BODY_NUMBERS + PAIR_NUMBERS  # its index in the block of a plant
PLANT_NUMBERS, STATE_NUMBERS = COULOMB + 4, 20
REST_INDEX = 17  # where `State.rest` begins in the block of a state


def plant_of(block: Array) -> Plant:
    """A plant whose arrays are parts of a block (PLANT_NUMBERS,)."""
    pairs = 2 * BODY_NUMBERS
    return Plant(block[:BODY_NUMBERS].reshape((3, 4)), block[BODY_NUMBERS:pairs].reshape((3, 4)),
                 block[pairs:COULOMB].reshape((2, 2)), block[COULOMB], block[COULOMB + 1 :])


class State(NamedTuple):
    """Where a run stands; updated in place."""

    y: Array  # (8,) x_l, v_l, x_o, v_o, x_r, v_r, u_l, u_r; m and m/s
    mode: Integers  # (3,) Pair, Pair, Slide; frozen within a segment
    low: Array  # (6,) low words of the positions and velocities of y, see `compensated`
    clock: Array  # (3,) time since the begin of the interval, what its roundings left out, and that begin, s
    rest: Array = np.zeros(3)  # (3,) see `driver.rest`


def state_of(block: Array, mode: Integers) -> State:
    """A state whose numbers are parts of a block (STATE_NUMBERS,)."""
    return State(block[:8], mode, block[8:14], block[14:REST_INDEX], block[REST_INDEX:])


def new_state(*y: float) -> tuple[Array, Integers]:
    """Where a run begins, not at rest, for `state_of`: a block, first the numbers of `State.y`; modes not yet known."""
    return np.array([*y, *[0.0] * (STATE_NUMBERS - 1 - len(y)), np.inf]), _UNKNOWN.copy()


def new_run() -> tuple[Array, Array, Plant, State]:
    """What a run works on: blocks of plant and state, and their records."""
    plant, (state, mode) = np.zeros(PLANT_NUMBERS), new_state()
    return plant, state, plant_of(plant), state_of(state, mode)


class Order(NamedTuple):
    """Where a Taylor series ends."""

    number: int  # of its last term
    first: float  # tolerance^(1 / (number + 1)): where the first neglected term of a series with radius 1 reaches it
    early: int  # order up to which the terms must fall as fast as up to the last one


class Settings(NamedTuple):
    """Accuracy of a run, with its orders."""

    tolerance: float  # first neglected Taylor term, relative to the impact
    one: Order  # of a step with one pair in contact, unless the step is short
    both: Order  # of one with both
    rate: float  # power of two above the rates at which the bodies move by themselves, 1/s


class Output(NamedTuple):
    """What a run writes, and how much of it; updated in place."""

    grid: Array  # (n,) ascending output times on the clock, s
    rows: Array  # (n, 6) states at them
    events: Array  # (m, 5) time s, body, Transition, u m, u' m/s
    filled: Integers  # (2,) rows in use, see `layout.Filled`
    work: Integers  # (4,) counters, see `layout.Work`
    observer: Integers  # (2,) addresses of what is called after each segment and of its context; 0: nothing


class Loop(NamedTuple):
    """Inputs of a run over n intervals, constant in each, and a record of them; see `driver.intervals`."""

    lengths: Array  # (n,) s
    begins: Array  # (n,) s, on the clock of the events
    bounds: Integers  # (n + 1,) output times before each, counted from the first
    cursor: Integers  # (4,) see `layout.Cursor`; updated in place
    inputs: Array = np.zeros((0, 3))  # (n, 3) forces that acted, N by body; (0, 3): those of the plant act on
    external: Array = np.zeros((0, 3))  # (n, 3) external forces, N by body; (0, 3): none
    answers: Array = np.zeros((0, 3))  # (n, 3) commands, N by body; (0, 3): no controllers
    callee: Integers = np.zeros(2, dtype=np.int64)  # (2,) by side, an `Answer` or the address of a function
    laws: Array = np.zeros((2, len(Column)))  # (2, k) rows of `control` by side
    normals: Array = np.zeros((2, 1, 2))  # (2, n, 2) standard normal numbers by side; (2, 1, 2): no noise
    held: Array = np.zeros(2)  # (2,) last commands by side, N; updated in place
    waiting: Array = np.zeros((0, 3))  # (delay, 3) commands on their way, N by body: a ring; updated in place


_UNKNOWN = np.full(3, Pair.UNKNOWN.value)
_FIRST = np.array([-1 if entry == Cursor.FAILED else 0 for entry in Cursor])


def new_cursor(tick: int = 0) -> Integers:
    """Where a loop begins; the tick is that of its first interval. A copy takes half as long as a new array."""
    cursor = _FIRST.copy()
    if tick:
        cursor[Cursor.TICK] = tick
    return cursor


def one_interval(length: float, begin: float, outputs: int) -> Loop:
    """An interval of `length` from `begin` on, in s, with so many output times."""
    return Loop(np.array([length]), np.array([begin]), np.array([0, outputs]), new_cursor())


FACTORS = 32  # numbers of one order in the table of factors


class Tables(NamedTuple):
    """Workspace of one call, flat: LANES Taylor coefficients and FACTORS factors of each order, and scratch.

    The lanes of c have the indices of y, but for `layout.Z`, the depths, and `layout.Lane`, the time since the begin
    of the step and w w or w_l w_r.
    """

    c: Array  # (LANES (order + 1),), with the order of `Settings.both`
    f: Array  # (FACTORS (order + 1),)
    at: Array  # (2 LANES,) values of the lanes at some s, and their changes since 0
    size: Array  # (LANES,) their sums of |c_k| s^k, k >= 2
    row: Array  # (order + 1,) one polynomial


def tables_of(block: Array, order: int) -> Tables:
    """A workspace whose tables are parts of a block (`numbers_of_tables`,), for series up to an order."""
    f = LANES * (order + 1)
    at = f + FACTORS * (order + 1)
    size = at + 2 * LANES
    row = size + LANES
    return Tables(block[:f], block[f:at], block[at:size], block[size:row], block[row:])


def numbers_of_tables(order: int) -> int:
    """Length of the block of a workspace."""
    return (LANES + FACTORS + 1) * (order + 1) + 3 * LANES


class Step(NamedTuple):
    """A Taylor step: what its series stand for."""

    order: Order
    unit: float  # of s, such that the radius of convergence is about 1
    left: bool  # whether the left pair is in contact
    right: bool


class Regime(IntEnum):
    """Form of the closed solution of a flight, see `flight.closed_form.fly`."""

    DRIFT = 0  # no spring, no damper
    UNDER = 1  # under-damped
    NEAR = 2  # critical or over-damped, around a rest position that is near
    OVER = 3  # over-damped, with a rest position far away or none


class Flight(NamedTuple):
    """One body in free flight from (x, v), see `flight.closed_form.launch`."""

    regime: Regime
    x: float  # m
    v: float  # m/s
    swing: float  # x - x_e, m
    x_e: float  # rest position, m; 0 where the regime does not need it
    push: float  # (f - k x) / m, m/s^2
    sigma: float  # c / 2 m, 1/s
    rate: float  # damped frequency, or the half difference of the real roots, 1/s
    omega0_2: float  # k / m, 1/s^2


class Flown(NamedTuple):
    """Where a flight has come to."""

    x: float  # m
    v: float  # m/s
    way: float  # displacement, m, beyond the digits of x; nan: only x is known
    change: float  # of the velocity, m/s, likewise


class Flights(NamedTuple):
    """All bodies in free flight."""

    left: Flight
    right: Flight
    object: Flight


class Segment(NamedTuple):
    """A piece of the motion: what its bodies do from its begin on, and where it ends."""

    kind: Kind
    t: float  # length, s; nan: it is not known
    s: float  # length in the variable of its events: s of a Taylor step, t of a flight
    step: Step  # whose series stand in the tables
    flights: Flights  # of all bodies, or of the arms that touch nothing


class Rates(NamedTuple):
    """What a body's equation of motion divides by its mass, and what bounds its flight."""

    stiffness: float  # k / m, 1/s^2
    damping: float  # c / m, 1/s
    force: float  # f / m, m/s^2
    response: float  # m / c, s: how long a velocity goes on; inf without a damper
    square_time: float  # m / k, s^2; inf without a spring


class PairFlight(NamedTuple):
    """Arm and object in free flight: all that an event of the pair depends on."""

    arm_rates: Rates
    body_rates: Rates
    arm_flight: Flight
    body_flight: Flight
    sign: float  # +1 for the left side, -1 for the right one: u = sign (x - x_o)
    u: float  # at the begin, m
    alike: bool  # equal rates: they move relative to each other as one such body
    horizon: float  # longest time in s of a bound: with c < 0 a motion grows; else inf
    inverse_p: float  # 1 / p, m/s
    x_e: float  # rest position of an arm with a spring, m
    square_rate: float  # of the faster body, 1/s^2


class Motion(NamedTuple):
    """Where arm and object are at some time of a flight."""

    x: float  # m
    v: float  # m/s
    x_o: float
    v_o: float
    u: float  # in a short flight exact where the difference of the positions is not
    d: float  # u'
    size: float  # scale of the rounding of u, m


class Candidate(NamedTuple):
    """The first event of a pair or of the object in a segment."""

    when: float  # time in s in a flight, s in units of the step in contact; inf: none, nan: the search does not end
    what: Any  # the Transition of a pair; of the object the Slide that follows, after a stop `initial_slide` decides


class Push(NamedTuple):
    """What pushes the object, at rest, beside its dry friction."""

    value: float  # N, to the right
    rounding: float  # N, of it and of the friction


class Deciding(NamedTuple):
    """Where a pair at rest at u = 0 goes: the first derivative of u that differs from zero."""

    order: float  # of it; UNDECIDED or NEVER where there is none
    value: float  # m/s^order; > 0: pressed together; inf: by the other pair, which only begins itself


class Ends(NamedTuple):
    """The first event of each pair and of the object in a segment, and where it ends."""

    left: Candidate
    right: Candidate
    slide: Candidate
    end: float  # of the segment; s, or s of a Taylor step


class Level(NamedTuple):
    """An energy, the scale of its rounding, and the penetrations of the same state."""

    value: float  # J of V
    size: float  # J, sum of the sizes of its terms
    u_l: float  # m
    u_r: float

"""Array layouts shared by everything: every index, mode, transition and status.

The state y (8,) is x_l, v_l, x_o, v_o, x_r, v_r, u_l, u_r. The penetrations follow from the positions, which have a low
word each, see `exact.compensated`. Bodies are rows LEFT, RIGHT, OBJECT of an array (3, 4),
pairs are rows LEFT, RIGHT of an array (2, 2).
"""

from enum import IntEnum

EPS = 2.220446049250313e-16  # distance from 1.0 to the next double
BLOCK = 1024  # ticks whose noise is drawn at once


class Body(IntEnum):
    """Rows of the bodies; the first two are also the sides, and the rows of the pairs."""

    LEFT = 0
    RIGHT = 1
    OBJECT = 2


LEFT, RIGHT, OBJECT = Body


class Of(IntEnum):
    """Columns of the bodies."""

    MASS = 0  # kg
    STIFFNESS = 1  # N/m
    DAMPING = 2  # N s/m
    FORCE = 3  # N


class Law(IntEnum):
    """Columns of the pairs: the impact law."""

    HERTZIAN = 0  # H, N/m^1.5
    DISSIPATION = 1  # p, s/m


class X(IntEnum):
    """Indices of the positions in a state, m."""

    L = 0
    O = 2  # noqa: E741
    R = 4


class V(IntEnum):
    """Indices of the velocities, m/s."""

    L = 1
    O = 3  # noqa: E741
    R = 5


class U(IntEnum):
    """Indices of the penetrations, m."""

    L = 6
    R = 7


LANES = 8  # of a table of polynomials: order k holds the coefficients k at LANES k


class Lane(IntEnum):
    """Lanes of a Taylor step in place of the positions of the arms, which follow from the others."""

    TIME = 0
    CHECK = 4  # w w, or w_l w_r


class Z(IntEnum):
    """Lanes of a Taylor step: w = sqrt(u) of a pair in contact, u of an open one."""

    L = 6
    R = 7


class Entry(IntEnum):
    """Columns of the events."""

    TIME = 0  # s
    BODY = 1
    KIND = 2  # Transition
    U = 3  # m
    RATE = 4  # u', m/s


class Pair(IntEnum):
    """What one pair of arm and object does during a segment; frozen until the next event."""

    UNKNOWN = -1  # before the first interval
    OPEN = 0  # u <= 0, no force
    CONTACT = 1  # condition (10) holds
    CLAMPED = 2  # u > 0 and u' < -1/p: no force, may re-enter
    LEAVING = 3  # u > 0, separating, the rest of its impulse is below the tolerance
    RESTING = 4  # u = u' = 0 without force: arm and object move together
    ABSENT = 5  # a body is missing, or its contact: never any force
    BEGINNING = 6  # u >= 0, closing: no force yet, because its impulse is below rounding


class Slide(IntEnum):
    """What dry friction makes of the object during a segment."""

    FREE = 0  # there is none
    RIGHTWARD = 1
    LEFTWARD = 2
    STUCK = 3


class Kind(IntEnum):
    """How a segment of motion is solved."""

    FLIGHT = 0  # a closed form
    CONTACT = 1  # a Taylor step in regularised time: w = sqrt(u) of what touches


class Transition(IntEnum):
    """Events of one pair, and of the object."""

    TOUCH = 0  # u rises through 0
    RELEASE = 1  # u falls through 0
    CLAMP = 2  # u' falls through -1/p while u > 0
    REENTRY = 3  # u' rises through -1/p while u > 0
    STICK = 4  # the object comes to rest by friction
    SLIP = 5  # the force on the object exceeds its friction


class Outcome(IntEnum):
    """Why the kernel returned; what ends a run is called as its `Status`."""

    GO_ON = -1  # it did not
    DONE = 0
    EVENTS_FULL = 1
    NOT_FINITE = 2
    STALLED = 3
    ENERGY_RISES = 4
    WORK_BUDGET = 5
    ENERGY_FALLS = 6
    PENETRATES = 7
    NO_COMMAND = 8  # a controller gave no finite number
    OUTSIDE = 9  # the motion has left the domain


class Answer(IntEnum):
    """Where the command of a side comes from, if not from a function at this address."""

    GIVEN = 0  # from outside; 0 without a controller
    LAW = 1  # the row of the side, see `control`


class Cursor(IntEnum):
    """Where a loop stands."""

    INTERVAL = 0  # done so far in this call
    BEGUN = 1  # whether the inputs of the next one act already
    TICK = 2  # at which the first one begins
    FAILED = 3  # side whose controller gave no number; -1: none


class Filled(IntEnum):
    """Counters of the rows in use."""

    OUTPUTS = 0
    EVENTS = 1


class Work(IntEnum):
    """Columns of the work counters."""

    FLIGHTS = 0  # closed-form segments
    CONTACT_STEPS = 1  # Taylor steps
    REJECTED_STEPS = 2  # Taylor steps shortened after a failed defect test
    ROOT_ITERATIONS = 3  # evaluations of an event function

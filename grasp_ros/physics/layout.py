"""Array layouts shared by everything: one place for every index, mode, transition and status.

The state y (8,) is x_l, v_l, x_o, v_o, x_r, v_r, u_l, u_r. The penetrations are carried beside the positions
because x_l - x_o loses the digits of a shallow contact. Bodies are rows LEFT, RIGHT, OBJECT of an array (3, 4),
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
MASS, STIFFNESS, DAMPING, FORCE = range(4)  # columns of bodies: kg, N/m, N s/m, N
HERTZIAN, DISSIPATION = range(2)  # columns of pairs: N/m^1.5, s/m
X_L, V_L, X_O, V_O, X_R, V_R, U_L, U_R = range(8)
EVENT_TIME, EVENT_BODY, EVENT_KIND, EVENT_U, EVENT_RATE = range(5)  # columns of events: s, Body, Transition, m, m/s
LANES = 8  # of a table of polynomials: order k holds the coefficients k at LANES k
TIME, CHECK = X_L, X_R  # in contact x_l and x_r follow from the others
Z_L, Z_R = U_L, U_R  # w = sqrt(u) of a pair in contact, u of an open one


class Pair(IntEnum):
    """What one pair of arm and object does during a segment; frozen until the next event."""

    UNKNOWN = -1  # before the first interval
    OPEN = 0  # u <= 0, no force
    CONTACT = 1  # condition (10) holds
    CLAMPED = 2  # u > 0 and u' < -1/p: no force, may re-enter
    LEAVING = 3  # u > 0, separating, the rest of its impulse is below the tolerance
    RESTING = 4  # u = u' = 0 without force: arm and object move together
    ABSENT = 5  # a body is missing, or its contact: never any force


class Slide(IntEnum):
    """What dry friction makes of the object during a segment."""

    FREE = 0  # there is none
    RIGHTWARD = 1
    LEFTWARD = 2
    STUCK = 3


class Segment(IntEnum):
    """How a piece of the motion is known, and what its table of polynomials holds."""

    FLIGHT = 0  # a closed form
    CONTACT = 1  # a Taylor step in regularised time: w = sqrt(u) of what touches
    START = 2  # the begin of a contact: u, in powers of t^(1/4)
    CREEP = 3  # an implicit step: u, in powers of t


class Transition(IntEnum):
    """Events of one pair, and of the object."""

    TOUCH = 0  # u rises through 0
    RELEASE = 1  # u falls through 0
    CLAMP = 2  # u' falls through -1/p while u > 0
    REENTRY = 3  # u' rises through -1/p while u > 0
    STICK = 4  # the object comes to rest by friction
    SLIP = 5  # what pushes the object exceeds its friction


class Outcome(IntEnum):
    """Why the kernel returned."""

    GO_ON = -1  # it did not
    DONE = 0
    EVENTS_FULL = 1
    NOT_FINITE = 2
    STALLED = 3
    ENERGY_RISES = 4
    WORK_USED = 5
    SQUEEZED = 6  # a contact is stiff: an implicit step is cheaper
    ENERGY_FALLS = 7
    PENETRATES = 8
    NO_COMMAND = 9  # a controller gave no finite number


class Answer(IntEnum):
    """Where the command of a side comes from, if not from a function at this address."""

    GIVEN = 0  # from outside; 0 without a controller
    LAW = 1  # the row of the side, see `control`


class Place(IntEnum):
    """Where a loop stands."""

    INTERVAL = 0  # done so far in this call
    BEGUN = 1  # whether the inputs of the next one act already
    TICK = 2  # at which the first one begins
    FAILED = 3  # side whose controller gave no number; -1: none


class Filled(IntEnum):
    """Counters of the rows in use and of the steps for which no implicit one is tried; the observer of a run."""

    OUTPUTS = 0
    EVENTS = 1
    WAIT = 2  # contact steps until the next trial
    PENALTY = 3  # their number after the last trial that failed
    OBSERVER = 4  # address of what is called after each segment, see `exact.observer`; 0: nothing
    CONTEXT = 5  # address of what it is called with


class Work(IntEnum):
    """Columns of the work counters."""

    FLIGHTS = 0  # closed-form segments
    CONTACT_STEPS = 1  # Taylor steps, starts and implicit steps
    REJECTED_STEPS = 2  # Taylor steps shortened after a failed defect test, implicit ones given up
    ROOT_ITERATIONS = 3  # evaluations of an event function

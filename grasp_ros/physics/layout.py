"""Array layouts shared by the compiled kernels: one place for every index, mode, event and status.

The state y (8,) is x_l, v_l, x_o, v_o, x_r, v_r, u_l, u_r. The penetrations are carried beside the positions
because x_l - x_o loses the digits of a shallow contact. Bodies are rows LEFT, RIGHT, OBJECT of an array (3, 4),
pairs are rows LEFT, RIGHT of an array (2, 2).
"""

from enum import IntEnum
from typing import Any

import numpy as np

# Typed integers: numba would compile every function once per literal side.
LEFT: Any = np.int64(0)
RIGHT: Any = np.int64(1)
OBJECT: Any = np.int64(2)
MASS, STIFFNESS, DAMPING, FORCE = 0, 1, 2, 3  # columns of bodies: kg, N/m, N s/m, N
HERTZIAN, DISSIPATION = 0, 1  # columns of pairs: N/m^1.5, s/m
X_L, V_L, X_O, V_O, X_R, V_R, U_L, U_R = range(8)
LANES = 8  # of a table of polynomials: order k holds the coefficients k at LANES k
TIME, CHECK = X_L, X_R  # in contact x_l and x_r follow from the others
Z_L, Z_R = U_L, U_R  # w = sqrt(u) of a pair in contact, u of an open one


class Pair(IntEnum):
    """What one pair of arm and object does during a segment; frozen until the next event."""

    OPEN = 0  # u <= 0, no force
    CONTACT = 1  # condition (10) holds
    CLAMPED = 2  # u > 0 and u' < -1/p: no force, may re-enter
    LEAVING = 3  # u > 0, separating, the rest of its impulse is below the tolerance
    HELD = 4  # u = 0 with no direction yet, the first of its impulse is below the tolerance
    ABSENT = 5  # a body is missing, or its contact: never any force


class Slide(IntEnum):
    """What dry friction makes of the object during a segment."""

    FREE = 0  # there is none
    RIGHTWARD = 1
    LEFTWARD = 2
    STUCK = 3


class Transition(IntEnum):
    """Switches of one pair, and of the object."""

    TOUCH = 0  # u rises through 0
    RELEASE = 1  # u falls through 0
    CLAMP = 2  # u' falls through -1/p while u > 0
    REENTRY = 3  # u' rises through -1/p while u > 0
    STICK = 4  # the object comes to rest by friction
    SLIP = 5  # what pushes the object exceeds its friction


class Outcome(IntEnum):
    """Why the kernel returned."""

    DONE = 0
    EVENTS_FULL = 1
    NOT_FINITE = 2
    STALLED = 3
    ENERGY_RISES = 4
    WORK_USED = 5


class Work(IntEnum):
    """Columns of the work counters."""

    FLIGHTS = 0  # closed-form segments
    CONTACT_STEPS = 1  # Taylor steps
    REJECTED_STEPS = 2  # Taylor steps shortened after a failed defect test
    ROOT_ITERATIONS = 3  # evaluations of an event function

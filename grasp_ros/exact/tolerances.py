"""Tolerances: thresholds of rounding, and of terms that the accuracy neglects, each with its reason.

Bounds of a few roundings of the terms at hand stand where they are used, and so do bounds that only save work, such as
the number of iterations after which a search changes its method.
"""

from __future__ import annotations

from grasp_ros.physics.domain import CONSTANTS
from grasp_ros.physics.layout import EPS

# Events and modes. A rounding is EPS = 2^-52 of a number.
TOGETHER = 1.0 + 4.0 * EPS  # events closer than this happen together: their times are sums of a few roundings
DERIVATIVE = 64.0 * EPS  # of the sum of the sizes of its terms: a smaller derivative counts as 0, as their rounding
SURFACE = 4.0  # roundings of the terms of 1 + p u', within which a pair is at u' = -1/p
BEYOND = 2.0 * SURFACE  # roundings below -1/p, where a pair that was at -1/p clamps: nearer, its force only dies out
SURFACE_DRIFT = 1024.0  # as SURFACE, after flights, which leave roundings in u'
FRICTION = 16.0 * EPS  # of the terms of the force on an object at rest and of its friction: their rounding
# Both times the rounding of the force on the object. An object that has just slipped stops at once if the force that
# accelerates it is below SLIDES. It does not slip yet if the force is below the friction by more than SLIPS: this is
# smaller, so that no object slips and stops at once.
SLIDES = 0.5
SLIPS = 0.5 * SLIDES
LEFT_OUT = 0.25  # times the accuracy and mu u': the impulse that a pair may neglect if it is LEAVING
# Both times the larger of the first two Taylor terms of the change of u' until u = 0. A pair whose |u'| is above TURNS
# does not turn back; one whose u' is farther than CLAMPS from -1/p is not clamped. The factors cover the other terms.
TURNS, CLAMPS = 20.0, 4.0

# Searches for a root.
BRACKET = 2.0 * EPS  # of its upper end: an interval that is shorter holds no number between its ends
LAST_CORRECTION, LAST_OF_RISE = 1e-8, 1e-9  # of the result: the last one, because the next is at most its square
AT_ONCE = EPS * EPS  # of a step: when an event happens that is due at its begin, because events lie in (0, t]

# The begin of a contact without its force.
FORCE_FREE = 2.0**-56  # of mu v: the impulse that a pair may neglect; EPS / 16, an eighth of a half ulp

# Rest.
REST = 2.0**-49  # of the scale of a scene: eight roundings, which forces that balance may have
SETTLED = CONSTANTS  # time constants after which a flight may rest

# Displacements computed as such.
# Flights shorter than SHORT_FLIGHT, or FAR_SHORT where the rest position is beyond FAR, take the power series.
SHORT_FLIGHT, FAR_SHORT = 0.25, 1.0  # of the time constants
FAR = 4.0  # times |x|: roundings of a rest position farther away exceed those of x
TERM = 1e-18  # of the sum: a term of the power series that is smaller is its last
SHORT_START = 0.2  # of the time constants, well within those of a short flight
SHORT_WAY = 0.125  # times u at its end: a change of u that is longer has no smaller roundings than u itself

# Taylor steps.
DEFECT = 100.0  # times accuracy plus EPS: allowed defect at the end of a step, see `taylor_step.is_exact`
NOISE = 100.0 * EPS  # of a polynomial with some tens of terms
STILL = 2.0**-4  # of a rounding of the fastest velocity: what a step may neglect of each
CANCELS = 16.0  # times max(|u'|, 1/p): if its terms are larger, u' at the end of a relaxation is their rounding
DECAYS = 2.0  # time constants of a damper that a step may span: terms that cancel are then e^2 times what is left

# The check of a segment.
ENERGY = 128.0  # roundings of the sum of all terms: flights, impacts and differences of positions
NEGLECTED = 100.0  # times the accuracy, of an energy or a way: the error of a step is some first neglected terms
MAX_IDLE = 1000  # segments without progress in time

# The range of numbers. What is smaller has lost its digits, or its squares and products have.
ENERGY_UNDERFLOW = 1e-300  # J: energies of a motion that died out have few digits
DIED_OUT = 1e-150  # m or m/s: squares have left the range of numbers, also those of its inverse
SMALLEST_RATE = 1e-250  # of an event function, in its unit by s
SMALLEST_CHANGE = 1e-290  # of a lane in a Taylor step
STEEP = 1e16  # 1/s: powers of a rate that is larger leave the range

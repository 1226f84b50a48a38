"""How many terms the series of a Taylor step has.

Source: A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods, Experimental Mathematics 14 (2005), section 3.1.
"""

from __future__ import annotations

import math

from grasp_ros.exact.compilation.jit import inlined, kernel
from grasp_ros.exact.records import Order

RADIUS = 0.5  # of convergence of the series of a step, in its units: the least that is usual
LEAST = 12  # order of a Taylor step


def series_order(tolerance: float) -> int:
    """Order that costs least for a tolerance, with one pair in contact; even, see `polynomial.values`.

    Jorba and Zou derive -ln(tolerance) / 2 + 1 from a work that grows with the square of the order. Here the work
    per order is nearly constant, because a product is one short loop over vectors: the measured optimum is higher.
    """
    return 2 * math.ceil(-0.4 * math.log(tolerance) + 2.0)


def higher_order(order: int) -> int:
    """That of steps with both pairs in contact, one and a half times the one of steps with one; even.

    These steps cost more beside their series, and bodies that swing against each other take nothing else: with the
    lower order a quarter more of them, in the same time.
    """
    return 2 * ((3 * order + 2) // 4)


@inlined
def lower_order(order: int) -> int:
    """`higher_order` read backwards."""
    return 2 * (order // 3)


@kernel
def new_order(tolerance: float, number: int, early: int) -> Order:
    """The order of this number, see `records.Order`."""
    return Order(number, math.exp(math.log(tolerance) / (number + 1)), early)


@inlined
def order_for(tolerance: float, highest: Order, reach: float) -> Order:
    """Even order that suffices for a step to a reach in units, at most the highest."""
    part = reach / RADIUS
    if not part < highest.first:
        return highest
    number = max(2 * math.ceil(0.5 * (math.log(tolerance) / math.log(part) - 1.0)), LEAST)
    return new_order(tolerance, number, min(number, highest.early)) if number < highest.number else highest
